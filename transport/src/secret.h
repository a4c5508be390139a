/// Opens files to read: regular files only, and keys only if no other user may read them.
#ifndef SECRET_H
#define SECRET_H

#include <stddef.h>

/// A descriptor of a regular file, opened without waiting, or -1 with the reason, in words that fit
/// between parentheses. A FIFO or a device is refused, because reading it could wait for ever.
int regular_open(const char* path, const char** reason);

/// The same for a private or shared key; -1: error is `PATH: what is wrong, what to do`. A file
/// that the group or others may read or write is refused, because its key may be known already.
int secret_open(const char* path, char* error, size_t error_size);

#endif
