#include "secret.h"

#include <errno.h>
#include <fcntl.h>
#include <stdio.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

int regular_open(const char* path, const char** reason)
{
    // O_NONBLOCK: opening a FIFO would wait for its writer. It changes nothing for regular files.
    const int fd = open(path, O_RDONLY | O_CLOEXEC | O_NONBLOCK | O_NOCTTY);
    struct stat facts;
    if (fd < 0 || fstat(fd, &facts) != 0) {
        *reason = strerror(errno);
    } else if (!S_ISREG(facts.st_mode)) {
        *reason = S_ISDIR(facts.st_mode) ? "a directory" : "not a regular file";
    } else {
        return fd;
    }
    if (fd >= 0) {
        close(fd);
    }
    return -1;
}

int secret_open(const char* path, char* error, size_t error_size)
{
    const char* reason = NULL;
    const int   fd = regular_open(path, &reason);
    if (fd < 0) {
        snprintf(error, error_size, "%s: cannot be read (%s), expected a file this user may "
                 "read", path, reason);
        return -1;
    }
    struct stat facts;
    if (fstat(fd, &facts) != 0 || (facts.st_mode & (S_IRWXG | S_IRWXO)) != 0) {
        snprintf(error, error_size,
                 "%s: others can get at this key (mode %04o), expected 0600: chmod 600 it, and "
                 "make a new one where others may have read it",
                 path, (unsigned)(facts.st_mode & 07777));
        close(fd);
        return -1;
    }
    return fd;
}
