/// What buses need beyond their URLs, from JSON: the objects "dds" and "lcm" of the daemon's
/// configuration, or of the file a tool is given with --bus-options.
///
///     { "dds": { "interfaces": ["eth1"], "peers": ["10.1.0.7"], "deadline_ms": 0,
///                "security": { "identity_ca": PATH, "certificate": PATH, "key": PATH,
///                              "permissions_ca": PATH, "governance": PATH, "permissions": PATH } },
///       "lcm": { "allow": ["10.1.0.0/16"], "keys": [ { "id": 1, "file": PATH } ],
///                "sign_with": 1, "window_ms": 1000 } }
///
/// Everything is optional; where "security" is given, all six of its paths are. Relative paths
/// start in the folder of the file that names them. Unknown keys are errors.
///
/// | key of "dds"  | unit | range         | default  | meaning                                    |
/// |---------------|------|---------------|----------|--------------------------------------------|
/// | `interfaces`  |      | up to 8       | none     | names or addresses; none: loopback, or     |
/// |               |      |               |          | what $CYCLONEDDS_URI says                  |
/// | `peers`       |      | up to 32      | none     | hosts to look for where multicast does not |
/// |               |      |               |          | reach                                      |
/// | `deadline_ms` | ms   | 0 .. 60000    | 0        | every sender of states must promise one as |
/// |               |      |               |          | often; lapses are counted; 0: not asked    |
///
/// | key of "lcm" | unit | range          | default  | meaning                                    |
/// |--------------|------|----------------|----------|--------------------------------------------|
/// | `allow`      |      | up to 32       | anybody  | source networks or addresses to hear       |
/// | `keys`       |      | up to 16       | unsigned | what a message must be signed with; 64 to  |
/// |              |      |                |          | 128 hexadecimal digits in a file of 0600   |
/// | `sign_with`  | 1    | 1 .. 2^31 - 1  | nothing  | id of the key that our messages are signed |
/// |              |      |                |          | with                                       |
/// | `window_ms`  | ms   | 10 .. 60000    | 1000     | age of a signed message, skew of clocks    |
///
/// Memory      Heap, until bus_options_free(). transport points into the struct: do not copy it.
#ifndef VERGE_APPS_BUS_JSON_H
#define VERGE_APPS_BUS_JSON_H

#include "json.h"
#include "verge/transport.h"

#include <stdio.h>

enum { BUS_INTERFACES_MAX = 8, BUS_PEERS_MAX = 32, BUS_DEADLINE_MS_MAX = 60000 };

typedef struct bus_options {
    transport_options      transport; ///< what to open a bus with
    transport_dds_security security;
    const char*            interfaces[BUS_INTERFACES_MAX];
    const char*            peers[BUS_PEERS_MAX];
    transport_lcm_auth     lcm;
    const char*            networks[TRANSPORT_LCM_NETWORKS_MAX];
    transport_lcm_key      lcm_keys[TRANSPORT_LCM_KEYS_MAX];
    uint32_t               files_crc32; ///< tells when a named file was replaced
} bus_options;

/// Reads the members "dds" and "lcm" of an object, which may have others. False: reported.
/// Whatever it answers, bus_options_free() is due. log and log_context are left null.
bool bus_options_read(bus_options* self, const json_at* of);
/// The same from a file that holds nothing else. False: file->error has a line.
bool bus_options_load(bus_options* self, const char* path, json_file* file);
void bus_options_free(bus_options* self); ///< all zero is fine

/// Do both ask for the same, and are the files they name the same as when they were read?
bool bus_options_same(const bus_options* self, const bus_options* other);

/// The members as JSON, each with a comma and a line break before it; nothing where none is given.
void bus_options_write(FILE* out, const bus_options* self);

#endif
