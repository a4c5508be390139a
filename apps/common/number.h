/// Writing JSON: numbers, strings and whole values, with numbers as in decimal.h.
#ifndef VERGE_APPS_NUMBER_H
#define VERGE_APPS_NUMBER_H

#include <cjson/cJSON.h>
#include <stdint.h>
#include <stdio.h>

/// The shortest decimal that reads back as the same double; not finite: null. -0 is written 0.
void number_write(FILE* out, double value);
/// A 64-bit number: up to 2^53 as a number, above as a string of digits (see json_as_u64()).
void number_write_u64(FILE* out, uint64_t value);
/// 16 hexadecimal digits in quotes.
void digest_write(FILE* out, uint64_t digest);
/// A string in quotes, escaped where necessary.
void string_write(FILE* out, const char* text);
/// A parsed value on one line.
void value_write(FILE* out, const cJSON* value);
/// The same in memory, to be freed; null: out of memory. cJSON's own printer is not used, because
/// it may change the last bit of a number.
char* value_text(const cJSON* value);

#endif
