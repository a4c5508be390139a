/// The options of buses, from JSON: an object named like the bus, in the daemon's configuration or
/// in the file that a tool takes with --bus-options.
///
///     { "dds": { "interfaces": ["eth1"], "security": { "key": PATH, ... } },
///       "lcm": { "keys": [ { "id": 1, "file": PATH } ], "sign_with": 1 } }
///
/// The keys, their ranges and defaults come from the tables of the buses that are built in
/// (transport_setting_at()); none is named here. Every option may be absent, but an object within a
/// bus must have all of its members. A relative path starts in the folder of the file that contains
/// it. Unknown keys are errors.
///
/// Memory      Heap, until bus_options_free().
#ifndef VERGE_APPS_BUS_JSON_H
#define VERGE_APPS_BUS_JSON_H

#include "json.h"
#include "verge/transport.h"

#include <stdio.h>

typedef struct bus_options {
    transport_options  transport;   ///< for transport_open_with()
    transport_setting* settings;    ///< those of `transport`, with values owned by this structure
    uint32_t           files_crc32; ///< changes when a named file is replaced
} bus_options;

/// Appends the names of the buses that have settings to a null-terminated list of keys, which has
/// room for max of them and the null.
void bus_options_keys(const char** keys, uint32_t max);

/// Reads the members of an object, which may have others. False: the reason is in the error line of
/// its file. bus_options_free() is due in both cases. log and log_context are left null.
bool bus_options_read(bus_options* self, const json_at* of);
/// The same from a file with bus options only. False: the reason is in file->error.
bool bus_options_load(bus_options* self, const char* path, json_file* file);
void bus_options_free(bus_options* self); ///< may be all zero

/// True: both have the same options, and the named files have not been replaced between the two
/// readings.
bool bus_options_same(const bus_options* self, const bus_options* other);

/// The members as JSON, each with a comma and a line break before it; nothing if there are none.
void bus_options_write(FILE* out, const bus_options* self);

#endif
