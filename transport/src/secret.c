#include "secret.h"

#include <errno.h>
#include <fcntl.h>
#include <stdio.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

int secret_open(const char* path, char* error, size_t error_size)
{
    const int fd = open(path, O_RDONLY | O_CLOEXEC | O_NONBLOCK); // a pipe must not block us
    if (fd < 0) {
        snprintf(error, error_size, "%s: cannot be read (%s), expected a file this user may "
                 "read", path, strerror(errno));
        return -1;
    }
    struct stat facts;
    if (fstat(fd, &facts) != 0 || !S_ISREG(facts.st_mode)) {
        snprintf(error, error_size, "%s: is no file, expected a key", path);
    } else if ((facts.st_mode & (S_IRWXG | S_IRWXO)) != 0) {
        snprintf(error, error_size,
                 "%s: others can get at this key (mode %04o), expected 0600: chmod 600 it, and "
                 "make a new one where others may have read it",
                 path, (unsigned)(facts.st_mode & 07777));
    } else {
        return fd;
    }
    close(fd);
    return -1;
}
