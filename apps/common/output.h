/// A file that is complete or absent: it is written under another name in the same folder and
/// renamed when it is complete. A file that is not regular (a pipe, /dev/stdout) is written
/// directly. One output is open at a time.
#ifndef VERGE_APPS_OUTPUT_H
#define VERGE_APPS_OUTPUT_H

#include <stdbool.h>
#include <stdio.h>

typedef struct output {
    FILE* stream;          ///< null: not open
    char  path[4096];
    char  partial[4128];   ///< the other name; "" if written directly
} output;

/// False: the reason is in errno.
bool output_open(output* out, const char* path);
/// Completes the file. False (errno): it could not be completed and was removed.
bool output_close(output* out);
/// Removes the incomplete file. No effect if none is open.
void output_abandon(output* out);
/// After output_open() or output_close() has failed: one line on standard error with the reason in
/// errno.
void output_report(const char* path);
/// True: all of standard output is written. False: one line on standard error states the reason.
bool output_flush(const char* program);
/// SIGINT, SIGTERM and SIGHUP remove the incomplete file before they end the program. For programs
/// that do not handle these signals themselves.
void output_guard_signals(void);

#endif
