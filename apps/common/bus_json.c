#include "bus_json.h"

#include "number.h"

#include <assert.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>

enum { NAME_SIZE = 64, KEYS_MAX = 32 };

/// A row of the tables, its name taken apart: "BUS.KEY" or "BUS.KEY.MEMBER".
typedef struct setting_row {
    const transport_setting_def* def; ///< null behind the last one
    char                         bus[NAME_SIZE];
    char                         key[NAME_SIZE];
    const char*                  member; ///< empty: none
} setting_row;

static setting_row row_at(uint32_t index);
static bool read_bus(bus_options* self, const json_at* of, uint32_t first);
static bool read_key(bus_options* self, const json_at* bus, uint32_t index);
static bool read_list(bus_options* self, const json_at* at, uint32_t index);
static bool read_one(bus_options* self, const json_at* at, uint32_t index);
static bool read_value(bus_options* self, const json_at* at, const transport_setting_def* def);
static bool add(bus_options* self, const json_at* at, const char* name, char* value);
static void sum_up_files(bus_options* self);
static void write_bus(FILE* out, const bus_options* self, uint32_t first);
static void write_key(FILE* out, const bus_options* self, uint32_t index);

static setting_row row_at(uint32_t index)
{
    setting_row row = { .def = transport_setting_at(index), .member = "" };
    if (row.def != NULL) {
        const char* key = strchr(row.def->name, '.') + 1;
        const char* end = key + strcspn(key, ".");
        snprintf(row.bus, sizeof row.bus, "%.*s", (int)(key - 1 - row.def->name), row.def->name);
        snprintf(row.key, sizeof row.key, "%.*s", (int)(end - key), key);
        row.member = *end == '.' ? end + 1 : end;
    }
    return row;
}

static bool is_of_bus(uint32_t index, const char* bus)
{
    const setting_row row = row_at(index);
    return row.def != NULL && strcmp(row.bus, bus) == 0;
}

static bool is_member_of(uint32_t index, const setting_row* group)
{
    const setting_row row = row_at(index);
    return row.def != NULL && strcmp(row.bus, group->bus) == 0 &&
           strcmp(row.key, group->key) == 0 && row.member[0] != '\0';
}

/// Names for json_expect_object().
typedef struct key_list {
    char        names[KEYS_MAX][NAME_SIZE];
    const char* keys[KEYS_MAX + 1]; ///< ends with null
    uint32_t    count;
} key_list;

/// Rows of one name are consecutive, so only the last name has to be compared.
static void key_list_add(key_list* self, const char* name)
{
    if (self->count == 0 || strcmp(self->keys[self->count - 1], name) != 0) {
        assert(self->count < KEYS_MAX);
        snprintf(self->names[self->count], NAME_SIZE, "%s", name);
        self->keys[self->count] = self->names[self->count];
        self->keys[++self->count] = NULL;
    }
}

void bus_options_keys(const char** keys, uint32_t max)
{
    static key_list names;
    names.count = 0;
    for (uint32_t i = 0; row_at(i).def != NULL; ++i) {
        key_list_add(&names, row_at(i).bus);
    }
    uint32_t used = 0;
    while (keys[used] != NULL) {
        ++used;
    }
    assert(used + names.count <= max);
    for (uint32_t i = 0; i < names.count && used < max; ++i) {
        keys[used++] = names.names[i];
    }
    keys[used] = NULL;
}

// ---- reading ------------------------------------------------------------------------------

bool bus_options_read(bus_options* self, const json_at* of)
{
    memset(self, 0, sizeof *self);
    for (uint32_t i = 0; row_at(i).def != NULL; ++i) {
        const bool first = i == 0 || strcmp(row_at(i - 1).bus, row_at(i).bus) != 0;
        if (first && !read_bus(self, of, i)) {
            return false;
        }
    }
    sum_up_files(self);
    return true;
}

bool bus_options_load(bus_options* self, const char* path, json_file* file)
{
    const char* keys[KEYS_MAX + 1] = { NULL };
    bus_options_keys(keys, KEYS_MAX);
    memset(self, 0, sizeof *self);
    if (!json_file_load(file, path)) {
        return false;
    }
    const json_at root = json_root(file);
    const bool good = json_expect_object(&root, keys) && bus_options_read(self, &root);
    json_file_free(file);
    return good;
}

void bus_options_free(bus_options* self)
{
    for (uint32_t i = 0; i < self->transport.setting_count; ++i) {
        free((void*)(uintptr_t)self->settings[i].value);
    }
    free(self->settings);
    memset(self, 0, sizeof *self);
}

static bool read_bus(bus_options* self, const json_at* of, uint32_t first)
{
    const setting_row row = row_at(first);
    const json_at     bus = json_member(of, row.bus);
    key_list          list = { .count = 0 };
    if (!json_given(&bus)) {
        return true;
    }
    for (uint32_t i = first; is_of_bus(i, row.bus); ++i) {
        key_list_add(&list, row_at(i).key);
    }
    if (!json_expect_object(&bus, list.keys)) {
        return false;
    }
    for (uint32_t i = first; is_of_bus(i, row.bus); ++i) {
        if (row_at(i).member[0] == '\0' && !read_key(self, &bus, i)) {
            return false;
        }
    }
    return true;
}

static bool read_key(bus_options* self, const json_at* bus, uint32_t index)
{
    const setting_row row = row_at(index);
    const json_at     at = json_member(bus, row.key);
    if (json_given(&at)) {
        return row.def->list_max > 0 ? read_list(self, &at, index) : read_one(self, &at, index);
    }
    return row.def->preset == NULL || add(self, &at, row.def->name, strdup(row.def->preset));
}

static bool read_list(bus_options* self, const json_at* at, uint32_t index)
{
    const uint32_t count = json_expect_array(at, 0, row_at(index).def->list_max);
    const cJSON*   node = at->file->error[0] == '\0' ? at->node->child : NULL;
    for (uint32_t i = 0; i < count && node != NULL; ++i, node = node->next) {
        const json_at element = json_element(at, node, i);
        if (!read_one(self, &element, index)) {
            return false;
        }
    }
    return at->file->error[0] == '\0';
}

/// A value, or an object with all of its members.
static bool read_one(bus_options* self, const json_at* at, uint32_t index)
{
    const setting_row row = row_at(index);
    key_list          list = { .count = 0 };
    if (row.def->kind != TRANSPORT_SETTING_GROUP) {
        return read_value(self, at, row.def);
    }
    for (uint32_t i = index + 1; is_member_of(i, &row); ++i) {
        key_list_add(&list, row_at(i).member);
    }
    if (!json_expect_object(at, list.keys)) {
        return false;
    }
    for (uint32_t i = index + 1; is_member_of(i, &row); ++i) {
        const setting_row member = row_at(i);
        const json_at     value = json_member(at, member.member);
        if (!read_value(self, &value, member.def)) {
            return false;
        }
    }
    return true;
}

/// Only the type is checked here. The bus checks the address, the name or the file.
static bool read_value(bus_options* self, const json_at* at, const transport_setting_def* def)
{
    if (def->kind == TRANSPORT_SETTING_NUMBER) {
        char digits[24];
        snprintf(digits, sizeof digits, "%lld",
                 (long long)json_as_integer(at, def->min, def->max));
        return at->file->error[0] == '\0' && add(self, at, def->name, strdup(digits));
    }
    const bool is_file = def->kind == TRANSPORT_SETTING_FILE;
    if (!cJSON_IsString(at->node) || at->node->valuestring[0] == '\0') {
        return json_fail(at, is_file ? "is not a path, expected the path of a file"
                                     : "is not a name, expected the name or address of an "
                                       "interface, host or network");
    }
    return add(self, at, def->name, is_file ? json_path(at) : strdup(at->node->valuestring));
}

/// Takes over the value. A null value means that memory has run out.
static bool add(bus_options* self, const json_at* at, const char* name, char* value)
{
    const uint32_t     count = self->transport.setting_count;
    transport_setting* more =
        value != NULL ? realloc(self->settings, (count + 1) * sizeof *more) : NULL;
    if (more == NULL) {
        free(value);
        return json_fail(at, "out of memory");
    }
    more[count] = (transport_setting){ .name = name, .value = value };
    self->settings = more;
    self->transport.settings = more;
    self->transport.setting_count = count + 1;
    return true;
}

// ---- the files that are named -------------------------------------------------------------

static const transport_setting_def* def_of(const char* name)
{
    uint32_t i = 0;
    while (strcmp(transport_setting_at(i)->name, name) != 0) {
        ++i;
    }
    return transport_setting_at(i);
}

static uint32_t sum_up_file(uint32_t sum, const char* path)
{
    struct stat facts;
    memset(&facts, 0, sizeof facts);
    if (stat(path, &facts) != 0) {
        return sum; // opening the file will report it
    }
    const int64_t signs[] = { sum, (int64_t)facts.st_ino, (int64_t)facts.st_size,
                              (int64_t)facts.st_mtim.tv_sec, (int64_t)facts.st_mtim.tv_nsec };
    return transport_crc32(signs, sizeof signs);
}

/// A renewed certificate or key has the old path; a reload has to detect it.
static void sum_up_files(bus_options* self)
{
    for (uint32_t i = 0; i < self->transport.setting_count; ++i) {
        const transport_setting* setting = &self->settings[i];
        if (def_of(setting->name)->kind == TRANSPORT_SETTING_FILE) {
            self->files_crc32 = sum_up_file(self->files_crc32, setting->value);
        }
    }
}

// ---- comparing and writing ----------------------------------------------------------------

bool bus_options_same(const bus_options* self, const bus_options* other)
{
    const uint32_t count = self->transport.setting_count;
    bool same = count == other->transport.setting_count &&
                self->files_crc32 == other->files_crc32;
    for (uint32_t i = 0; same && i < count; ++i) { // both are in the order of the tables
        same = strcmp(self->settings[i].name, other->settings[i].name) == 0 &&
               strcmp(self->settings[i].value, other->settings[i].value) == 0;
    }
    return same;
}

/// The value given at this place among those of its name. Null: there is none.
static const char* value_of(const bus_options* self, const transport_setting_def* def,
                            uint32_t place)
{
    for (uint32_t i = 0; i < self->transport.setting_count; ++i) {
        if (strcmp(self->settings[i].name, def->name) == 0 && place-- == 0) {
            return self->settings[i].value;
        }
    }
    return NULL;
}

void bus_options_write(FILE* out, const bus_options* self)
{
    for (uint32_t i = 0; row_at(i).def != NULL; ++i) {
        if (i == 0 || strcmp(row_at(i - 1).bus, row_at(i).bus) != 0) {
            write_bus(out, self, i);
        }
    }
}

/// True: the key is given. An object is given if its first member is, because it has all members.
static bool is_given(const bus_options* self, uint32_t index)
{
    const transport_setting_def* def = row_at(index).def;
    return value_of(self, def->kind == TRANSPORT_SETTING_GROUP ? row_at(index + 1).def : def, 0) !=
           NULL;
}

static void write_bus(FILE* out, const bus_options* self, uint32_t first)
{
    const setting_row bus = row_at(first);
    const char*       before = "{ ";
    for (uint32_t i = first; is_of_bus(i, bus.bus); ++i) {
        const setting_row row = row_at(i);
        if (row.member[0] != '\0' || !is_given(self, i)) {
            continue;
        }
        if (before[0] == '{') {
            fprintf(out, ",\n  \"%s\": ", bus.bus);
        }
        fprintf(out, "%s\"%s\": ", before, row.key);
        write_key(out, self, i);
        before = ", ";
    }
    fputs(before[0] == ',' ? " }" : "", out);
}

static void write_value(FILE* out, const transport_setting_def* def, const char* value)
{
    if (def->kind == TRANSPORT_SETTING_NUMBER) {
        fputs(value, out);
    } else {
        string_write(out, value);
    }
}

/// The value or object at this place of a list.
static void write_one(FILE* out, const bus_options* self, uint32_t index, uint32_t place)
{
    const setting_row row = row_at(index);
    if (row.def->kind != TRANSPORT_SETTING_GROUP) {
        write_value(out, row.def, value_of(self, row.def, place));
        return;
    }
    for (uint32_t i = index + 1; is_member_of(i, &row); ++i) {
        const setting_row member = row_at(i);
        fprintf(out, "%s\"%s\": ", i == index + 1 ? "{ " : ", ", member.member);
        write_value(out, member.def, value_of(self, member.def, place));
    }
    fputs(" }", out);
}

static void write_key(FILE* out, const bus_options* self, uint32_t index)
{
    const transport_setting_def* def = row_at(index).def;
    if (def->list_max == 0) {
        write_one(out, self, index, 0);
        return;
    }
    const transport_setting_def* counted =
        def->kind == TRANSPORT_SETTING_GROUP ? row_at(index + 1).def : def;
    fputs("[", out);
    for (uint32_t i = 0; value_of(self, counted, i) != NULL; ++i) {
        fputs(i > 0 ? ", " : "", out);
        write_one(out, self, index, i);
    }
    fputs("]", out);
}
