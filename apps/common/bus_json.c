#include "bus_json.h"

#include "number.h"

#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>

/// The paths of transport_dds_security by name.
typedef struct path_entry {
    const char* key;
    size_t      offset;
} path_entry;

static const path_entry SECURITY[] = {
    { "identity_ca", offsetof(transport_dds_security, identity_ca) },
    { "certificate", offsetof(transport_dds_security, certificate) },
    { "key", offsetof(transport_dds_security, key) },
    { "permissions_ca", offsetof(transport_dds_security, permissions_ca) },
    { "governance", offsetof(transport_dds_security, governance) },
    { "permissions", offsetof(transport_dds_security, permissions) },
};
enum { SECURITY_COUNT = sizeof SECURITY / sizeof SECURITY[0] };

static bool read_dds(bus_options* self, const json_at* dds);
static bool read_lcm(bus_options* self, const json_at* lcm);
static bool read_keys(bus_options* self, const json_at* at);
static void sum_up_files(bus_options* self);
static bool read_names(const json_at* at, const char** names, uint32_t max, uint32_t* count);
static bool read_security(bus_options* self, const json_at* at);

static const char** security_path(transport_dds_security* security, uint32_t i)
{
    return (const char**)(void*)((char*)security + SECURITY[i].offset);
}

static const char* security_path_of(const bus_options* self, uint32_t i)
{
    return *(const char* const*)(const void*)((const char*)&self->security + SECURITY[i].offset);
}

bool bus_options_read(bus_options* self, const json_at* of)
{
    memset(self, 0, sizeof *self);
    self->transport.dds_interfaces = self->interfaces;
    self->transport.dds_peers = self->peers;
    const json_at dds = json_member(of, "dds");
    const json_at lcm = json_member(of, "lcm");
    if ((json_given(&dds) && !read_dds(self, &dds)) ||
        (json_given(&lcm) && !read_lcm(self, &lcm))) {
        return false;
    }
    sum_up_files(self);
    return true;
}

bool bus_options_load(bus_options* self, const char* path, json_file* file)
{
    static const char* const KEYS[] = { "dds", "lcm", NULL };
    memset(self, 0, sizeof *self);
    if (!json_file_load(file, path)) {
        return false;
    }
    const json_at root = json_root(file);
    const bool good = json_expect_object(&root, KEYS) && bus_options_read(self, &root);
    json_file_free(file);
    return good;
}

void bus_options_free(bus_options* self)
{
    for (uint32_t i = 0; i < self->transport.dds_interface_count; i++) {
        free((void*)(uintptr_t)self->interfaces[i]);
    }
    for (uint32_t i = 0; i < self->transport.dds_peer_count; i++) {
        free((void*)(uintptr_t)self->peers[i]);
    }
    for (uint32_t i = 0; i < SECURITY_COUNT; i++) {
        free((void*)(uintptr_t)security_path_of(self, i));
    }
    for (uint32_t i = 0; i < self->lcm.allow_count; i++) {
        free((void*)(uintptr_t)self->networks[i]);
    }
    for (uint32_t i = 0; i < self->lcm.key_count; i++) {
        free((void*)(uintptr_t)self->lcm_keys[i].file);
    }
    memset(self, 0, sizeof *self);
}

static bool read_dds(bus_options* self, const json_at* dds)
{
    static const char* const KEYS[] = { "interfaces", "peers", "deadline_ms", "security", NULL };
    if (!json_expect_object(dds, KEYS)) {
        return false;
    }
    self->transport.dds_deadline_ms =
        (uint32_t)json_integer_or(dds, "deadline_ms", 0, BUS_DEADLINE_MS_MAX, 0);
    const json_at interfaces = json_member(dds, "interfaces");
    const json_at peers = json_member(dds, "peers");
    const json_at security = json_member(dds, "security");
    return read_names(&interfaces, self->interfaces, BUS_INTERFACES_MAX,
                      &self->transport.dds_interface_count) &&
           read_names(&peers, self->peers, BUS_PEERS_MAX, &self->transport.dds_peer_count) &&
           read_security(self, &security) && dds->file->error[0] == '\0';
}

/// What the addresses and the key files are worth is the transport's to judge.
static bool read_lcm(bus_options* self, const json_at* lcm)
{
    static const char* const KEYS[] = { "allow", "keys", "sign_with", "window_ms", NULL };
    if (!json_expect_object(lcm, KEYS)) {
        return false;
    }
    transport_lcm_auth* auth = &self->lcm;
    auth->allow = self->networks;
    auth->keys = self->lcm_keys;
    auth->sign_with = (uint32_t)json_integer_or(lcm, "sign_with", 1, INT32_MAX, 0);
    auth->window_ms = (uint32_t)json_integer_or(
        lcm, "window_ms", TRANSPORT_LCM_WINDOW_MS_MIN, TRANSPORT_LCM_WINDOW_MS_MAX,
        TRANSPORT_LCM_WINDOW_MS_DEFAULT);
    const json_at allow = json_member(lcm, "allow");
    const json_at keys = json_member(lcm, "keys");
    self->transport.lcm_auth = auth;
    return read_names(&allow, self->networks, TRANSPORT_LCM_NETWORKS_MAX, &auth->allow_count) &&
           read_keys(self, &keys) && lcm->file->error[0] == '\0';
}

static bool read_keys(bus_options* self, const json_at* at)
{
    static const char* const KEYS[] = { "id", "file", NULL };
    if (!json_given(at)) {
        return true;
    }
    const uint32_t given = json_expect_array(at, 0, TRANSPORT_LCM_KEYS_MAX);
    const cJSON* node = at->file->error[0] == '\0' ? at->node->child : NULL;
    for (uint32_t i = 0; i < given && node != NULL; i++, node = node->next) {
        const json_at key = json_element(at, node, i);
        const json_at file = json_member(&key, "file");
        if (!json_expect_object(&key, KEYS)) {
            return false;
        }
        if (json_string(&key, "file")[0] == '\0') {
            return json_fail(&file, "is not a path, expected the name of a file");
        }
        self->lcm_keys[i].id = (uint32_t)json_integer(&key, "id", 1, INT32_MAX);
        self->lcm_keys[i].file = json_path(&file);
        if (self->lcm_keys[i].file == NULL) {
            return json_fail(&file, "out of memory");
        }
        self->lcm.key_count = i + 1;
    }
    return at->file->error[0] == '\0';
}

/// An array of names of interfaces, hosts or networks; absent: none.
static bool read_names(const json_at* at, const char** names, uint32_t max, uint32_t* count)
{
    if (!json_given(at)) {
        return true;
    }
    const uint32_t given = json_expect_array(at, 0, max);
    if (at->file->error[0] != '\0') {
        return false;
    }
    const cJSON* node = at->node->child;
    for (uint32_t i = 0; i < given; i++, node = node->next) {
        const json_at element = json_element(at, node, i);
        if (!cJSON_IsString(node) || node->valuestring[0] == '\0') {
            return json_fail(&element, "is not a name, expected the name or address of an "
                                       "interface, host or network");
        }
        names[i] = strdup(node->valuestring);
        if (names[i] == NULL) {
            return json_fail(&element, "out of memory");
        }
        *count = i + 1;
    }
    return true;
}

static bool read_security(bus_options* self, const json_at* at)
{
    const char* keys[SECURITY_COUNT + 1] = { NULL };
    for (uint32_t i = 0; i < SECURITY_COUNT; i++) {
        keys[i] = SECURITY[i].key;
    }
    if (!json_given(at)) {
        return true;
    }
    if (!json_expect_object(at, keys)) {
        return false;
    }
    for (uint32_t i = 0; i < SECURITY_COUNT; i++) {
        const json_at path = json_member(at, keys[i]);
        if (json_string(at, keys[i])[0] == '\0') {
            return json_fail(&path, "is not a path, expected the name of a file");
        }
        *security_path(&self->security, i) = json_path(&path);
        if (security_path_of(self, i) == NULL) {
            return json_fail(&path, "out of memory");
        }
    }
    self->transport.dds_security = &self->security;
    return true;
}

// ---- the files that are named -------------------------------------------------------------

static uint32_t sum_up_file(uint32_t sum, const char* path)
{
    struct stat facts;
    memset(&facts, 0, sizeof facts);
    if (path == NULL || stat(path, &facts) != 0) {
        return sum; // whoever opens it says so
    }
    const int64_t signs[] = { sum, (int64_t)facts.st_ino, (int64_t)facts.st_size,
                              (int64_t)facts.st_mtim.tv_sec, (int64_t)facts.st_mtim.tv_nsec };
    return transport_crc32(signs, sizeof signs);
}

/// A renewed certificate or key comes under the old name; a reload has to notice.
static void sum_up_files(bus_options* self)
{
    for (uint32_t i = 0; i < SECURITY_COUNT; i++) {
        self->files_crc32 = sum_up_file(self->files_crc32, security_path_of(self, i));
    }
    for (uint32_t i = 0; i < self->lcm.key_count; i++) {
        self->files_crc32 = sum_up_file(self->files_crc32, self->lcm_keys[i].file);
    }
}

// ---- comparing and writing ----------------------------------------------------------------

static bool same_names(const char* const* one, uint32_t count, const char* const* other,
                       uint32_t other_count)
{
    bool same = count == other_count;
    for (uint32_t i = 0; same && i < count; i++) {
        same = strcmp(one[i], other[i]) == 0;
    }
    return same;
}

static bool same_lcm(const bus_options* self, const bus_options* other)
{
    const transport_lcm_auth* mine = &self->lcm;
    const transport_lcm_auth* theirs = &other->lcm;
    bool same = (self->transport.lcm_auth == NULL) == (other->transport.lcm_auth == NULL) &&
                same_names(self->networks, mine->allow_count, other->networks,
                           theirs->allow_count) &&
                mine->key_count == theirs->key_count && mine->sign_with == theirs->sign_with &&
                mine->window_ms == theirs->window_ms;
    for (uint32_t i = 0; same && i < mine->key_count; i++) {
        same = mine->keys[i].id == theirs->keys[i].id &&
               strcmp(mine->keys[i].file, theirs->keys[i].file) == 0;
    }
    return same;
}

bool bus_options_same(const bus_options* self, const bus_options* other)
{
    const transport_options* mine = &self->transport;
    const transport_options* theirs = &other->transport;
    bool same = same_names(self->interfaces, mine->dds_interface_count, other->interfaces,
                           theirs->dds_interface_count) &&
                same_names(self->peers, mine->dds_peer_count, other->peers,
                           theirs->dds_peer_count) &&
                mine->dds_deadline_ms == theirs->dds_deadline_ms &&
                (mine->dds_security == NULL) == (theirs->dds_security == NULL);
    for (uint32_t i = 0; same && mine->dds_security != NULL && i < SECURITY_COUNT; i++) {
        same = strcmp(security_path_of(self, i), security_path_of(other, i)) == 0;
    }
    return same && same_lcm(self, other) && self->files_crc32 == other->files_crc32;
}

static void write_names(FILE* out, const char* key, const char* const* names, uint32_t count)
{
    fprintf(out, "\"%s\": [", key);
    for (uint32_t i = 0; i < count; i++) {
        fputs(i == 0 ? "" : ", ", out);
        string_write(out, names[i]);
    }
    fputs("]", out);
}

static void write_dds(FILE* out, const bus_options* self);
static void write_lcm(FILE* out, const bus_options* self);

void bus_options_write(FILE* out, const bus_options* self)
{
    write_dds(out, self);
    if (self->transport.lcm_auth != NULL) {
        write_lcm(out, self);
    }
}

static void write_lcm(FILE* out, const bus_options* self)
{
    fputs(",\n  \"lcm\": { ", out);
    write_names(out, "allow", self->networks, self->lcm.allow_count);
    fputs(", \"keys\": [", out);
    for (uint32_t i = 0; i < self->lcm.key_count; i++) {
        fprintf(out, "%s{ \"id\": %u, \"file\": ", i == 0 ? "" : ", ", self->lcm_keys[i].id);
        string_write(out, self->lcm_keys[i].file);
        fputs(" }", out);
    }
    fprintf(out, "], \"window_ms\": %u", self->lcm.window_ms);
    if (self->lcm.sign_with != 0) {
        fprintf(out, ", \"sign_with\": %u", self->lcm.sign_with);
    }
    fputs(" }", out);
}

static void write_dds(FILE* out, const bus_options* self)
{
    const transport_options* given = &self->transport;
    if (given->dds_interface_count == 0 && given->dds_peer_count == 0 &&
        given->dds_deadline_ms == 0 && given->dds_security == NULL) {
        return;
    }
    fputs(",\n  \"dds\": { ", out);
    write_names(out, "interfaces", self->interfaces, given->dds_interface_count);
    fputs(", ", out);
    write_names(out, "peers", self->peers, given->dds_peer_count);
    fprintf(out, ", \"deadline_ms\": %u", given->dds_deadline_ms);
    if (given->dds_security != NULL) {
        fputs(",\n    \"security\": ", out);
        for (uint32_t i = 0; i < SECURITY_COUNT; i++) {
            fprintf(out, "%s\"%s\": ", i == 0 ? "{ " : ", ", SECURITY[i].key);
            string_write(out, security_path_of(self, i));
        }
        fputs(" }", out);
    }
    fputs(" }", out);
}
