/// A small file that is replaced as a whole, so that whoever reads it never sees a half.
#ifndef VERGE_RSU_REPLACE_H
#define VERGE_RSU_REPLACE_H

#include <stddef.h>

/// Writes PATH.tmp and moves it to PATH, mode 0644. Returns 0 or an errno; then nothing is left of
/// the new one. Nothing allocates. The file is not forced to the disk: it tells of now.
int replace_file(const char* path, const char* bytes, size_t size);

#endif
