/// The body of a vehicle in a scenario: the name of its kind, or an object with its numbers.
///
///     "length": 11.0, "width": 2.5, "body": "truck"
///     "body": { "kind": "bus", "length": 12.2, "rear_axle": 2.7 }
///
/// An absent number is that of the kind, at this size. Without a kind, length and width select it
/// (verge_body_by_size()). A vehicle with a body may omit its length and width.
#ifndef VERGE_APPS_BODY_JSON_H
#define VERGE_APPS_BODY_JSON_H

#include "json.h"

#include <verge/types.h>

/// Reads length, width and body of a vehicle. False: the reason is in file->error.
bool body_from_json(const json_at* vehicle, verge_vehicle* to);

#endif
