#include "bus_json.h"

#include "number.h"

#include <stdlib.h>
#include <string.h>

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
static bool read_lcm(const json_at* lcm);
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
    return (!json_given(&dds) || read_dds(self, &dds)) && (!json_given(&lcm) || read_lcm(&lcm));
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
    memset(self, 0, sizeof *self);
}

static bool read_dds(bus_options* self, const json_at* dds)
{
    static const char* const KEYS[] = { "interfaces", "peers", "security", NULL };
    if (!json_expect_object(dds, KEYS)) {
        return false;
    }
    const json_at interfaces = json_member(dds, "interfaces");
    const json_at peers = json_member(dds, "peers");
    const json_at security = json_member(dds, "security");
    return read_names(&interfaces, self->interfaces, BUS_INTERFACES_MAX,
                      &self->transport.dds_interface_count) &&
           read_names(&peers, self->peers, BUS_PEERS_MAX, &self->transport.dds_peer_count) &&
           read_security(self, &security);
}

static bool read_lcm(const json_at* lcm)
{
    static const char* const KEYS[] = { NULL };
    return json_expect_object(lcm, KEYS);
}

/// An array of names of interfaces or hosts; absent: none.
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
                                       "interface or host");
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

bool bus_options_same(const bus_options* self, const bus_options* other)
{
    const transport_options* mine = &self->transport;
    const transport_options* theirs = &other->transport;
    bool same = same_names(self->interfaces, mine->dds_interface_count, other->interfaces,
                           theirs->dds_interface_count) &&
                same_names(self->peers, mine->dds_peer_count, other->peers,
                           theirs->dds_peer_count) &&
                (mine->dds_security == NULL) == (theirs->dds_security == NULL);
    for (uint32_t i = 0; same && mine->dds_security != NULL && i < SECURITY_COUNT; i++) {
        same = strcmp(security_path_of(self, i), security_path_of(other, i)) == 0;
    }
    return same;
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

void bus_options_write(FILE* out, const bus_options* self)
{
    const transport_options* given = &self->transport;
    if (given->dds_interface_count == 0 && given->dds_peer_count == 0 &&
        given->dds_security == NULL) {
        return;
    }
    fputs(",\n  \"dds\": { ", out);
    write_names(out, "interfaces", self->interfaces, given->dds_interface_count);
    fputs(", ", out);
    write_names(out, "peers", self->peers, given->dds_peer_count);
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
