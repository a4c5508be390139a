/// A road that is drawn lane by lane, point by point, and built with the public functions.
#ifndef TEST_DRAWN_H
#define TEST_DRAWN_H

#include "check.h"
#include "verge/road.h"

#include <stdlib.h>
#include <string.h>

enum { DRAWN_LANES = 32, DRAWN_POINTS = 1024 };

/// The road under construction.
static struct {
    verge_lane_def    lanes[DRAWN_LANES];
    double            points[DRAWN_LANES][DRAWN_POINTS][2];
    uint32_t          count;
    void*             memory;
    const verge_road* road;
} c;

static inline verge_lane_def* draw_lane(int32_t id)
{
    assert_true(c.count < DRAWN_LANES);
    verge_lane_def* lane = &c.lanes[c.count];
    *lane = verge_lane_def_default();
    lane->id = id;
    lane->points = (const double(*)[2])c.points[c.count++];
    return lane;
}

/// The next point of the last lane.
static inline void add_point(double x, double y)
{
    verge_lane_def* lane = &c.lanes[c.count - 1];
    assert_true(lane->point_count < DRAWN_POINTS);
    c.points[c.count - 1][lane->point_count][0] = x;
    c.points[c.count - 1][lane->point_count++][1] = y;
}

static inline void leads_to(uint32_t lane, int32_t next)
{
    c.lanes[lane].successors[c.lanes[lane].successor_count++] = next;
}

static inline verge_road_def build(void)
{
    const verge_road_def def = { .lanes = c.lanes, .lane_count = c.count };
    verge_road_fault fault;
    if (verge_road_check(&def, &fault) != VERGE_OK) {
        fail_msg("lane %u, %s: %s", fault.lane_index, fault.field, fault.text);
    }
    const size_t size = (verge_road_memory_size(&def, NULL) + 63) / 64 * 64;
    c.memory = aligned_alloc(64, size);
    assert_int_equal(verge_road_init(&c.road, &def, c.memory, size), VERGE_OK);
    return def;
}

static inline void clear(void)
{
    free(c.memory);
    memset(&c, 0, sizeof c);
}

static inline int clear_after(void** state)
{
    (void)state;
    clear();
    return 0;
}

#endif
