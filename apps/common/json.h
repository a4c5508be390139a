/// Reading JSON so that whoever wrote a wrong file learns at once where and why.
///
///     json_file file;
///     if (!json_file_load(&file, path)) { fputs(file.error, stderr); return 2; }
///     const json_at root = json_root(&file);
///     const json_at road = json_member(&root, "road");
///     double width = json_double(&road, "width", 1.5, 20.0);
///     if (file.error[0] != '\0') ...
///
/// Errors      Nothing returns a status: the first trouble is written to json_file.error as one
///             line `file:field: what is wrong, what was expected` (the field as a path such as
///             road.lanes[3].width; a syntax error names the line instead) and later troubles
///             are ignored. After it the getters still return a value inside the asked range.
/// Strictness  RFC 8259 to the letter (json_syntax.h: the first fault with its line and words), and
///             besides: numbers too large for a double, a key that appears twice, objects of more
///             than JSON_KEYS_MAX keys, files above JSON_FILE_SIZE_MAX and what is no regular file
///             (a FIFO, a device, a directory) are refused. null is a value of the wrong type
///             wherever it is not said to mean "none".
/// Memory      Heap, until json_file_free(). This is for start-up only.
#ifndef VERGE_APPS_JSON_H
#define VERGE_APPS_JSON_H

#include <cjson/cJSON.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

enum { JSON_FILE_SIZE_MAX = 64 << 20 }; ///< [B]
enum { JSON_ERROR_SIZE = 512 };         ///< [B]
/// Keys of one object. No object of ours has half as many, and looking all of them up takes
/// time that grows with the square of their number.
enum { JSON_KEYS_MAX = 128 };

typedef struct json_file {
    char*  name;      ///< as it appears in error lines
    cJSON* document;
    bool   missing;   ///< the file could not be opened or read (the daemon's exit code differs)
    char   error[JSON_ERROR_SIZE]; ///< one line with its newline; empty: no trouble so far
} json_file;

/// False: see file->error; nothing is left to free.
bool json_file_load(json_file* file, const char* path);
/// The same from text in memory; `name` stands for the file in error lines.
bool json_file_parse(json_file* file, const char* name, const char* text, size_t size);
/// The error line stays.
void json_file_free(json_file* file);

/// A place in a document: the value and how one got there. Lives on the caller's stack and
/// refers to the place it was taken from.
typedef struct json_at {
    json_file* file;
    const struct json_at* parent; ///< null at the root
    const cJSON* node;            ///< null: the field is absent
    const char*  key;             ///< null for an element of an array
    uint32_t     index;           ///< of the element
} json_at;

json_at json_root(json_file* file);
/// node may come out null; a parent that is absent or no object has no members.
json_at json_member(const json_at* of, const char* key);
/// For walking an array: node is of's child, index its position.
json_at json_element(const json_at* of, const cJSON* node, uint32_t index);
/// Present, whatever it is.
bool json_given(const json_at* at);
/// Absent or null: for the places where null means "none".
bool json_none(const json_at* at);

/// Reports trouble at this place: "what is wrong, what was expected". Returns false.
bool json_fail(const json_at* at, const char* format, ...) __attribute__((format(printf, 2, 3)));

/// Is it an object with no other keys than these (null-terminated list)? Else reports the key.
bool json_expect_object(const json_at* at, const char* const* keys);
/// Is it an array of min .. max elements? The number of elements; min where it is none.
uint32_t json_expect_array(const json_at* at, uint32_t min, uint32_t max);

// Values of members. The range is inclusive. The first form reports an absent field, the form
// with _or returns `otherwise` for it.
double      json_double(const json_at* of, const char* key, double min, double max);
double      json_double_or(const json_at* of, const char* key, double min, double max,
                           double otherwise);
int64_t     json_integer(const json_at* of, const char* key, int64_t min, int64_t max);
int64_t     json_integer_or(const json_at* of, const char* key, int64_t min, int64_t max,
                            int64_t otherwise);
bool        json_bool_or(const json_at* of, const char* key, bool otherwise);
/// Valid as long as the file. "" where reported.
const char* json_string(const json_at* of, const char* key);
const char* json_string_or(const json_at* of, const char* key, const char* otherwise);
/// One of the null-terminated names: its index. 0 where reported.
uint32_t    json_choice(const json_at* of, const char* key, const char* const* names);

/// A string member that names a file, from any folder: a relative path starts in the folder of
/// the file it is written in. To be freed; null: out of memory. at must be a string.
char*   json_path(const json_at* at);
/// The same for a file that may not exist yet: only joined, symbolic links are not followed.
char*   json_join(const json_at* at);

// Values of the place itself.
double  json_as_double(const json_at* at, double min, double max);
int64_t json_as_integer(const json_at* at, int64_t min, int64_t max);
/// Any 64-bit number. JSON readers keep 53 bits, so larger ones are written as a string of digits.
uint64_t json_as_u64(const json_at* at);

#endif
