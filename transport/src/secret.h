/// Opening files to read: regular files only, and private ones only where nobody else may read
/// them.
#ifndef SECRET_H
#define SECRET_H

#include <stddef.h>

/// A descriptor of a regular file, opened without waiting, or -1 with *reason saying why, in words
/// that fit between parentheses. A FIFO or a device is refused: reading it could wait for ever.
int regular_open(const char* path, const char** reason);

/// The same for a private or shared key, or -1 with error holding `PATH: what is wrong, what to
/// do`. A file that the group or others may read or write is refused: what it holds may be known
/// already.
int secret_open(const char* path, char* error, size_t error_size);

#endif
