/// Where surveys come near one another: which pairs of lanes may conflict or merge, and how often.
/// Counted from the surveys alone, so that memory can be sized before anything is fitted. A count
/// that is a little too high costs a few bytes; so it takes boxes around some metres of survey.
#include "road/build.h"

#include "base/scalar.h"

#include <stddef.h>

/// Lines that touch within VG_BODY_WIDTH_MAX come from surveys at most so far apart: lines keep
/// within 1.7 m of their surveys wherever a vehicle can drive along them. [m]
static const float meet_distance = 6.0f;
/// Metres of one lane that are looked at together.
static const double piece_length = 16.0;
enum { PARTS = 64 }; ///< boxes of the other lane

typedef struct box {
    float x0, y0, x1, y1; ///< [m] from the first point of the first lane
} box;

typedef struct boxes {
    const verge_road_def* def;
    uint16_t by_id[VERGE_LANES_MAX];
    uint16_t beside[VERGE_LANES_MAX]; ///< links of neighbours, directly or through others
    box      of[VERGE_LANES_MAX];
} boxes;

static const box no_box = { 1e30f, 1e30f, -1e30f, -1e30f };

static void box_add(box* self, const boxes* all, const double point[2])
{
    const double* origin = all->def->lanes[0].points[0];
    const float x = (float)(point[0] - origin[0]), y = (float)(point[1] - origin[1]);
    self->x0 = x < self->x0 ? x : self->x0;
    self->y0 = y < self->y0 ? y : self->y0;
    self->x1 = x > self->x1 ? x : self->x1;
    self->y1 = y > self->y1 ? y : self->y1;
}

static bool near(const box* a, const box* b)
{
    return a->x0 <= b->x1 + meet_distance && b->x0 <= a->x1 + meet_distance
           && a->y0 <= b->y1 + meet_distance && b->y0 <= a->y1 + meet_distance;
}

/// The lowest lane beside this one that is known so far.
static uint16_t head_of(boxes* all, uint16_t lane)
{
    while (all->beside[lane] != lane) {
        all->beside[lane] = all->beside[all->beside[lane]];
        lane = all->beside[lane];
    }
    return lane;
}

static void join(boxes* all, uint16_t lane, int32_t id)
{
    const int32_t other = id == VERGE_NO_LANE ? -1 : vg_lanes_find(all->def, all->by_id, id);
    if (other < 0) {
        return;
    }
    const uint16_t a = head_of(all, lane), b = head_of(all, (uint16_t)other);
    all->beside[a < b ? b : a] = a < b ? a : b;
}

static void boxes_from(boxes* all, const verge_road_def* def)
{
    all->def = def;
    vg_lanes_sort(def, all->by_id);
    for (uint32_t i = 0; i < def->lane_count; ++i) {
        all->beside[i] = (uint16_t)i;
        all->of[i] = no_box;
        for (uint32_t k = 0; k < def->lanes[i].point_count; ++k) {
            box_add(&all->of[i], all, def->lanes[i].points[k]);
        }
    }
    for (uint32_t i = 0; i < def->lane_count; ++i) {
        join(all, (uint16_t)i, def->lanes[i].left);
        join(all, (uint16_t)i, def->lanes[i].right);
    }
}

static bool leads_to(const verge_lane_def* lane, int32_t id)
{
    for (uint32_t k = 0; k < lane->successor_count; ++k) {
        if (lane->successors[k] == id) {
            return true;
        }
    }
    return false;
}

/// Points of part k of a lane; the last one is the next part's first.
static uint32_t part_begin(const verge_lane_def* lane, uint32_t k)
{
    return (uint32_t)((uint64_t)(lane->point_count - 1) * k / PARTS);
}

/// Is a piece of one lane near some leg of the other, whose parts have these boxes?
static bool piece_meets(const boxes* all, const box* piece, const verge_lane_def* other,
                        const box* parts)
{
    for (uint32_t part = 0; part < PARTS; ++part) {
        if (!near(piece, &parts[part])) {
            continue;
        }
        for (uint32_t i = part_begin(other, part); i < part_begin(other, part + 1); ++i) {
            box leg = no_box;
            box_add(&leg, all, other->points[i]);
            box_add(&leg, all, other->points[i + 1]);
            if (near(piece, &leg)) {
                return true;
            }
        }
    }
    return false;
}

/// Runs of pieces of one lane that are near the other.
static uint32_t runs_near(const boxes* all, const verge_lane_def* lane, const verge_lane_def* other)
{
    box parts[PARTS];
    for (uint32_t part = 0; part < PARTS; ++part) {
        parts[part] = no_box;
        for (uint32_t i = part_begin(other, part); i <= part_begin(other, part + 1); ++i) {
            box_add(&parts[part], all, other->points[i]);
        }
    }
    uint32_t runs = 0;
    bool inside = false;
    for (uint32_t first = 0; first + 1 < lane->point_count;) {
        box piece = no_box;
        double length = 0.0;
        uint32_t last = first;
        box_add(&piece, all, lane->points[first]);
        do {
            const double *a = lane->points[last], *b = lane->points[last + 1];
            length += vg_sqrt(vg_square(b[0] - a[0]) + vg_square(b[1] - a[1]));
            box_add(&piece, all, b);
        } while (++last + 1 < lane->point_count && length < piece_length);
        const bool meets = piece_meets(all, &piece, other, parts);
        runs += meets && !inside ? 1u : 0u;
        inside = meets;
        first = last;
    }
    return runs;
}

vg_meetings vg_road_meetings(const verge_road_def* def, vg_meeting* list)
{
    boxes all;
    vg_meetings found = { .crowded = -1 };
    uint16_t runs_of[VERGE_LANES_MAX] = { 0 };
    boxes_from(&all, def);
    for (uint32_t a = 0; a < def->lane_count; ++a) {
        for (uint32_t b = a + 1; b < def->lane_count; ++b) {
            const verge_lane_def *lane = &def->lanes[a], *other = &def->lanes[b];
            if (!near(&all.of[a], &all.of[b]) || leads_to(lane, other->id)
                || leads_to(other, lane->id)
                || head_of(&all, (uint16_t)a) == head_of(&all, (uint16_t)b)) {
                continue;
            }
            const uint32_t runs = runs_near(&all, lane, other);
            if (runs == 0) {
                continue;
            }
            if (list != NULL) {
                list[found.pairs] = (vg_meeting){ .a = (uint16_t)a, .b = (uint16_t)b,
                                                  .areas_max = (uint16_t)(runs + 1) };
            }
            ++found.pairs;
            found.areas += runs + 1; // some come so near each other that the boxes count them once
            runs_of[a] = (uint16_t)(runs_of[a] + runs);
            runs_of[b] = (uint16_t)(runs_of[b] + runs);
            const uint32_t crowded = runs_of[a] > VERGE_CONFLICTS_MAX ? a : b;
            if (runs_of[crowded] > VERGE_CONFLICTS_MAX) {
                found.crowded = (int32_t)crowded;
                return found;
            }
        }
    }
    return found;
}
