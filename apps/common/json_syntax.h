/// Checks that a text is JSON (RFC 8259) and reports its first fault in plain words.
///
/// The parser (cJSON) reports where it stopped but not why, and it accepts texts that are not JSON:
/// numbers in C notation (015, 15.) and line breaks in strings.
#ifndef VERGE_APPS_JSON_SYNTAX_H
#define VERGE_APPS_JSON_SYNTAX_H

#include <stdbool.h>
#include <stdint.h>

enum { JSON_DEPTH_MAX = 1000 }; ///< nested objects and arrays; the parser's limit

typedef struct json_syntax_fault {
    uint32_t line;      ///< from 1: where the text has to be changed
    char     what[200]; ///< "what is wrong, what was expected"
} json_syntax_fault;

/// One document with nothing after it; a byte order mark before it is accepted. text: ends with a
/// zero byte. False: *fault is the first fault.
bool json_syntax_check(const char* text, json_syntax_fault* fault);

#endif
