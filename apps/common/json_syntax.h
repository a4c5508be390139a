/// What is wrong with a text that is no JSON (RFC 8259), in words for its author.
///
/// The parser (cJSON) says where it stopped and not why, and it lets pass what is no JSON: numbers
/// as C spells them (015, 15.), line breaks in strings.
#ifndef VERGE_APPS_JSON_SYNTAX_H
#define VERGE_APPS_JSON_SYNTAX_H

#include <stdbool.h>
#include <stdint.h>

enum { JSON_DEPTH_MAX = 1000 }; ///< objects and arrays inside each other; the parser's limit

typedef struct json_syntax_fault {
    uint32_t line;      ///< from 1: where the text has to be changed
    char     what[200]; ///< "what is wrong, what was expected"
} json_syntax_fault;

/// One document and nothing after it; a byte order mark before it is fine. text: ends with a zero
/// byte. False: *fault is the first trouble.
bool json_syntax_check(const char* text, json_syntax_fault* fault);

#endif
