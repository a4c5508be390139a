/// Replaces a small file as a whole: a reader gets the old or the new content, never a part.
#ifndef VERGE_DAEMON_REPLACE_H
#define VERGE_DAEMON_REPLACE_H

#include <stddef.h>

/// Writes PATH.tmp and renames it to PATH, mode 0644. Returns 0 or an errno; then PATH.tmp is
/// removed. Nothing allocates. The file is not synced to the disk.
int replace_file(const char* path, const char* bytes, size_t size);

#endif
