/// The messages of the bus as JSON, every field by its name on the wire, in the order of the wire.
/// NaN is null; a digest is 16 hexadecimal digits in quotes, a checksum 8; crc32 is left out where
/// it is 0, of messages that have not been sent; an array has its elements in use and no count.
#ifndef VERGE_APPS_MESSAGE_JSON_H
#define VERGE_APPS_MESSAGE_JSON_H

#include "text.h"

#include "verge/transport.h"

/// The largest a plan gets: [B].
enum { MESSAGE_JSON_MAX = 8192 };

/// message is the struct of this kind: a state, a plan or a status.
void message_json(text* out, transport_kind kind, const void* message);

/// "planned", "keep_lane", "brake" or "cancelled"; "unknown" for any other code.
const char* message_plan_status(int32_t status);
/// "starting", "waiting", "running", "degraded" or "stopping"; "unknown".
const char* message_rsu_state(int32_t state);
/// "none", "config", ...: the names in the table of faults; "unknown".
const char* message_rsu_fault(int32_t fault);

#endif
