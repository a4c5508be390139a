/// What buses need beyond their URLs, from JSON: an object named like the bus in the daemon's
/// configuration, or in the file a tool is given with --bus-options.
///
///     { "dds": { "interfaces": ["eth1"], "security": { "key": PATH, ... } },
///       "lcm": { "keys": [ { "id": 1, "file": PATH } ], "sign_with": 1 } }
///
/// The keys, their ranges and presets come from the tables of the buses that are built in
/// (transport_setting_at()); none is named here. Everything is optional, but an object within a bus
/// has all of its members. Relative paths start in the folder of the file that names them. Unknown
/// keys are errors.
///
/// Memory      Heap, until bus_options_free().
#ifndef VERGE_APPS_BUS_JSON_H
#define VERGE_APPS_BUS_JSON_H

#include "json.h"
#include "verge/transport.h"

#include <stdio.h>

typedef struct bus_options {
    transport_options  transport;   ///< what to open a bus with
    transport_setting* settings;    ///< those of transport; the values are ours
    uint32_t           files_crc32; ///< tells when a named file was replaced
} bus_options;

/// Appends the names of the buses that have settings to a null-terminated list of keys, which has
/// room for max of them and the null.
void bus_options_keys(const char** keys, uint32_t max);

/// Reads the members of an object, which may have others. False: reported. Whatever it answers,
/// bus_options_free() is due. log and log_context are left null.
bool bus_options_read(bus_options* self, const json_at* of);
/// The same from a file that holds nothing else. False: file->error has a line.
bool bus_options_load(bus_options* self, const char* path, json_file* file);
void bus_options_free(bus_options* self); ///< all zero is fine

/// Do both ask for the same, and are the files they name the same as when they were read?
bool bus_options_same(const bus_options* self, const bus_options* other);

/// The members as JSON, each with a comma and a line break before it; nothing where none is given.
void bus_options_write(FILE* out, const bus_options* self);

#endif
