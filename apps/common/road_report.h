/// What an operator should know of a road before vehicles drive on it: printed by --check-config.
#ifndef ROAD_REPORT_H
#define ROAD_REPORT_H

#include "verge/verge.h"

#include <stdio.h>

/// One line a lane on `out`: deviation from the survey, smallest radius, speed allowed, and the
/// kinds of vehicles that cannot drive it. One line a warning on `err`, at `path`:road.lanes[i].
void road_report_print(const verge_road* road, const verge_road_def* def, const char* path,
                       FILE* out, FILE* err);

#endif
