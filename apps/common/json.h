/// Reading JSON, with an error line that names the place and the fault.
///
///     json_file file;
///     if (!json_file_load(&file, path)) { fputs(file.error, stderr); return 2; }
///     const json_at root = json_root(&file);
///     const json_at road = json_member(&root, "road");
///     double width = json_double(&road, "width", 1.5, 20.0);
///     if (file.error[0] != '\0') ...
///
/// Errors      The first fault is written to json_file.error as one line
///             `file:field: what is wrong, what was expected`. The field is a path such as
///             road.lanes[3].width; a syntax error has the number of its line instead. Later faults
///             are ignored. After a fault the getters still return a value inside the given range.
/// Strictness  RFC 8259 exactly (json_syntax.h). Also refused are numbers too large for a double,
///             keys that appear twice, objects of more than JSON_KEYS_MAX keys, files above
///             JSON_FILE_SIZE_MAX, and files that are not regular (FIFO, device, directory). null
///             is a value of the wrong type, except where it is documented to mean "none".
/// Memory      Heap, until json_file_free(). For start-up and reloads only.
#ifndef VERGE_APPS_JSON_H
#define VERGE_APPS_JSON_H

#include <cjson/cJSON.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

enum { JSON_FILE_SIZE_MAX = 64 << 20 }; ///< [B]
enum { JSON_ERROR_SIZE = 512 };         ///< [B]
/// Keys of one object. No object of verge's formats has half as many. The limit bounds the time to
/// look up all of them, which grows with the square of their number.
enum { JSON_KEYS_MAX = 128 };

typedef struct json_file {
    char*  name;      ///< as it appears in error lines
    cJSON* document;
    bool   missing;   ///< the file could not be opened or read (the daemon's exit code differs)
    char   error[JSON_ERROR_SIZE]; ///< one line with its newline; empty: no fault so far
} json_file;

/// False: the reason is in file->error, and there is nothing to free.
bool json_file_load(json_file* file, const char* path);
/// The same from text in memory; `name` stands for the file in error lines.
bool json_file_parse(json_file* file, const char* name, const char* text, size_t size);
/// Keeps the error line.
void json_file_free(json_file* file);

/// A place in a document: a value and its path. It refers to the place of its parent, which has to
/// live as long.
typedef struct json_at {
    json_file* file;
    const struct json_at* parent; ///< null at the root
    const cJSON* node;            ///< null: the field is absent
    const char*  key;             ///< null for an element of an array
    uint32_t     index;           ///< of the element
} json_at;

json_at json_root(json_file* file);
/// The node is null if `of` is absent, is not an object, or has no such member.
json_at json_member(const json_at* of, const char* key);
/// An element of an array: node is a child of `of`, index its position.
json_at json_element(const json_at* of, const cJSON* node, uint32_t index);
/// Present, with a value of any type.
bool json_given(const json_at* at);
/// Absent or null: for fields where null means "none".
bool json_none(const json_at* at);

/// Reports a fault at this place: "what is wrong, what was expected". Returns false.
bool json_fail(const json_at* at, const char* format, ...) __attribute__((format(printf, 2, 3)));

/// True: an object with no other keys than these (null-terminated list). Otherwise reports the key.
bool json_expect_object(const json_at* at, const char* const* keys);
/// The number of elements of an array of min .. max elements. Otherwise reports and returns min.
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
/// Valid as long as the file. "" after a fault.
const char* json_string(const json_at* of, const char* key);
const char* json_string_or(const json_at* of, const char* key, const char* otherwise);
/// The index of the value in a null-terminated list of names. 0 after a fault.
uint32_t    json_choice(const json_at* of, const char* key, const char* const* names);

/// The path of a file from a string value, valid in any working folder: a relative path starts in
/// the folder of the JSON file. To be freed; null: out of memory. at must be a string.
char*   json_path(const json_at* at);
/// The same for a file that may not exist yet: symbolic links are not followed.
char*   json_join(const json_at* at);

// Values of the place itself.
double  json_as_double(const json_at* at, double min, double max);
int64_t json_as_integer(const json_at* at, int64_t min, int64_t max);
/// A 64-bit number. JSON readers keep 53 bits, so a larger number is written as a string of digits.
uint64_t json_as_u64(const json_at* at);

#endif
