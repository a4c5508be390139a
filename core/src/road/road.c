/// Builds a road in stages, and answers queries. Fitting is in fit.c, stations in bundle.c, merges
/// and conflicts in relate.c, routes in route.c, the look-up of lanes near a point in grid.c.
#include "road/road.h"

#include "base/contract.h"
#include "road/build.h"
#include "base/scalar.h"

// A lane runs along a heading if the angle between them is below 60 degrees. [1] its cosine
static const double same_direction = 0.5;

static void take_memory(vg_road_draft* draft, vg_arena* arena);
static void copy_lanes(vg_road_draft* draft);
static void place_stop_lines(vg_road_draft* draft);
static uint64_t fingerprint_of(const struct verge_road* road);
static void find_predecessors(struct verge_road* road);
static const vg_lane* lane_of(const verge_road* road, int32_t lane_id);
static verge_lane_position position_on(const vg_lane* lane, double x, double y, double s_hint);
static verge_lane_position position_at(const vg_lane* lane, double x, double y, double s);
/// Whether `at` on `lane` is a better place for a body than the best so far, and how good it is.
static double misfit(const vg_lane* lane, const verge_lane_position* at, double heading);

struct verge_road* vg_road_build(vg_arena* arena, vg_arena* scratch, const verge_road_def* def)
{
    VERGE_ASSERT(arena != NULL && def != NULL);
    VERGE_ASSERT(def->lane_count >= 1 && def->lane_count <= VERGE_LANES_MAX);

    vg_road_draft draft = { .def = def, .scratch = scratch,
                            .meetings = vg_road_meetings(def, NULL) };
    if (arena->base != NULL) {
        vg_arena_empty(scratch);
        draft.storage = vg_arena_take(scratch, def->lane_count * sizeof *draft.storage);
        draft.scratch_start = scratch->used;
    }
    take_memory(&draft, arena);
    if (arena->base == NULL || arena->failed || draft.storage == NULL) {
        return NULL;
    }
    copy_lanes(&draft);
    find_predecessors(draft.road);
    vg_road_fit(&draft);
    if (scratch->failed) {
        return NULL;
    }
    place_stop_lines(&draft);
    vg_road_grid(&draft);
    vg_road_bundle(&draft);
    vg_road_route(&draft);
    vg_road_relate(&draft);
    draft.road->fingerprint = fingerprint_of(draft.road);
    return scratch->failed ? NULL : draft.road;
}

static uint64_t mix(uint64_t hash, const void* data, size_t size)
{
    const uint8_t* bytes = data;
    for (size_t i = 0; i < size; ++i) { // FNV-1a
        hash = (hash ^ bytes[i]) * 0x100000001b3u;
    }
    return hash;
}

/// Of what the relations of lanes depend on.
static uint64_t fingerprint_of(const struct verge_road* road)
{
    uint64_t hash = 0xcbf29ce484222325u;
    for (uint32_t i = 0; i < road->lane_count; ++i) {
        const vg_lane* lane = &road->lanes[i];
        hash = mix(hash, &lane->length, sizeof lane->length);
        hash = mix(hash, &lane->station_start, sizeof lane->station_start);
        hash = mix(hash, lane->successors, lane->successor_count * sizeof lane->successors[0]);
        hash = mix(hash, &lane->bundle, sizeof lane->bundle);
        hash = mix(hash, lane->line.x, lane->line.knot_count * sizeof lane->line.x[0]);
        hash = mix(hash, lane->line.y, lane->line.knot_count * sizeof lane->line.y[0]);
    }
    return hash;
}

/// Space before the road's end takes what the fit needs only while the road is built.
static size_t padded_scratch_size(const verge_road_def* def)
{
    return (vg_road_scratch_size(def) + VG_ARENA_ALIGN - 1u) / VG_ARENA_ALIGN * VG_ARENA_ALIGN;
}

size_t verge_road_memory_size(const verge_road_def* def, size_t* road_size)
{
    if (def == NULL || verge_road_check(def, NULL) != VERGE_OK) {
        return 0;
    }
    vg_arena arena;
    vg_arena_init(&arena, NULL, 0);
    (void)vg_road_build(&arena, NULL, def);
    if (road_size != NULL) {
        *road_size = arena.used;
    }
    return arena.used + padded_scratch_size(def);
}

verge_status verge_road_init(const verge_road** road, const verge_road_def* def, void* memory,
                             size_t size)
{
    if (road == NULL) {
        return VERGE_ERR_ARGUMENT;
    }
    *road = NULL;
    if (def == NULL || verge_road_check(def, NULL) != VERGE_OK) {
        return VERGE_ERR_ROAD;
    }
    vg_arena arena, scratch;
    if (!vg_arena_begin(&arena, memory, size)) {
        return VERGE_ERR_MEMORY;
    }
    // The far end of the memory is the fit's; the road may grow up to there.
    const size_t scratch_size = padded_scratch_size(def);
    const size_t end = size / VG_ARENA_ALIGN * VG_ARENA_ALIGN;
    if (end < scratch_size) {
        return VERGE_ERR_MEMORY;
    }
    arena.size = end - scratch_size;
    vg_arena_init(&scratch, arena.base + arena.size, scratch_size);
    *road = vg_road_build(&arena, &scratch, def);
    return *road == NULL ? VERGE_ERR_MEMORY : VERGE_OK;
}

size_t vg_road_scratch_size(const verge_road_def* def)
{
    const size_t fit = vg_road_fit_scratch_size(def);
    const vg_meetings meetings = vg_road_meetings(def, NULL);
    const size_t relate = vg_road_relate_scratch_size(def, &meetings);
    const size_t bundle = vg_road_bundle_scratch_size(def), route = vg_road_route_scratch_size(def);
    const size_t larger = fit > relate ? fit : relate, smaller = bundle > route ? bundle : route;
    const size_t stages = larger > smaller ? larger : smaller;
    return stages + def->lane_count * sizeof(vg_lane_storage) + VG_ARENA_ALIGN;
}

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

// The knot of a chunk that is nearest to the point, if the lane runs along the heading there and the
// point is nearer than sqrt(*least).
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
static verge_lane_position position_along(const vg_nearby* nearby, double heading)
{
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

verge_lane_position vg_nearby_position(const vg_nearby* nearby, double heading)
{
    return position_along(nearby, vg_wrap_angle(heading));
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
    const int32_t lane = road == NULL ? -1 : vg_road_lane_index(road, lane_id);
    return lane < 0 ? VERGE_NO_LANE : id_of(road, road->lanes[lane].left);
}

int32_t verge_road_right(const verge_road* road, int32_t lane_id)
{
    const int32_t lane = road == NULL ? -1 : vg_road_lane_index(road, lane_id);
    return lane < 0 ? VERGE_NO_LANE : id_of(road, road->lanes[lane].right);
}

int32_t verge_road_next(const verge_road* road, int32_t lane_id, int32_t target_lane)
{
    const int32_t lane = road == NULL ? -1 : vg_road_lane_index(road, lane_id);
    if (lane < 0) {
        return VERGE_NO_LANE;
    }
    const int32_t target = vg_road_lane_index(road, target_lane);
    const int32_t next = vg_road_next(road, (uint32_t)lane, target);
    return next < 0 ? VERGE_NO_LANE : road->lanes[next].id;
}

bool verge_road_continues(const verge_road* road, int32_t target_lane, int32_t lane_id)
{
    const int32_t lane = road == NULL ? -1 : vg_road_lane_index(road, lane_id);
    const int32_t target = lane < 0 ? -1 : vg_road_lane_index(road, target_lane);
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

/// The arrays of one lane, its line in one piece.
static void take_lane(vg_lane_storage* storage, vg_arena* arena, const verge_lane_def* def)
{
    const size_t knots = vg_lane_knot_count(def);
    const uint32_t bins = vg_lane_bin_capacity(def);
    double* line = vg_arena_take(arena, 4 * knots * sizeof *line);
    vg_bin* of_lane = vg_arena_take(arena, bins * sizeof *of_lane);
    if (line != NULL && of_lane != NULL) {
        *storage = (vg_lane_storage){ .x = line, .y = line + knots, .xss = line + 2 * knots,
                                      .yss = line + 3 * knots, .bins = of_lane,
                                      .bin_capacity = bins };
    }
}

static uint32_t successor_total(const verge_road_def* def)
{
    uint32_t total = 0;
    for (uint32_t i = 0; i < def->lane_count; ++i) {
        total += def->lanes[i].successor_count;
    }
    return total;
}

/// The same takes in the same order whether the arena measures or not.
static void take_memory(vg_road_draft* draft, vg_arena* arena)
{
    const verge_road_def* def = draft->def;
    const size_t n = def->lane_count;
    struct verge_road* road = vg_arena_take(arena, sizeof *road);
    struct verge_road of = {
        .lane_count = def->lane_count,
        .lanes = vg_arena_take(arena, n * sizeof *of.lanes),
        .by_id = vg_arena_take(arena, n * sizeof *of.by_id),
        .predecessors_from = vg_arena_take(arena, (n + 1) * sizeof *of.predecessors_from),
        .predecessors = vg_arena_take(arena, successor_total(def) * sizeof *of.predecessors),
        .ways = vg_arena_take(arena, n * n * sizeof *of.ways),
        .bundles_from = vg_arena_take(arena, (n + 1) * sizeof *of.bundles_from),
        .bundle_lanes = vg_arena_take(arena, n * sizeof *of.bundle_lanes),
        .merges_from = vg_arena_take(arena, (n + 1) * sizeof *of.merges_from),
        .merges = vg_arena_take(arena, 2 * draft->meetings.pairs * sizeof *of.merges),
        .conflicts_from = vg_arena_take(arena, (n + 1) * sizeof *of.conflicts_from),
        .conflicts = vg_arena_take(arena, 2 * draft->meetings.areas * sizeof *of.conflicts),
        .merge_capacity = 2 * draft->meetings.pairs,
        .conflict_capacity = 2 * draft->meetings.areas,
    };
    vg_road_grid_take(&of.grid, arena, def);
    for (size_t i = 0; i < n; ++i) {
        vg_lane_storage ignored;
        take_lane(draft->storage != NULL ? &draft->storage[i] : &ignored, arena, &def->lanes[i]);
    }
    if (arena->base == NULL || arena->failed) {
        return;
    }
    *road = of;
    draft->road = road;
}

static void copy_lane(vg_road_draft* draft, uint32_t index)
{
    struct verge_road* road = draft->road;
    const verge_lane_def* def = &draft->def->lanes[index];
    const vg_lane_storage* storage = &draft->storage[index];
    vg_lane* lane = &road->lanes[index];
    lane->width = def->width;
    lane->speed_limit = def->speed_limit;
    lane->priority = def->priority;
    lane->line.knot_count = vg_lane_knot_count(def);
    lane->line.x = storage->x;
    lane->line.y = storage->y;
    lane->line.xss = storage->xss;
    lane->line.yss = storage->yss;
    lane->bins = storage->bins;
    lane->left = def->left == VERGE_NO_LANE ? -1 : vg_road_lane_index(road, def->left);
    lane->right = def->right == VERGE_NO_LANE ? -1 : vg_road_lane_index(road, def->right);
    lane->successor_count = def->successor_count;
    for (uint32_t k = 0; k < def->successor_count; ++k) {
        lane->successors[k] = vg_road_lane_index(road, def->successors[k]);
        VERGE_ASSERT(lane->successors[k] >= 0);
    }
}

static void copy_lanes(vg_road_draft* draft)
{
    struct verge_road* road = draft->road;
    vg_lanes_sort(draft->def, road->by_id);
    for (uint32_t i = 0; i < road->lane_count; ++i) {
        road->lanes[i].id = draft->def->lanes[i].id; // first: links are found by id
    }
    for (uint32_t i = 0; i < road->lane_count; ++i) {
        copy_lane(draft, i);
    }
}

/// After the fit: a line may be decimetres shorter than its survey.
static void place_stop_lines(vg_road_draft* draft)
{
    for (uint32_t i = 0; i < draft->road->lane_count; ++i) {
        const verge_lane_def* def = &draft->def->lanes[i];
        vg_lane* lane = &draft->road->lanes[i];
        lane->stop_line = def->stop_line_given ? vg_min(def->stop_line, lane->length) : lane->length;
    }
}

/// Counts what leads to each lane, then writes it down in the order of the lanes.
static void find_predecessors(struct verge_road* road)
{
    uint32_t* from = road->predecessors_from; // [i + 1]: count, then end, then begin of part i
    for (uint32_t i = 0; i < road->lane_count; ++i) {
        for (uint32_t k = 0; k < road->lanes[i].successor_count; ++k) {
            ++from[road->lanes[i].successors[k] + 1];
        }
    }
    for (uint32_t i = 0; i < road->lane_count; ++i) {
        from[i + 1] += from[i];
    }
    const uint32_t total = from[road->lane_count];
    for (uint32_t i = road->lane_count; i-- > 0;) { // each part is filled from its end
        const vg_lane* lane = &road->lanes[i];
        for (uint32_t k = 0; k < lane->successor_count; ++k) {
            road->predecessors[--from[lane->successors[k] + 1]] = (uint16_t)i;
        }
    }
    for (uint32_t i = 0; i < road->lane_count; ++i) {
        from[i] = from[i + 1];
    }
    from[road->lane_count] = total;
}

static const vg_lane* lane_of(const verge_road* road, int32_t lane_id)
{
    const int32_t index = road == NULL ? -1 : vg_road_lane_index(road, lane_id);
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
