/// Opening files that nobody else may read: private keys, shared keys.
#ifndef SECRET_H
#define SECRET_H

#include <stddef.h>

/// A descriptor to read from, or -1 with error holding `PATH: what is wrong, what to do`. A file
/// that the group or others may read or write is refused: what it holds may be known already.
int secret_open(const char* path, char* error, size_t error_size);

#endif
