#include "road_report.h"

#include <string.h>

/// Lists the kinds of bodies that cannot steer along this radius.
static void list_excluded(double radius, char* list, size_t size)
{
    list[0] = '\0';
    for (int kind = 0; kind < VERGE_BODY_KIND_COUNT; kind++) {
        const verge_body body = verge_body_of((verge_body_kind)kind);
        if (verge_body_radius_min(&body) > radius) {
            const size_t used = strlen(list);
            snprintf(list + used, size - used, "%s%s", used > 0 ? ", " : "",
                     verge_body_name((verge_body_kind)kind));
        }
    }
}

static void print_lane(const verge_lane_report* lane, const char* excluded, FILE* out)
{
    fprintf(out, "lane %d: %.2f m from its survey, ", lane->lane_id, lane->deviation);
    if (lane->radius_min < 1e5) {
        fprintf(out, "radius %.1f m at %.0f m, ", lane->radius_min, lane->radius_s);
    } else {
        fprintf(out, "straight, ");
    }
    fprintf(out, "%.1f m/s%s%s\n", lane->speed_min, excluded[0] != '\0' ? ", not for: " : "",
            excluded);
}

static void print_warning(const verge_lane_warning* warning, FILE* err)
{
    if (warning->other_lane != VERGE_NO_LANE) {
        fprintf(err, "lane %d ", warning->other_lane);
    }
    fprintf(err, "%s", warning->text);
    if (warning->value != 0.0) {
        fprintf(err, ": %.2f", warning->value);
    }
    fprintf(err, "\n");
}

void road_report_print(const verge_road* road, const verge_road_def* def, const char* path,
                       FILE* out, FILE* err)
{
    const verge_body van = verge_body_of(VERGE_BODY_VAN);
    for (uint32_t i = 0; i < def->lane_count; i++) {
        verge_lane_report lane;
        char              excluded[128];
        if (verge_road_report(road, def, i, &lane) != VERGE_OK) {
            return;
        }
        list_excluded(lane.radius_min, excluded, sizeof excluded);
        print_lane(&lane, excluded, out);
        if (lane.radius_min < verge_body_radius_min(&van)) {
            fprintf(err, "%s:road.lanes[%u].centerline: warning: bends with a radius of %.1f m at "
                    "%.0f m, too sharp for: %s\n", path, i, lane.radius_min, lane.radius_s,
                    excluded);
        }
        for (uint32_t k = 0; k < lane.warning_count; k++) {
            fprintf(err, "%s:road.lanes[%u].%s: warning: ", path, i, lane.warnings[k].field);
            print_warning(&lane.warnings[k], err);
        }
    }
}
