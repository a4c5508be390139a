/// For LD_PRELOAD: a disk that hangs. rename() to a path that ends with .prom never returns.
#define _GNU_SOURCE
#include <dlfcn.h>
#include <string.h>
#include <unistd.h>

int rename(const char* from, const char* to)
{
    const size_t length = strlen(to);
    while (length > 5 && strcmp(to + length - 5, ".prom") == 0) {
        pause();
    }
    int (*next)(const char*, const char*) = (int (*)(const char*, const char*))dlsym(RTLD_NEXT,
                                                                                   "rename");
    return next(from, to);
}
