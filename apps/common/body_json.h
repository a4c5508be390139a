/// The body of a vehicle in a scenario: by the name of its kind, or an object of its numbers.
///
///     "length": 11.0, "width": 2.5, "body": "truck"
///     "body": { "kind": "bus", "length": 12.2, "rear_axle": 2.7 }
///
/// A number that is not given is the one of the kind, at this size; without a kind the one that
/// length and width suggest (verge_body_by_size()). A vehicle with a body need not state its
/// length and width.
#ifndef VERGE_APPS_BODY_JSON_H
#define VERGE_APPS_BODY_JSON_H

#include "json.h"

#include <verge/types.h>

/// Reads length, width and body of a vehicle. False: see file->error.
bool body_from_json(const json_at* vehicle, verge_vehicle* to);

#endif
