/// See replace.h.
#define _GNU_SOURCE
#include "replace.h"

#include <errno.h>
#include <fcntl.h>
#include <stdio.h>
#include <unistd.h>

int replace_file(const char* path, const char* bytes, size_t size)
{
    char partial[4096];
    const int length = snprintf(partial, sizeof partial, "%s.tmp", path);
    if (length < 0 || (size_t)length >= sizeof partial) {
        return ENAMETOOLONG;
    }
    // Always a new file: never the target of a link, nor a FIFO, which would wait for a reader.
    unlink(partial);
    const int fd = open(partial, O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, 0644);
    if (fd < 0) {
        return errno;
    }
    errno = 0;
    const ssize_t written = write(fd, bytes, size);
    int trouble = written == (ssize_t)size ? 0 : errno != 0 ? errno : ENOSPC;
    if (close(fd) != 0 && trouble == 0) {
        trouble = errno;
    }
    if (trouble == 0 && rename(partial, path) != 0) {
        trouble = errno;
    }
    if (trouble != 0) {
        unlink(partial);
    }
    return trouble;
}
