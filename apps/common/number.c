/// See number.h.
#define _GNU_SOURCE
#include "number.h"

#include "decimal.h"

#include <inttypes.h>
#include <math.h>
#include <stdbool.h>
#include <stdlib.h>

void number_write(FILE* out, double value)
{
    if (!isfinite(value)) {
        fputs("null", out);
        return;
    }
    char text[DECIMAL_SIZE];
    decimal_from_double(value, text);
    fputs(text, out);
}

void number_write_u64(FILE* out, uint64_t value)
{
    const char* quote = value > UINT64_C(1) << 53 ? "\"" : "";
    fprintf(out, "%s%" PRIu64 "%s", quote, value, quote);
}

void digest_write(FILE* out, uint64_t digest)
{
    fprintf(out, "\"%016" PRIx64 "\"", digest);
}

void string_write(FILE* out, const char* text)
{
    fputc('"', out);
    for (const unsigned char* c = (const unsigned char*)text; *c != '\0'; ++c) {
        if (*c == '"' || *c == '\\') {
            fprintf(out, "\\%c", *c);
        } else if (*c < ' ' || *c == 0x7f) {
            fprintf(out, "\\u%04x", (unsigned)*c);
        } else {
            fputc(*c, out);
        }
    }
    fputc('"', out);
}

void value_write(FILE* out, const cJSON* value)
{
    if (cJSON_IsNumber(value)) {
        number_write(out, value->valuedouble);
    } else if (cJSON_IsString(value)) {
        string_write(out, value->valuestring);
    } else if (cJSON_IsObject(value) || cJSON_IsArray(value)) {
        fputc(cJSON_IsObject(value) ? '{' : '[', out);
        for (const cJSON* child = value->child; child != NULL; child = child->next) {
            if (child->string != NULL) {
                string_write(out, child->string);
                fputc(':', out);
            }
            value_write(out, child);
            if (child->next != NULL) {
                fputc(',', out);
            }
        }
        fputc(cJSON_IsObject(value) ? '}' : ']', out);
    } else {
        fputs(cJSON_IsTrue(value) ? "true" : cJSON_IsFalse(value) ? "false" : "null", out);
    }
}

char* value_text(const cJSON* value)
{
    char*  text = NULL;
    size_t size = 0;
    FILE*  out = open_memstream(&text, &size);
    if (out == NULL) {
        return NULL;
    }
    value_write(out, value);
    const bool written = ferror(out) == 0;
    if (fclose(out) != 0 || !written) {
        free(text);
        return NULL;
    }
    return text;
}
