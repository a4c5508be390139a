/// Roads of real size, generated: a town of crossings on a grid, a junction of many lanes.
#ifndef TEST_TOWN_H
#define TEST_TOWN_H

#include "verge/road.h"

#include <math.h>
#include <stdint.h>
#include <string.h>

enum { TOWN_LANES_MAX = 2048, TOWN_POINTS = 12 };

typedef struct town {
    uint32_t       count;
    verge_lane_def lanes[TOWN_LANES_MAX];
    double         points[TOWN_LANES_MAX][TOWN_POINTS][2];
} town;

static inline verge_lane_def* town_lane(town* self)
{
    verge_lane_def* lane = &self->lanes[self->count];
    *lane = (verge_lane_def){ .id = (int32_t)self->count, .width = 3.5, .speed_limit = 13.9,
                              .left = VERGE_NO_LANE, .right = VERGE_NO_LANE,
                              .points = (const double(*)[2])self->points[self->count] };
    ++self->count;
    return lane;
}

static inline void town_point(town* self, verge_lane_def* lane, double x, double y)
{
    double* point = self->points[lane - self->lanes][lane->point_count++];
    point[0] = x;
    point[1] = y;
}

/// From where `from` ends to where `to` begins: straight, or a quarter of a circle.
static inline void town_turn(town* self, uint32_t from, uint32_t to)
{
    if (self->count == 1024) {
        return; // the last crossing has fewer turns
    }
    const verge_lane_def *a = &self->lanes[from], *b = &self->lanes[to];
    const double *p0 = a->points[a->point_count - 1], *q0 = a->points[a->point_count - 2];
    const double *p1 = b->points[0], *q1 = b->points[1];
    const double l0 = hypot(p0[0] - q0[0], p0[1] - q0[1]), l1 = hypot(q1[0] - p1[0], q1[1] - p1[1]);
    const double reach = 0.55 * hypot(p1[0] - p0[0], p1[1] - p0[1]) / 1.41421356;
    const double ux = (p0[0] - q0[0]) / l0 * reach, uy = (p0[1] - q0[1]) / l0 * reach;
    const double vx = (q1[0] - p1[0]) / l1 * reach, vy = (q1[1] - p1[1]) / l1 * reach;
    verge_lane_def* lane = town_lane(self);
    for (int i = 0; i <= 8; ++i) {
        const double t = i / 8.0, r = 1.0 - t;
        town_point(self, lane,
                   r * r * r * p0[0] + 3.0 * r * r * t * (p0[0] + ux)
                       + 3.0 * r * t * t * (p1[0] - vx) + t * t * t * p1[0],
                   r * r * r * p0[1] + 3.0 * r * r * t * (p0[1] + uy)
                       + 3.0 * r * t * t * (p1[1] - vy) + t * t * t * p1[1]);
    }
    self->lanes[from].successors[self->lanes[from].successor_count++] = lane->id;
    lane->successors[lane->successor_count++] = self->lanes[to].id;
}

static const double town_x[4] = { 1.0, 0.0, -1.0, 0.0 }, town_y[4] = { 0.0, 1.0, 0.0, -1.0 };

/// Crossings of two-lane streets on a grid of side * side, `block` metres apart: 12 turns at each
/// one; streets lead out of the town at its edge. side = 8: 1,024 lanes.
static inline void town_grid(town* self, int side, double block)
{
    memset(self, 0, sizeof *self);
    static uint32_t into[64][64][4], out_of[64][64][4]; // lane that arrives from, leaves to a side
    const double arm = 12.0, keep = 1.75;
    for (int row = 0; row < side; ++row) {
        for (int column = 0; column < side; ++column) {
            for (int to = 0; to < 4; ++to) { // a street to each side, and the one back at the edge
                const double x = block * column, y = block * row;
                const int next_x = column + (int)town_x[to], next_y = row + (int)town_y[to];
                const int inside = next_x >= 0 && next_x < side && next_y >= 0 && next_y < side;
                const double ox = keep * town_y[to], oy = -keep * town_x[to];
                const double far = inside ? block - arm : block;
                verge_lane_def* lane = town_lane(self);
                town_point(self, lane, x + arm * town_x[to] + ox, y + arm * town_y[to] + oy);
                town_point(self, lane, x + far * town_x[to] + ox, y + far * town_y[to] + oy);
                out_of[row][column][to] = (uint32_t)lane->id;
                if (inside) {
                    into[next_y][next_x][(to + 2) % 4] = (uint32_t)lane->id;
                    continue;
                }
                lane = town_lane(self);
                town_point(self, lane, x + far * town_x[to] - ox, y + far * town_y[to] - oy);
                town_point(self, lane, x + arm * town_x[to] - ox, y + arm * town_y[to] - oy);
                into[row][column][to] = (uint32_t)lane->id;
            }
        }
    }
    for (int row = 0; row < side; ++row) {
        for (int column = 0; column < side; ++column) {
            for (int from = 0; from < 4; ++from) {
                for (int turn = 1; turn < 4; ++turn) {
                    town_turn(self, into[row][column][from], out_of[row][column][(from + turn) % 4]);
                }
            }
        }
    }
}

/// Four arms of `lanes` lanes to each side: every lane leads straight on, the left ones to every
/// lane on the left, the right ones to every lane on the right.
static inline void town_junction(town* self, int lanes)
{
    memset(self, 0, sizeof *self);
    uint32_t into[4][8], out_of[4][8];
    const double arm = 12.0 + 3.5 * lanes, far = 150.0;
    for (int side = 0; side < 4; ++side) {
        for (int direction = 0; direction < 2; ++direction) {
            for (int k = 0; k < lanes; ++k) { // k = 0 next to the middle of the road
                const double keep = (1.75 + 3.5 * k) * (direction == 0 ? -1.0 : 1.0);
                const double ox = keep * town_y[side], oy = -keep * town_x[side];
                const double from = direction == 0 ? far : arm, to = direction == 0 ? arm : far;
                verge_lane_def* lane = town_lane(self);
                town_point(self, lane, from * town_x[side] + ox, from * town_y[side] + oy);
                town_point(self, lane, to * town_x[side] + ox, to * town_y[side] + oy);
                lane->left = k > 0 ? lane->id - 1 : VERGE_NO_LANE;
                lane->right = k + 1 < lanes ? lane->id + 1 : VERGE_NO_LANE;
                *(direction == 0 ? &into[side][k] : &out_of[side][k]) = (uint32_t)lane->id;
            }
        }
    }
    for (int side = 0; side < 4; ++side) {
        for (int k = 0; k < lanes; ++k) {
            town_turn(self, into[side][k], out_of[(side + 2) % 4][k]);
            for (int to = 0; to < lanes; ++to) {
                if (k == 0 || k == 1) {
                    town_turn(self, into[side][k], out_of[(side + 3) % 4][to]); // left
                }
                if (k + 1 == lanes && to < 2) {
                    town_turn(self, into[side][k], out_of[(side + 1) % 4][to]); // right
                }
            }
        }
    }
}

#endif
