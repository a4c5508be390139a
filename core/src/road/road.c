/// Answers questions about a built road.
#include "road/road.h"

#include "base/contract.h"
#include "base/scalar.h"
#include "road/build.h"

// A lane runs along a heading if the angle between them is below 60 degrees. [1] its cosine
static const double same_direction = 0.5;

static int32_t index_of(const verge_road* road, int32_t lane_id);
static const vg_lane* lane_of(const verge_road* road, int32_t lane_id);
static verge_lane_position position_on(const vg_lane* lane, double x, double y, double s_hint);
static verge_lane_position position_at(const vg_lane* lane, double x, double y, double s);
/// Whether `at` on `lane` is a better place for a body than the best so far, and how good it is.
static double misfit(const vg_lane* lane, const verge_lane_position* at, double heading);

verge_lane_def verge_lane_def_default(void)
{
    return (verge_lane_def){ .width = 3.5, .speed_limit = 13.9, .left = VERGE_NO_LANE,
                             .right = VERGE_NO_LANE };
}

int32_t vg_road_lane_index(const struct verge_road* road, int32_t lane_id)
{
    VERGE_ASSERT(road != NULL);
    uint32_t low = 0, high = road->lane_count;
    while (low < high) {
        const uint32_t middle = low + (high - low) / 2;
        if (road->lanes[road->by_id[middle]].id < lane_id) {
            low = middle + 1;
        } else {
            high = middle;
        }
    }
    const bool found = low < road->lane_count && road->lanes[road->by_id[low]].id == lane_id;
    return found ? (int32_t)road->by_id[low] : -1;
}

verge_lane_position verge_road_project(const verge_road* road, double x, double y, double heading,
                                       int32_t prefer_lane)
{
    verge_lane_position best = { .lane_id = VERGE_NO_LANE };
    if (road == NULL || !vg_finite(x) || !vg_finite(y) || !(vg_abs(heading) <= 1e6)) {
        return best;
    }
    double best_misfit = VG_HUGE;
    vg_nearby nearby = vg_road_nearby(road, x, y);
    for (int32_t i = vg_nearby_next(&nearby); i >= 0; i = vg_nearby_next(&nearby)) {
        const vg_lane* lane = &road->lanes[i];
        const verge_lane_position at = vg_nearby_position(&nearby, heading);
        const double here = misfit(lane, &at, heading);
        if (at.contained && at.lane_id == prefer_lane) {
            return at;
        }
        if (here < best_misfit) {
            best = at;
            best_misfit = here;
        }
    }
    return best;
}

verge_lane_position verge_road_project_on(const verge_road* road, int32_t lane_id, double x,
                                          double y)
{
    const vg_lane* lane = lane_of(road, lane_id);
    if (lane == NULL || !vg_finite(x) || !vg_finite(y)) {
        return (verge_lane_position){ .lane_id = VERGE_NO_LANE };
    }
    return position_on(lane, x, y, 0.0);
}

// The knot of a chunk that is nearest to the point, if the lane runs along the heading there and
// the point is nearer than sqrt(*least).
static int32_t knot_along(const vg_line* line, const vg_nearby* nearby, uint32_t chunk,
                          const double direction[2], double* least)
{
    const uint32_t from = chunk * (uint32_t)VG_CHUNK_KNOTS;
    int32_t found = -1;
    for (uint32_t k = from; k < from + VG_CHUNK_KNOTS && k + 1u < line->knot_count; ++k) {
        const double ux = line->x[k + 1u] - line->x[k], uy = line->y[k + 1u] - line->y[k];
        const double dx = nearby->x - line->x[k], dy = nearby->y - line->y[k];
        const double square = dx * dx + dy * dy;
        const double along = ux * direction[0] + uy * direction[1];
        if (square < *least && along > same_direction * line->knot_spacing) {
            *least = square;
            found = (int32_t)k;
        }
    }
    return found;
}

// A lane may cross itself or come back beside itself: the nearest place is not always the one where
// a body is. If the lane runs in another direction there, its other parts near the point are tried.
verge_lane_position vg_nearby_position(const vg_nearby* nearby, double heading)
{
    heading = vg_wrap_angle(heading);
    const vg_lane* lane = &nearby->road->lanes[nearby->lane];
    const vg_grid* grid = &nearby->road->grid;
    const verge_lane_position nearest = position_on(lane, nearby->x, nearby->y, nearby->s);
    if (vg_cos(vg_wrap_angle(heading - nearest.heading)) >= same_direction) {
        return nearest;
    }
    const double reach = 0.5 * lane->width + VG_EDGE_REACH;
    double direction[2], least = reach * reach;
    vg_sincos(heading, &direction[1], &direction[0]);
    int32_t knot = -1;
    VERGE_ASSERT(nearby->at > 0);
    for (uint32_t i = nearby->at - 1u; i < nearby->end; ++i) { // this lane's chunks in the cell
        const vg_chunk* chunk = &grid->chunks[grid->chunk_of[i]];
        if ((int32_t)chunk->lane != nearby->lane) {
            break;
        }
        const int32_t here = knot_along(&lane->line, nearby, chunk->index, direction, &least);
        knot = here >= 0 ? here : knot;
    }
    const double s = lane->line.knot_spacing * (double)knot;
    return knot < 0 ? nearest
                    : position_at(lane, nearby->x, nearby->y,
                                  vg_lane_project(lane, nearby->x, nearby->y, s));
}

bool verge_road_at(const verge_road* road, int32_t lane_id, double s, double d,
                   double* x, double* y, double* heading)
{
    const vg_lane* lane = lane_of(road, lane_id);
    if (lane == NULL || !vg_finite(s) || !vg_finite(d)) {
        return false;
    }
    const vg_reference at = vg_lane_at(lane, s);
    double unwanted;
    *(x != NULL ? x : &unwanted) = at.x - d * at.sin_heading;
    *(y != NULL ? y : &unwanted) = at.y + d * at.cos_heading;
    *(heading != NULL ? heading : &unwanted) = vg_atan2(at.sin_heading, at.cos_heading);
    return true;
}

double verge_road_length(const verge_road* road, int32_t lane_id)
{
    const vg_lane* lane = lane_of(road, lane_id);
    return lane != NULL ? lane->length : 0.0;
}

double verge_road_width(const verge_road* road, int32_t lane_id)
{
    const vg_lane* lane = lane_of(road, lane_id);
    return lane != NULL ? lane->width : 0.0;
}

double verge_road_deviation(const verge_road* road, int32_t lane_id)
{
    const vg_lane* lane = lane_of(road, lane_id);
    return lane != NULL ? lane->deviation : 0.0;
}

double verge_road_speed_limit(const verge_road* road, int32_t lane_id)
{
    const vg_lane* lane = lane_of(road, lane_id);
    return lane != NULL ? lane->speed_limit : 0.0;
}

verge_priority verge_road_priority(const verge_road* road, int32_t lane_id)
{
    const vg_lane* lane = lane_of(road, lane_id);
    return lane != NULL ? lane->priority : VERGE_PRIORITY_NONE;
}

double verge_road_stop_line(const verge_road* road, int32_t lane_id)
{
    const vg_lane* lane = lane_of(road, lane_id);
    return lane != NULL ? lane->stop_line : 0.0;
}

static int32_t id_of(const verge_road* road, int32_t lane)
{
    return lane < 0 ? VERGE_NO_LANE : road->lanes[lane].id;
}

int32_t verge_road_left(const verge_road* road, int32_t lane_id)
{
    const vg_lane* lane = lane_of(road, lane_id);
    return lane == NULL ? VERGE_NO_LANE : id_of(road, lane->left);
}

int32_t verge_road_right(const verge_road* road, int32_t lane_id)
{
    const vg_lane* lane = lane_of(road, lane_id);
    return lane == NULL ? VERGE_NO_LANE : id_of(road, lane->right);
}

int32_t verge_road_next(const verge_road* road, int32_t lane_id, int32_t target_lane)
{
    const int32_t lane = index_of(road, lane_id);
    if (lane < 0) {
        return VERGE_NO_LANE;
    }
    const int32_t target = vg_road_lane_index(road, target_lane);
    const int32_t next = vg_road_next(road, (uint32_t)lane, target);
    return next < 0 ? VERGE_NO_LANE : road->lanes[next].id;
}

bool verge_road_continues(const verge_road* road, int32_t target_lane, int32_t lane_id)
{
    const int32_t lane = index_of(road, lane_id), target = index_of(road, target_lane);
    return lane >= 0 && target >= 0 && vg_road_continues(road, (uint32_t)target, (uint32_t)lane);
}

int32_t vg_lane_before(const struct verge_road* road, uint32_t lane)
{
    // All of them end in one direction. The straightest one has it already some metres before.
    static const double distance = 8.0; // [m]
    const vg_reference at = vg_lane_at(&road->lanes[lane], 0.0);
    int32_t best = -1;
    double best_cosine = -2.0;
    for (uint32_t k = 0; k < vg_lane_predecessor_count(road, lane); ++k) {
        const int32_t before = vg_lane_predecessor(road, lane, k);
        const vg_lane* other = &road->lanes[before];
        const vg_reference near = vg_lane_at(other, vg_max(other->length - distance, 0.0));
        const double cosine = at.cos_heading * near.cos_heading
                              + at.sin_heading * near.sin_heading;
        if (cosine > best_cosine) {
            best = before;
            best_cosine = cosine;
        }
    }
    return best;
}

double vg_lane_station(const vg_lane* lane, double s)
{
    // The bins are uniform in station, not in s: find the bin by bisection.
    VERGE_ASSERT(lane->bin_count >= 2);
    uint32_t low = 0;
    uint32_t high = lane->bin_count - 1;
    while (high - low > 1) {
        const uint32_t middle = low + (high - low) / 2;
        if ((double)lane->bins[middle].s <= s) {
            low = middle;
        } else {
            high = middle;
        }
    }
    const double s0 = (double)lane->bins[low].s;
    const double s1 = (double)lane->bins[high].s;
    return lane->station_start + VG_BIN * ((double)low + (s - s0) / (s1 - s0));
}

double vg_lane_s(const vg_lane* lane, double station)
{
    VERGE_ASSERT(lane->bin_count >= 2);
    const double bins = (station - lane->station_start) / VG_BIN;
    const uint32_t bin = (uint32_t)vg_clamp(bins, 0.0, (double)(lane->bin_count - 2));
    const double s0 = (double)lane->bins[bin].s;
    const double s1 = (double)lane->bins[bin + 1].s;
    return s0 + (bins - (double)bin) * (s1 - s0);
}

/// -1: there is no such lane, or no road.
static int32_t index_of(const verge_road* road, int32_t lane_id)
{
    return road == NULL ? -1 : vg_road_lane_index(road, lane_id);
}

static const vg_lane* lane_of(const verge_road* road, int32_t lane_id)
{
    const int32_t index = index_of(road, lane_id);
    return index < 0 ? NULL : &road->lanes[index];
}

static verge_lane_position position_on(const vg_lane* lane, double x, double y, double s_hint)
{
    return position_at(lane, x, y, vg_lane_project_whole(lane, x, y, s_hint));
}

static verge_lane_position position_at(const vg_lane* lane, double x, double y, double s)
{
    const vg_reference at = vg_lane_at(lane, s);
    verge_lane_position position;
    position.lane_id = lane->id;
    position.s = s;
    position.d = (y - at.y) * at.cos_heading - (x - at.x) * at.sin_heading;
    position.heading = vg_atan2(at.sin_heading, at.cos_heading);
    position.curvature = at.curvature;
    position.contained = vg_abs(position.d) <= 0.5 * lane->width && s >= 0.0 && s <= lane->length;
    return position;
}

static double misfit(const vg_lane* lane, const verge_lane_position* at, double heading)
{
    // Where lanes overlap their directions are nearly the same: then the nearer centre wins.
    const double turn = vg_abs(vg_wrap_angle(vg_wrap_angle(heading) - at->heading));
    const double half = 0.5 * lane->width;
    if (at->contained) {
        return turn + 0.1 * vg_abs(at->d) / half;
    }
    const double aside = vg_max(vg_abs(at->d) - half, 0.0);
    const double beyond = vg_max(vg_max(-at->s, at->s - lane->length), 0.0);
    const double distance = vg_sqrt(aside * aside + beyond * beyond);
    return distance <= VG_EDGE_REACH ? 1e3 + distance : VG_HUGE;
}
