/// A road from JSON: the `road` object of scenarios and of the daemon's configuration.
///
///     { "lanes": [ { "id": 0, "centerline": [[x, y], ...], "width": 3.75, "speed_limit": 33.0,
///                    "left": 1, "right": null, "successors": [7],
///                    "change_left": [[s0, s1], ...], "change_right": [] } ] }
///
/// centerline [m] in travel direction, 2 to 1,024 points; width [m]; speed_limit [m/s]. left,
/// right (null or absent: none) and successors (absent: none) are lane ids. change_left and
/// change_right: the sections [m] of this lane where a lane change is allowed (absent: along the
/// whole neighbour; empty: none). The conditions that a road has to meet: verge_road_check().
#ifndef VERGE_APPS_ROAD_JSON_H
#define VERGE_APPS_ROAD_JSON_H

#include "json.h"
#include "verge/road.h"

/// Reads the road at `at`. The caller frees def with road_json_free(), also if false is returned
/// (reason in at->file->error).
bool road_from_json(const json_at* at, verge_road_def* def);
void road_json_free(verge_road_def* def);
bool road_has_lane(const verge_road_def* def, int32_t lane_id);

#endif
