/// Opening a file that is read as a whole: a configuration, a road, a scenario, a recording.
///
/// Only regular files are accepted. Reading a FIFO or a device may never end, and reading a
/// directory gives a different error on each system.
#ifndef VERGE_APPS_INPUT_H
#define VERGE_APPS_INPUT_H

#include <stdio.h>

/// A stream to read from, to be closed with fclose(). Never blocks. Null: *reason is a short text
/// for use in parentheses, valid until the next call of strerror().
FILE* input_open(const char* path, const char** reason);

#endif
