/// See json.h. The syntax is checked first (json_syntax.h), then cJSON parses the text, and then
/// the whole document is checked for keys that appear twice and numbers that overflow.
#include "json.h"

#include "decimal.h"
#include "input.h"
#include "json_syntax.h"

#include <errno.h>
#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static const char* read_file(const char* path, char** text, size_t* size);
static void text_parse(json_file* file, const char* text, size_t size);
static size_t text_end(const char* text, size_t size);
static void check_values(const json_at* at);
static void path_write(const json_at* at, char* text, size_t size);
static const char* kind_of(const json_at* at);

/// A double represents all integers up to this one exactly.
static const double INTEGER_EXACT_MAX = 9007199254740992.0; // 2^53

bool json_file_load(json_file* file, const char* path)
{
    char*  text = NULL;
    size_t size = 0;
    const char* reason = read_file(path, &text, &size);
    if (reason != NULL) {
        *file = (json_file){ .missing = true };
        snprintf(file->error, sizeof file->error,
                 "%s:file: cannot be read (%s), expected a JSON file of at most %d MiB\n", path,
                 reason, JSON_FILE_SIZE_MAX >> 20);
        return false;
    }
    const bool parsed = json_file_parse(file, path, text, size);
    free(text);
    return parsed;
}

bool json_file_parse(json_file* file, const char* name, const char* text, size_t size)
{
    *file = (json_file){ .name = strdup(name) };
    char* copy = malloc(size + 1); // with a terminating zero for the parser
    if (copy == NULL || file->name == NULL) {
        snprintf(file->error, sizeof file->error, "%s:file: out of memory\n", name);
    } else {
        memcpy(copy, text, size);
        copy[size] = '\0';
        text_parse(file, copy, size);
    }
    free(copy);
    if (file->error[0] != '\0') {
        json_file_free(file);
        return false;
    }
    return true;
}

static void text_parse(json_file* file, const char* text, size_t size)
{
    const size_t bad = text_end(text, size);
    json_syntax_fault fault;
    if (bad < size) {
        uint32_t line = 1;
        for (size_t i = 0; i < bad; ++i) {
            line += text[i] == '\n';
        }
        snprintf(file->error, sizeof file->error, "%s:%u: not text, expected JSON in UTF-8\n",
                 file->name, line);
    } else if (!json_syntax_check(text, &fault)) {
        snprintf(file->error, sizeof file->error, "%s:%u: %s\n", file->name, fault.line,
                 fault.what);
    } else if ((file->document = cJSON_ParseWithOpts(text, NULL, true)) == NULL) {
        snprintf(file->error, sizeof file->error, "%s:file: out of memory\n", file->name);
    } else {
        const json_at root = json_root(file);
        check_values(&root);
    }
}

void json_file_free(json_file* file)
{
    cJSON_Delete(file->document);
    free(file->name);
    file->document = NULL;
    file->name = NULL;
}

json_at json_root(json_file* file)
{
    return (json_at){ .file = file, .node = file->document };
}

json_at json_member(const json_at* of, const char* key)
{
    const cJSON* node = cJSON_IsObject(of->node)
                            ? cJSON_GetObjectItemCaseSensitive(of->node, key) : NULL;
    return (json_at){ .file = of->file, .parent = of, .node = node, .key = key };
}

json_at json_element(const json_at* of, const cJSON* node, uint32_t index)
{
    return (json_at){ .file = of->file, .parent = of, .node = node, .index = index };
}

bool json_given(const json_at* at)
{
    return at->node != NULL;
}

bool json_none(const json_at* at)
{
    return at->node == NULL || cJSON_IsNull(at->node);
}

bool json_fail(const json_at* at, const char* format, ...)
{
    json_file* file = at->file;
    if (file->error[0] != '\0') {
        return false;
    }
    char path[128], what[256];
    path_write(at, path, sizeof path);
    va_list arguments;
    va_start(arguments, format);
    vsnprintf(what, sizeof what, format, arguments);
    va_end(arguments);
    for (char* c = what; *c != '\0'; ++c) {
        if ((unsigned char)*c < ' ') {
            *c = '?'; // text of the file must not break the line
        }
    }
    snprintf(file->error, sizeof file->error, "%s:%s: %s\n", file->name, path, what);
    return false;
}

bool json_expect_object(const json_at* at, const char* const* keys)
{
    if (!cJSON_IsObject(at->node)) {
        return json_fail(at, "is %s, expected an object", kind_of(at));
    }
    for (const cJSON* child = at->node->child; child != NULL; child = child->next) {
        const char* const* key = keys;
        while (*key != NULL && strcmp(*key, child->string) != 0) {
            ++key;
        }
        if (*key == NULL) {
            char   known[320] = "";
            size_t used = 0;
            for (key = keys; *key != NULL && used < sizeof known; ++key) {
                used += (size_t)snprintf(known + used, sizeof known - used, "%s%s",
                                         key == keys ? "" : ", ", *key);
            }
            const json_at unknown = json_member(at, child->string);
            return json_fail(&unknown, "unknown key \"%.40s\", expected one of: %s", child->string,
                             known);
        }
    }
    return true;
}

uint32_t json_expect_array(const json_at* at, uint32_t min, uint32_t max)
{
    if (!cJSON_IsArray(at->node)) {
        json_fail(at, "is %s, expected an array", kind_of(at));
        return min;
    }
    uint32_t count = 0;
    for (const cJSON* child = at->node->child; child != NULL; child = child->next) {
        ++count;
    }
    if (count < min || count > max) {
        const char* plural = count == 1 ? "" : "s";
        if (min == max) {
            json_fail(at, "has %u element%s, expected %u", count, plural, min);
        } else {
            json_fail(at, "has %u element%s, expected %u to %u", count, plural, min, max);
        }
        return min;
    }
    return count;
}

double json_double(const json_at* of, const char* key, double min, double max)
{
    const json_at at = json_member(of, key);
    return json_as_double(&at, min, max);
}

double json_double_or(const json_at* of, const char* key, double min, double max, double otherwise)
{
    const json_at at = json_member(of, key);
    return at.node == NULL ? otherwise : json_as_double(&at, min, max);
}

int64_t json_integer(const json_at* of, const char* key, int64_t min, int64_t max)
{
    const json_at at = json_member(of, key);
    return json_as_integer(&at, min, max);
}

int64_t json_integer_or(const json_at* of, const char* key, int64_t min, int64_t max,
                        int64_t otherwise)
{
    const json_at at = json_member(of, key);
    return at.node == NULL ? otherwise : json_as_integer(&at, min, max);
}

bool json_bool_or(const json_at* of, const char* key, bool otherwise)
{
    const json_at at = json_member(of, key);
    if (at.node == NULL) {
        return otherwise;
    }
    if (!cJSON_IsBool(at.node)) {
        json_fail(&at, "is %s, expected true or false", kind_of(&at));
        return otherwise;
    }
    return cJSON_IsTrue(at.node);
}

const char* json_string(const json_at* of, const char* key)
{
    const json_at at = json_member(of, key);
    if (!cJSON_IsString(at.node)) {
        json_fail(&at, "is %s, expected a string", kind_of(&at));
        return "";
    }
    return at.node->valuestring;
}

const char* json_string_or(const json_at* of, const char* key, const char* otherwise)
{
    const json_at at = json_member(of, key);
    return at.node == NULL ? otherwise : json_string(of, key);
}

char* json_join(const json_at* at)
{
    const char* path = at->node->valuestring;
    const char* from = at->file->name;
    const char* slash = strrchr(from, '/');
    const size_t folder = path[0] == '/' || slash == NULL ? 0 : (size_t)(slash - from) + 1;
    char* joined = malloc(folder + strlen(path) + 1);
    if (joined == NULL) {
        return NULL;
    }
    memcpy(joined, from, folder);
    memcpy(joined + folder, path, strlen(path) + 1);
    return joined;
}

char* json_path(const json_at* at)
{
    char* joined = json_join(at);
    char* absolute = joined != NULL ? realpath(joined, NULL) : NULL;
    if (absolute == NULL) {
        return joined; // there is no such file; opening it will report that
    }
    free(joined);
    return absolute;
}

uint32_t json_choice(const json_at* of, const char* key, const char* const* names)
{
    const json_at at = json_member(of, key);
    const bool    is_text = cJSON_IsString(at.node);
    char   expected[192] = "";
    size_t used = 0;
    for (uint32_t i = 0; names[i] != NULL; ++i) {
        if (is_text && strcmp(names[i], at.node->valuestring) == 0) {
            return i;
        }
        if (used < sizeof expected) {
            used += (size_t)snprintf(expected + used, sizeof expected - used, "%s\"%s\"",
                                     i == 0 ? "" : " or ", names[i]);
        }
    }
    if (is_text) {
        json_fail(&at, "is \"%.40s\", expected %s", at.node->valuestring, expected);
    } else {
        json_fail(&at, "is %s, expected %s", kind_of(&at), expected);
    }
    return 0;
}

double json_as_double(const json_at* at, double min, double max)
{
    char low[DECIMAL_SIZE], high[DECIMAL_SIZE], is[DECIMAL_SIZE];
    const bool   number = cJSON_IsNumber(at->node);
    const double value = number ? at->node->valuedouble : min;
    if (number && value >= min && value <= max) {
        return value + 0.0; // -0 becomes 0, as it is written
    }
    decimal_from_double(min, low);
    decimal_from_double(max, high);
    if (!number) {
        json_fail(at, "is %s, expected a number from %s to %s", kind_of(at), low, high);
    } else {
        decimal_from_double(value, is);
        json_fail(at, "is %s, expected %s to %s", is, low, high);
    }
    return min;
}

int64_t json_as_integer(const json_at* at, int64_t min, int64_t max)
{
    const double value = json_as_double(at, (double)min, (double)max);
    if (value != floor(value) || fabs(value) > INTEGER_EXACT_MAX) {
        char is[DECIMAL_SIZE];
        decimal_from_double(value, is);
        json_fail(at, "is %s, expected a whole number", is);
        return min;
    }
    return (int64_t)value;
}

uint64_t json_as_u64(const json_at* at)
{
    if (!cJSON_IsString(at->node)) {
        return (uint64_t)json_as_integer(at, 0, (int64_t)INTEGER_EXACT_MAX);
    }
    const char* text = at->node->valuestring;
    char*       end = NULL;
    errno = 0;
    const unsigned long long value = strtoull(text, &end, 10);
    if (text[0] < '0' || text[0] > '9' || *end != '\0' || errno != 0) {
        json_fail(at, "is \"%.40s\", expected a whole number from 0 to 18446744073709551615", text);
        return 0;
    }
    return value;
}

/// Reads a regular file of at most JSON_FILE_SIZE_MAX bytes. Null: the reason is reported.
static const char* read_file(const char* path, char** text, size_t* size)
{
    const char* reason = NULL;
    FILE*       stream = input_open(path, &reason);
    if (stream == NULL) {
        return reason;
    }
    size_t capacity = 1 << 16, used = 0;
    char*  buffer = malloc(capacity);
    while (buffer != NULL) {
        used += fread(buffer + used, 1, capacity - used, stream);
        if (used < capacity || capacity >= JSON_FILE_SIZE_MAX) {
            break;
        }
        capacity *= 2;
        char* larger = realloc(buffer, capacity);
        if (larger == NULL) {
            free(buffer);
        }
        buffer = larger;
    }
    reason = buffer == NULL     ? "out of memory"
             : ferror(stream)   ? strerror(errno)
             : used == capacity ? "too large"
                                : NULL;
    fclose(stream);
    if (reason != NULL) {
        free(buffer);
        return reason;
    }
    *text = buffer;
    *size = used;
    return NULL;
}

/// The position of the first byte that is zero or not UTF-8; size: there is none.
static size_t text_end(const char* text, size_t size)
{
    size_t i = 0;
    while (i < size) {
        const unsigned char head = (unsigned char)text[i];
        const size_t length = head < 0x80                   ? 1
                              : head >= 0xc2 && head < 0xe0 ? 2
                              : head >= 0xe0 && head < 0xf0 ? 3
                              : head >= 0xf0 && head < 0xf5 ? 4
                                                            : 0;
        if (length == 0 || head == 0 || i + length > size) {
            return i;
        }
        for (size_t k = 1; k < length; ++k) {
            if (((unsigned char)text[i + k] & 0xc0) != 0x80) {
                return i;
            }
        }
        i += length;
    }
    return size;
}

/// Depth is bounded by the parser (1,000 levels).
static void check_values(const json_at* at)
{
    const int keys = cJSON_IsObject(at->node) ? cJSON_GetArraySize(at->node) : 0;
    if (keys > JSON_KEYS_MAX) {
        json_fail(at, "has %d keys, expected at most %d", keys, JSON_KEYS_MAX);
        return;
    }
    if (cJSON_IsNumber(at->node) && !isfinite(at->node->valuedouble)) {
        json_fail(at, "is too large, expected a finite number");
    }
    uint32_t index = 0;
    for (const cJSON* child = at->node->child; child != NULL; child = child->next, ++index) {
        if (child->string == NULL) {
            const json_at element = json_element(at, child, index);
            check_values(&element);
            continue;
        }
        const json_at member = json_member(at, child->string);
        if (member.node != child) { // the look-up finds the first of two
            json_fail(&member, "appears twice, expected once");
            return;
        }
        check_values(&member);
    }
}

static void path_write(const json_at* at, char* text, size_t size)
{
    text[0] = '\0';
    if (at->parent == NULL) {
        snprintf(text, size, "document");
        return;
    }
    if (at->parent->parent != NULL) {
        path_write(at->parent, text, size);
    }
    const size_t used = strlen(text);
    if (at->key != NULL) {
        snprintf(text + used, size - used, "%s%.40s", used > 0 ? "." : "", at->key);
    } else {
        snprintf(text + used, size - used, "[%u]", at->index);
    }
    for (char* c = text + used; *c != '\0'; ++c) {
        if ((unsigned char)*c < ' ') {
            *c = '?';
        }
    }
}

static const char* kind_of(const json_at* at)
{
    const cJSON* node = at->node;
    return node == NULL           ? "missing"
           : cJSON_IsNull(node)   ? "null"
           : cJSON_IsBool(node)   ? "true or false"
           : cJSON_IsNumber(node) ? "a number"
           : cJSON_IsString(node) ? "a string"
           : cJSON_IsArray(node)  ? "an array"
                                  : "an object";
}
