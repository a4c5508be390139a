/// See text.h.
#include "text.h"

#include "decimal.h"

#include <math.h>
#include <stdarg.h>
#include <stdio.h>

text text_in(char* buffer, size_t size)
{
    buffer[0] = '\0';
    return (text){ .bytes = buffer, .room = size };
}

void text_add(text* self, const char* format, ...)
{
    if (self->cut) {
        return;
    }
    va_list args;
    va_start(args, format);
    const size_t left = self->room - self->size;
    const int written = vsnprintf(self->bytes + self->size, left, format, args);
    va_end(args);
    self->cut = written < 0 || (size_t)written >= left;
    if (self->cut) {
        self->bytes[self->size] = '\0';
    } else {
        self->size += (size_t)written;
    }
}

void text_add_double(text* self, double value)
{
    char decimal[DECIMAL_SIZE] = "null";
    if (isfinite(value)) {
        decimal_from_double(value, decimal);
    }
    text_add(self, "%s", decimal);
}

void text_add_float(text* self, float value)
{
    char decimal[DECIMAL_SIZE] = "null";
    if (isfinite(value)) {
        decimal_from_float(value, decimal);
    }
    text_add(self, "%s", decimal);
}

void text_add_string(text* self, const char* words)
{
    text_add(self, "\"");
    for (const unsigned char* c = (const unsigned char*)words; *c != '\0'; ++c) {
        if (*c == '"' || *c == '\\') {
            text_add(self, "\\%c", *c);
        } else if (*c < ' ' || *c == 0x7f) {
            text_add(self, "\\u%04x", (unsigned)*c);
        } else {
            text_add(self, "%c", *c);
        }
    }
    text_add(self, "\"");
}
