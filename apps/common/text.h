/// A text built in a buffer of the caller, for code that must not allocate.
///
///     char buffer[4096];
///     text out = text_in(buffer, sizeof buffer);
///     text_add(&out, "{\"cycle\":%d,\"bus\":", cycle);
///     text_add_string(&out, url);
///     if (out.cut) ...                     // it did not fit
#ifndef VERGE_APPS_TEXT_H
#define VERGE_APPS_TEXT_H

#include <stdbool.h>
#include <stddef.h>

typedef struct text {
    char*  bytes; ///< ends with a zero byte
    size_t size;  ///< [B] without it
    size_t room;
    bool   cut;   ///< an addition did not fit; it and all later ones are missing
} text;

text text_in(char* buffer, size_t size); ///< size >= 1
void text_add(text* self, const char* format, ...) __attribute__((format(printf, 2, 3)));
/// A double as JSON: the shortest decimal that reads back the same, null if it is not finite.
void text_add_double(text* self, double value);
/// The same for a float.
void text_add_float(text* self, float value);
/// A JSON string, in quotes and escaped.
void text_add_string(text* self, const char* words);

#endif
