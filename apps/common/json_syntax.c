/// See json_syntax.h. A recursive descent through the grammar of RFC 8259; its depth is bounded.
#include "json_syntax.h"

#include <stdarg.h>
#include <stdio.h>
#include <string.h>

typedef struct scanner {
    const char*        text;
    const char*        at;
    const char*        opened; ///< the innermost bracket that is not closed; null: none
    uint32_t           depth;
    json_syntax_fault* fault;
} scanner;

static bool value_scan(scanner* self);
static bool object_scan(scanner* self);
static bool array_scan(scanner* self);
static bool string_scan(scanner* self);
static bool number_scan(scanner* self);
static bool word_scan(scanner* self);
static void space_skip(scanner* self);
static bool unexpected(scanner* self, const char* expected);
static bool refuse(scanner* self, const char* at, const char* format, ...)
    __attribute__((format(printf, 3, 4)));

bool json_syntax_check(const char* text, json_syntax_fault* fault)
{
    scanner self = { .text = text, .at = text, .fault = fault };
    if (strncmp(text, "\xef\xbb\xbf", 3) == 0) {
        self.at += 3; // byte order mark
    }
    space_skip(&self);
    if (*self.at == '\0') {
        return refuse(&self, self.at, "is empty, expected a JSON document");
    }
    if (!value_scan(&self)) {
        return false;
    }
    space_skip(&self);
    return *self.at == '\0' || unexpected(&self, "the end of the file after the document");
}

static bool nested_scan(scanner* self, bool (*scan)(scanner*))
{
    const char* outer = self->opened;
    if (++self->depth > JSON_DEPTH_MAX) {
        return refuse(self, self->at, "more than %d brackets inside each other, expected fewer",
                      JSON_DEPTH_MAX);
    }
    self->opened = self->at++;
    if (!scan(self)) {
        return false;
    }
    self->opened = outer;
    --self->depth;
    return true;
}

static bool value_scan(scanner* self)
{
    const char first = *self->at;
    if (first == '{') {
        return nested_scan(self, object_scan);
    }
    if (first == '[') {
        return nested_scan(self, array_scan);
    }
    if (first == '"') {
        return string_scan(self);
    }
    if (first != '\0' && strchr("+-.0123456789", first) != NULL) {
        return number_scan(self);
    }
    return word_scan(self);
}

/// After a value inside brackets: the closing bracket, or a comma and another value.
static bool another_scan(scanner* self, char close, const char* expected, bool* another)
{
    space_skip(self);
    *another = *self->at == ',';
    if (!*another && *self->at != close) {
        return unexpected(self, expected);
    }
    const char* comma = self->at++;
    space_skip(self);
    if (*another && *self->at == close) {
        return refuse(self, comma, "a comma before \"%c\", expected no comma after the last %s",
                      close, close == '}' ? "member" : "element");
    }
    return true;
}

static bool object_scan(scanner* self)
{
    space_skip(self);
    bool another = *self->at != '}';
    self->at += another ? 0 : 1;
    while (another) {
        if (*self->at != '"') {
            return unexpected(self, "a key in double quotes");
        }
        if (!string_scan(self)) {
            return false;
        }
        space_skip(self);
        if (*self->at != ':') {
            return unexpected(self, "\":\" after a key");
        }
        ++self->at;
        space_skip(self);
        if (!value_scan(self) ||
            !another_scan(self, '}', "\",\" or \"}\" after a value", &another)) {
            return false;
        }
    }
    return true;
}

static bool array_scan(scanner* self)
{
    space_skip(self);
    bool another = *self->at != ']';
    self->at += another ? 0 : 1;
    while (another) {
        if (!value_scan(self) ||
            !another_scan(self, ']', "\",\" or \"]\" after a value", &another)) {
            return false;
        }
    }
    return true;
}

/// The code of \uXXXX here; 0: there is none. \u0000 is refused, because texts end with zero.
static unsigned unicode_at(const char* at)
{
    unsigned code = 0;
    if (at[0] != '\\' || at[1] != 'u' || strspn(at + 2, "0123456789abcdefABCDEF") < 4) {
        return 0;
    }
    return sscanf(at + 2, "%4x", &code) == 1 ? code : 0;
}

static bool escape_scan(scanner* self)
{
    if (self->at[1] == 'u') {
        const unsigned code = unicode_at(self->at);
        const bool     high = code >= 0xd800 && code < 0xdc00;
        const bool     low = code >= 0xdc00 && code < 0xe000;
        const unsigned second = high ? unicode_at(self->at + 6) : 0;
        if (code == 0 || low || (high && !(second >= 0xdc00 && second < 0xe000))) {
            return refuse(self, self->at, "\"%.6s\" is not a character, expected \\u and four"
                          " hexadecimal digits, above ffff a pair of them", self->at);
        }
        self->at += high ? 12 : 6;
        return true;
    }
    if (self->at[1] == '\0' || strchr("\"\\/bfnrt", self->at[1]) == NULL) {
        return refuse(self, self->at, "\"%.2s\" is not a JSON escape, expected one of"
                      " \\\" \\\\ \\/ \\b \\f \\n \\r \\t \\u", self->at);
    }
    self->at += 2;
    return true;
}

static bool string_scan(scanner* self)
{
    const char* begin = self->at++;
    while (*self->at != '"') {
        if (*self->at == '\0' || *self->at == '\n') {
            return refuse(self, begin, "a string that does not end on its line, expected its"
                                       " closing quote");
        }
        if ((unsigned char)*self->at < ' ') {
            return refuse(self, self->at, "a control character in a string, expected it escaped"
                                          " as \\u%04x", (unsigned)*self->at);
        }
        if (*self->at == '\\') {
            if (!escape_scan(self)) {
                return false;
            }
        } else {
            ++self->at;
        }
    }
    ++self->at;
    return true;
}

static const char* digits_skip(const char* at)
{
    return at + strspn(at, "0123456789");
}

/// The end of a number in the form of RFC 8259, section 6; null: there is none here.
static const char* number_end(const char* at)
{
    at += *at == '-';
    const char* whole = at;
    at = *at == '0' ? at + 1 : digits_skip(at);
    if (at == whole) {
        return NULL;
    }
    if (*at == '.') {
        const char* fraction = at + 1;
        at = digits_skip(fraction);
        if (at == fraction) {
            return NULL;
        }
    }
    if (*at == 'e' || *at == 'E') {
        at += at[1] == '+' || at[1] == '-' ? 2 : 1;
        const char* exponent = at;
        at = digits_skip(exponent);
        if (at == exponent) {
            return NULL;
        }
    }
    return at;
}

/// Length of the text up to the next separator, as shown in a fault.
static int word_length(const char* at)
{
    const size_t length = strcspn(at, " \t\r\n,:[]{}\"");
    return length < 24 ? (int)length : 24;
}

static bool number_scan(scanner* self)
{
    const size_t length = strcspn(self->at, " \t\r\n,:[]{}\"");
    if (number_end(self->at) != self->at + length) {
        return refuse(self, self->at, "\"%.*s\" is not a JSON number, expected one like 15, 15.0 or"
                                      " 1e-3", word_length(self->at), self->at);
    }
    self->at += length;
    return true;
}

static bool word_scan(scanner* self)
{
    static const char* const WORDS[] = { "true", "false", "null" };
    const size_t length = strcspn(self->at, " \t\r\n,:[]{}\"");
    for (uint32_t i = 0; i < sizeof WORDS / sizeof WORDS[0]; ++i) {
        if (strlen(WORDS[i]) == length && strncmp(self->at, WORDS[i], length) == 0) {
            self->at += length;
            return true;
        }
    }
    return unexpected(self, "a value: a number, a string, true, false, null, an object or an"
                            " array");
}

static void space_skip(scanner* self)
{
    self->at += strspn(self->at, " \t\r\n");
}

static uint32_t line_of(const scanner* self, const char* at)
{
    uint32_t line = 1;
    for (const char* c = self->text; c < at; ++c) {
        line += *c == '\n';
    }
    return line;
}

/// Reports the text at this position and what the grammar expects there.
static bool unexpected(scanner* self, const char* expected)
{
    if (*self->at == '\0') {
        return refuse(self, self->at, "ends too early: the \"%c\" of line %u is not closed,"
                                      " expected %s", self->opened != NULL ? *self->opened : '{',
                      line_of(self, self->opened != NULL ? self->opened : self->text), expected);
    }
    if (self->at[0] == '/' && (self->at[1] == '/' || self->at[1] == '*')) {
        return refuse(self, self->at, "a comment, which JSON does not have, expected %s", expected);
    }
    if (*self->at == '"') {
        const int length = (int)strcspn(self->at + 1, "\"\n");
        return refuse(self, self->at, "found the string \"%.*s\", expected %s",
                      length < 24 ? length : 24, self->at + 1, expected);
    }
    const int length = word_length(self->at);
    return refuse(self, self->at, "found \"%.*s\", expected %s", length > 0 ? length : 1, self->at,
                  expected);
}

static bool refuse(scanner* self, const char* at, const char* format, ...)
{
    self->fault->line = line_of(self, at);
    va_list arguments;
    va_start(arguments, format);
    vsnprintf(self->fault->what, sizeof self->fault->what, format, arguments);
    va_end(arguments);
    for (char* c = self->fault->what; *c != '\0'; ++c) {
        if ((unsigned char)*c < ' ' || *c == 0x7f) {
            *c = '?'; // text of the file must not break the line
        }
    }
    return false;
}
