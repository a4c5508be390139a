/// See data.h.
#define _GNU_SOURCE
#include "data.h"

#include <stdio.h>
#include <string.h>
#include <unistd.h>

const char* data_path(char path[DATA_PATH_SIZE], const char* name)
{
    char          self[DATA_PATH_SIZE / 2];
    const ssize_t length = readlink("/proc/self/exe", self, sizeof self - 1);
    self[length > 0 ? length : 0] = '\0';
    for (int level = 0; level < 2; ++level) { // the program's name, then its bin
        char* slash = strrchr(self, '/');
        if (slash == NULL) {
            snprintf(self, sizeof self, ".");
            break;
        }
        *slash = '\0';
    }
    snprintf(path, DATA_PATH_SIZE, "%s/share/verge/%.400s", self, name);
    return path;
}
