/// Builds a road in stages. Fitting is in fit.c, stations in bundle.c, merges and conflicts in
/// relate.c, routes in route.c, the look-up of lanes near a point in grid.c.
#include "road/build.h"

#include "base/contract.h"
#include "base/scalar.h"

static void take_memory(vg_road_draft* draft, vg_arena* arena);
static void copy_lanes(vg_road_draft* draft);
static void place_stop_lines(vg_road_draft* draft);
static uint64_t fingerprint_of(const struct verge_road* road);
static void find_predecessors(struct verge_road* road);

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
    if (scratch->failed) {
        return NULL;
    }
    VERGE_ASSERT(vg_road_holds(draft.road));
    return draft.road;
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
        lane->stop_line =
            def->stop_line_given ? vg_min(def->stop_line, lane->length) : lane->length;
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
