/// The messages of the bus as JSON: every field by its name and in its order on the wire. NaN is
/// null. A digest is a string of 16 hexadecimal digits, a checksum one of 8. A crc32 of 0, of a
/// message that was not sent, is omitted. An array has its used elements and no count.
#ifndef VERGE_APPS_MESSAGE_JSON_H
#define VERGE_APPS_MESSAGE_JSON_H

#include "text.h"

#include "verge/transport.h"

/// [B] Size of the largest plan.
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
