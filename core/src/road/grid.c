/// Which lanes are near a point: a grid of square cells over the road, each with the chunks of
/// lanes that a body in the cell could be on.
#include "road/build.h"

#include "base/contract.h"
#include "base/scalar.h"

#include <stddef.h>

/// A chunk's box, grown by what its lane's half width (10 m at most) and VG_EDGE_REACH add, is
/// never larger than this: then it lies in four cells at most. [m]
static const double cell_min = 64.0;
/// Single precision, and lines that bow out between their knots. [m]
static const double box_slack = 0.3;

static uint32_t chunk_count(const verge_road_def* def);
static uint32_t cell_capacity(uint32_t chunks);
static void box_of(vg_chunk* chunk, const vg_line* line);
static void cells_over(vg_grid* grid);
static void cells_of(const vg_grid* grid, const struct verge_road* road, const vg_chunk* chunk,
                     uint32_t low[2], uint32_t high[2]);

static uint32_t chunks_of(uint32_t knots)
{
    return (knots - 2) / VG_CHUNK_KNOTS + 1;
}

void vg_road_grid_take(vg_grid* grid, vg_arena* arena, const verge_road_def* def)
{
    const uint32_t chunks = chunk_count(def);
    grid->chunk_count = chunks;
    grid->chunks = vg_arena_take(arena, chunks * sizeof *grid->chunks);
    grid->chunk_of = vg_arena_take(arena, (size_t)chunks * 4 * sizeof *grid->chunk_of);
    grid->from = vg_arena_take(arena, (cell_capacity(chunks) + 1) * sizeof *grid->from);
}

void vg_road_grid(vg_road_draft* draft)
{
    struct verge_road* road = draft->road;
    vg_grid* grid = &road->grid;
    uint32_t count = 0;
    for (uint32_t i = 0; i < road->lane_count; ++i) {
        const vg_line* line = &road->lanes[i].line;
        for (uint32_t k = 0; k < chunks_of(line->knot_count); ++k) {
            vg_chunk* chunk = &grid->chunks[count++];
            *chunk = (vg_chunk){ .lane = (uint16_t)i, .index = (uint16_t)k };
            box_of(chunk, line);
        }
    }
    VERGE_ASSERT(count == grid->chunk_count);
    cells_over(grid);
    uint32_t* from = grid->from; // [cell + 1]: count, then end, then begin of the cell's part
    for (uint32_t pass = 0; pass < 2; ++pass) {
        for (uint32_t c = count; c-- > 0;) {
            uint32_t low[2], high[2];
            cells_of(grid, road, &grid->chunks[c], low, high);
            for (uint32_t row = low[1]; row <= high[1]; ++row) {
                for (uint32_t column = low[0]; column <= high[0]; ++column) {
                    uint32_t* part = &from[row * grid->columns + column + 1];
                    if (pass == 0) {
                        ++*part;
                    } else {
                        grid->chunk_of[--*part] = c;
                    }
                }
            }
        }
        for (uint32_t k = 0; pass == 0 && k < grid->columns * grid->rows; ++k) {
            from[k + 1] += from[k];
            VERGE_ASSERT(from[k + 1] <= 4 * count);
        }
        if (pass == 0) {
            grid->total = from[grid->columns * grid->rows];
        }
    }
    for (uint32_t k = 0; k < grid->columns * grid->rows; ++k) {
        from[k] = from[k + 1];
    }
    from[grid->columns * grid->rows] = grid->total;
}

static uint32_t chunk_count(const verge_road_def* def)
{
    uint32_t count = 0;
    for (uint32_t i = 0; i < def->lane_count; ++i) {
        count += chunks_of(vg_lane_knot_count(&def->lanes[i]));
    }
    return count;
}

static uint32_t cell_capacity(uint32_t chunks)
{
    return 2 * chunks + 16;
}

static void box_of(vg_chunk* chunk, const vg_line* line)
{
    const uint32_t first = chunk->index * (uint32_t)VG_CHUNK_KNOTS;
    const uint32_t after = first + VG_CHUNK_KNOTS;
    const uint32_t last = after < line->knot_count ? after : line->knot_count - 1;
    double low[2] = { VG_HUGE, VG_HUGE }, high[2] = { -VG_HUGE, -VG_HUGE };
    for (uint32_t i = first; i <= last; ++i) {
        const double at[2] = { line->x[i], line->y[i] };
        for (int axis = 0; axis < 2; ++axis) {
            low[axis] = vg_min(low[axis], at[axis]);
            high[axis] = vg_max(high[axis], at[axis]);
        }
    }
    const double slack =
        box_slack + 1e-7 * vg_max(vg_max(high[0], high[1]), -vg_min(low[0], low[1]));
    chunk->x0 = (float)(low[0] - slack);
    chunk->y0 = (float)(low[1] - slack);
    chunk->x1 = (float)(high[0] + slack);
    chunk->y1 = (float)(high[1] + slack);
}

/// Lays the cells over all chunks: as small as their number allows.
static void cells_over(vg_grid* grid)
{
    double low[2] = { VG_HUGE, VG_HUGE }, high[2] = { -VG_HUGE, -VG_HUGE };
    for (uint32_t c = 0; c < grid->chunk_count; ++c) {
        const vg_chunk* chunk = &grid->chunks[c];
        low[0] = vg_min(low[0], (double)chunk->x0);
        low[1] = vg_min(low[1], (double)chunk->y0);
        high[0] = vg_max(high[0], (double)chunk->x1);
        high[1] = vg_max(high[1], (double)chunk->y1);
    }
    const double reach = 10.0 + VG_EDGE_REACH;
    grid->x = low[0] - reach;
    grid->y = low[1] - reach;
    const double width = high[0] - low[0] + 2.0 * reach, height = high[1] - low[1] + 2.0 * reach;
    const double most = (double)cell_capacity(grid->chunk_count);
    double cell = cell_min;
    while ((width / cell + 1.0) * (height / cell + 1.0) > most) {
        cell *= 1.25;
    }
    grid->cell = cell;
    grid->columns = (uint32_t)(width / cell) + 1;
    grid->rows = (uint32_t)(height / cell) + 1;
}

static uint32_t cell_at(double distance, double cell, uint32_t count)
{
    const uint32_t index = (uint32_t)vg_max(distance / cell, 0.0);
    return index < count ? index : count - 1;
}

static void cells_of(const vg_grid* grid, const struct verge_road* road, const vg_chunk* chunk,
                     uint32_t low[2], uint32_t high[2])
{
    const double reach = 0.5 * road->lanes[chunk->lane].width + VG_EDGE_REACH;
    low[0] = cell_at((double)chunk->x0 - reach - grid->x, grid->cell, grid->columns);
    low[1] = cell_at((double)chunk->y0 - reach - grid->y, grid->cell, grid->rows);
    high[0] = cell_at((double)chunk->x1 + reach - grid->x, grid->cell, grid->columns);
    high[1] = cell_at((double)chunk->y1 + reach - grid->y, grid->cell, grid->rows);
}

vg_nearby vg_road_nearby(const struct verge_road* road, double x, double y)
{
    const vg_grid* grid = &road->grid;
    vg_nearby nearby = { .road = road, .x = x, .y = y, .lane = -1 };
    const double column = (x - grid->x) / grid->cell, row = (y - grid->y) / grid->cell;
    if (column >= 0.0 && column < (double)grid->columns && row >= 0.0 && row < (double)grid->rows) {
        const uint32_t cell = (uint32_t)row * grid->columns + (uint32_t)column;
        nearby.at = grid->from[cell];
        nearby.end = grid->from[cell + 1];
    }
    return nearby;
}

int32_t vg_nearby_next(vg_nearby* nearby)
{
    const struct verge_road* road = nearby->road;
    while (nearby->at < nearby->end) {
        const vg_chunk* chunk = &road->grid.chunks[road->grid.chunk_of[nearby->at++]];
        const vg_lane* lane = &road->lanes[chunk->lane];
        const double reach = 0.5 * lane->width + VG_EDGE_REACH;
        const bool inside = nearby->x >= (double)chunk->x0 - reach
                            && nearby->x <= (double)chunk->x1 + reach
                            && nearby->y >= (double)chunk->y0 - reach
                            && nearby->y <= (double)chunk->y1 + reach;
        if (inside && (int32_t)chunk->lane != nearby->lane) {
            nearby->lane = chunk->lane;
            nearby->s = lane->line.knot_spacing * (double)(chunk->index * (uint32_t)VG_CHUNK_KNOTS);
            return nearby->lane;
        }
    }
    return -1;
}
