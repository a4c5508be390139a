/// A file that is there whole or not at all: written beside its place under another name and
/// moved there when it is complete. What is no regular file (a pipe, /dev/stdout) is written
/// directly. One output is open at a time.
#ifndef VERGE_APPS_OUTPUT_H
#define VERGE_APPS_OUTPUT_H

#include <stdbool.h>
#include <stdio.h>

typedef struct output {
    FILE* stream;          ///< null: not open
    char  path[4096];
    char  partial[4128];   ///< the other name; "" where written directly
} output;

/// False: the reason is in errno.
bool output_open(output* out, const char* path);
/// Completes the file. False (errno): it could not be written whole, and nothing is left of it.
bool output_close(output* out);
/// Gives up: nothing is left of it. Does nothing where nothing is open.
void output_abandon(output* out);
/// Has all of standard output been written? Else one line on standard error says why not.
bool output_flush(const char* program);
/// SIGINT, SIGTERM and SIGHUP take the partial file away before they end the program. For
/// programs that do not handle these signals themselves.
void output_guard_signals(void);

#endif
