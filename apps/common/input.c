/// See input.h.
#define _GNU_SOURCE
#include "input.h"

#include <errno.h>
#include <fcntl.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

static const char* fault_of(int fd);

FILE* input_open(const char* path, const char** reason)
{
    // O_NONBLOCK: opening a FIFO would wait for its writer. It changes nothing for regular files.
    const int fd = open(path, O_RDONLY | O_CLOEXEC | O_NONBLOCK | O_NOCTTY);
    if (fd < 0) {
        *reason = strerror(errno);
        return NULL;
    }
    *reason = fault_of(fd);
    FILE* stream = *reason == NULL ? fdopen(fd, "rb") : NULL;
    if (stream == NULL) {
        *reason = *reason != NULL ? *reason : strerror(errno);
        close(fd);
    }
    return stream;
}

/// Null: a regular file.
static const char* fault_of(int fd)
{
    struct stat facts;
    if (fstat(fd, &facts) != 0) {
        return strerror(errno);
    }
    return S_ISREG(facts.st_mode)   ? NULL
           : S_ISDIR(facts.st_mode) ? "a directory"
                                    : "not a regular file";
}
