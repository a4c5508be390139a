// Who passes a conflict area first, on roads with crossings, merges, rings and lane ends. The
// vehicles are driven by a plain driver that keeps to the walls of the order and to the vehicle
// ahead, so what is tested is the order and not the search.
#include "check.h"
#include "rng.h"

#include "traffic/order.h"
#include "traffic/pairs.h"
#include "traffic/traffic.h"
#include "verge/planner.h"

#include <math.h>
#include <stdlib.h>

#define LIMIT 10.0  // [m/s]
#define WIDTH 3.5   // [m]
#define CYCLE 0.5   // [s]
enum { LANES_MAX = 64, POINTS = 25, MEMORY = 8 << 20 };

typedef struct world {
    verge_planner_def def;
    verge_lane_def lanes[LANES_MAX];
    double points[LANES_MAX][POINTS][2];
    void *memory, *stage;
    const verge_road* road;
    uint32_t count;
    uint64_t steady; // vehicles (bits) that keep their speed, whatever is ahead
    verge_vehicle vehicles[VERGE_VEHICLES_MAX];
    verge_lane_position positions[VERGE_VEHICLES_MAX];
    verge_scene scene;
    vg_pairs* pairs;
    vg_order* order;
    verge_turns turns;
    verge_beliefs beliefs;
    vg_model model;
    vg_flow flow;
} world;

static world* world_open(void)
{
    world* w = calloc(1, sizeof *w);
    assert_non_null(w);
    w->def = verge_planner_default_def();
    w->def.road.lanes = w->lanes;
    return w;
}

static verge_lane_def* add_lane(world* w, int32_t id, int32_t to)
{
    const uint32_t i = w->def.road.lane_count++;
    assert_true(i < LANES_MAX);
    w->lanes[i] = verge_lane_def_default();
    w->lanes[i].id = id;
    w->lanes[i].width = WIDTH;
    w->lanes[i].speed_limit = LIMIT;
    w->lanes[i].points = (const double (*)[2])w->points[i];
    if (to >= 0) {
        w->lanes[i].successors[w->lanes[i].successor_count++] = to;
    }
    return &w->lanes[i];
}

static verge_lane_def* add_straight(world* w, int32_t id, double x0, double y0, double x1,
                                    double y1, int32_t to)
{
    verge_lane_def* lane = add_lane(w, id, to);
    double(*points)[2] = w->points[w->def.road.lane_count - 1u];
    lane->point_count = POINTS;
    for (uint32_t k = 0; k < POINTS; ++k) {
        const double t = (double)k / (POINTS - 1);
        points[k][0] = x0 + t * (x1 - x0);
        points[k][1] = y0 + t * (y1 - y0);
    }
    return lane;
}

// A cubic from one pose to another.
static void add_curve(world* w, int32_t id, const double from[3], const double to[3], int32_t next)
{
    verge_lane_def* lane = add_lane(w, id, next);
    double(*points)[2] = w->points[w->def.road.lane_count - 1u];
    const double reach = 0.4 * hypot(to[0] - from[0], to[1] - from[1]);
    lane->point_count = POINTS;
    for (uint32_t k = 0; k < POINTS; ++k) {
        const double t = (double)k / (POINTS - 1), u = 1.0 - t;
        const double b[4] = { u * u * u, 3 * u * u * t, 3 * u * t * t, t * t * t };
        points[k][0] = b[0] * from[0] + b[1] * (from[0] + reach * cos(from[2]))
                       + b[2] * (to[0] - reach * cos(to[2])) + b[3] * to[0];
        points[k][1] = b[0] * from[1] + b[1] * (from[1] + reach * sin(from[2]))
                       + b[2] * (to[1] - reach * sin(to[2])) + b[3] * to[1];
    }
}

static void world_build(world* w)
{
    w->memory = aligned_alloc(64, MEMORY);
    w->stage = aligned_alloc(64, MEMORY);
    assert_non_null(w->memory);
    assert_non_null(w->stage);
    assert_int_equal(verge_road_init(&w->road, &w->def.road, w->memory, MEMORY), VERGE_OK);
    vg_arena arena;
    vg_arena_init(&arena, w->stage, MEMORY);
    const vg_traffic traffic = vg_traffic_take(&arena, &w->def);
    w->pairs = traffic.pairs;
    w->order = traffic.order;
    assert_non_null(w->pairs);
    assert_non_null(w->order);
    w->scene = verge_scene_make(w->road, w->vehicles, w->positions, VERGE_VEHICLES_MAX);
    w->scene.utime = 1000000;
}

static void world_close(world* w)
{
    free(w->memory);
    free(w->stage);
    free(w);
}

static void place(world* w, uint32_t i)
{
    verge_vehicle* v = &w->vehicles[i];
    verge_lane_position* at = &w->positions[i];
    assert_true(verge_road_at(w->road, at->lane_id, at->s, at->d, &v->x, &v->y, &v->heading));
    at->heading = v->heading;
}

static verge_vehicle* add(world* w, bool controlled, int32_t lane, double s, double speed,
                          int32_t target)
{
    const uint32_t i = w->count++;
    assert_true(i < VERGE_VEHICLES_MAX);
    verge_vehicle* v = &w->vehicles[i];
    *v = verge_vehicle_default();
    v->id = i == 0 ? 1 : v[-1].id + 1;
    v->controlled = controlled;
    v->length = 4.5;
    v->width = 1.7;
    v->speed = speed;
    v->target_lane = target;
    w->positions[i] = (verge_lane_position){ .lane_id = lane, .s = s, .contained = true };
    place(w, i);
    return v;
}

static void look(world* w)
{
    w->scene.vehicle_count = w->count;
    vg_model_from(&w->model, &w->flow, &w->def, w->pairs, &w->scene,
                  vg_scene_controlled(&w->scene));
    if (!w->model.single_axis) {
        vg_pairs_update(&w->model, &w->flow);
    }
    vg_order_from(w->order, &w->model, &w->flow, &w->scene, &w->turns, &w->beliefs);
}

// Speed from which a stop, or a stop behind a braking vehicle, is possible within a distance.
static double safe(double gap, double ahead)
{
    const double b = 2.0, c = b * CYCLE;
    const double square = c * c + ahead * ahead + 2.0 * b * gap;
    return square > c * c ? sqrt(square) - c : 0.0;
}

static double speed_of(const world* w, uint32_t slot)
{
    const vg_model* m = &w->model;
    const vg_flow* f = &w->flow;
    const double half = (double)m->half_length[slot], v = (double)f->v[slot];
    const vg_neighbours near =
        vg_nearest(m, f, slot, f->station[slot], f->y[slot], f->station, f->v, VG_FAR_AWAY);
    const double wall = (double)vg_order_wall(m, f, slot) - half;
    // The one ahead may brake twice as hard.
    const double behind = safe((double)near.gap_ahead - half - 2.0, 0.7 * (double)near.v_ahead);
    const double wanted = fmin(v + 1.5 * CYCLE, (double)f->limit[slot]);
    return fmax(fmax(fmin(fmin(wanted, behind), safe(wall, 0.0)), 0.0), v - 8.0 * CYCLE);
}

// Moves everybody by a cycle. Returns the vehicles (bits) that have left the road.
static void drive(world* w, uint64_t held)
{
    double speed[VERGE_VEHICLES_MAX];
    look(w);
    for (uint32_t slot = 0; slot < w->model.count; ++slot) {
        const uint32_t i = w->model.input_index[slot];
        speed[i] = (held >> i & 1u) != 0        ? 0.0
                   : (w->steady >> i & 1u) != 0 ? w->vehicles[i].speed
                                                : speed_of(w, slot);
    }
    uint32_t kept = 0;
    for (uint32_t i = 0; i < w->count; ++i) {
        verge_vehicle* v = &w->vehicles[i];
        verge_lane_position* at = &w->positions[i];
        at->s += 0.5 * (v->speed + speed[i]) * CYCLE;
        v->acceleration = (speed[i] - v->speed) / CYCLE;
        v->speed = speed[i];
        const double length = verge_road_length(w->road, at->lane_id);
        const int32_t next =
            verge_road_next(w->road, at->lane_id, v->controlled ? v->target_lane : VERGE_NO_LANE);
        if (at->s > length && next == VERGE_NO_LANE) {
            continue; // it leaves
        }
        if (at->s > length) {
            at->s -= length;
            at->lane_id = next;
        }
        w->vehicles[kept] = *v;
        w->positions[kept] = *at;
        place(w, kept++);
    }
    w->count = kept;
    w->scene.utime += (int64_t)(CYCLE * 1e6);
}

// For a failure: where everybody is and what everybody waits for.
static void show(const world* w)
{
    for (uint32_t slot = 0; slot < w->model.count; ++slot) {
        const uint32_t i = w->model.input_index[slot];
        const vg_wall wall = vg_order_wall_why(&w->model, &w->flow, slot);
        printf("  vehicle %d lane %d s %.1f v %.1f rank %u wall %.1f (%s, %d)\n", w->vehicles[i].id,
               w->positions[i].lane_id, w->positions[i].s, w->vehicles[i].speed,
               w->order->rank[slot],
               (double)(wall.distance - w->model.half_length[slot]), verge_why_text(wall.why),
               wall.slot < 0 ? -1 : w->vehicles[w->model.input_index[wall.slot]].id);
    }
}

static uint32_t overlaps(const world* w)
{
    uint32_t found = 0;
    for (uint32_t i = 0; i < w->count; ++i) {
        for (uint32_t j = 0; j < i; ++j) {
            if (verge_vehicles_overlap(&w->vehicles[i], &w->vehicles[j])) {
                printf("  vehicles %d and %d touch\n", w->vehicles[i].id, w->vehicles[j].id);
                ++found;
            }
        }
    }
    return found;
}

// Removes the vehicles before which nobody goes, again and again: none is left unless there is a
// circle.
static bool has_circle(const world* w)
{
    uint64_t left = w->model.count == 64 ? ~(uint64_t)0 : ((uint64_t)1 << w->model.count) - 1u;
    for (bool more = true; more && left != 0;) {
        more = false;
        for (uint32_t slot = 0; slot < w->model.count; ++slot) {
            if ((left >> slot & 1u) != 0 && (w->order->before[slot] & left) == 0) {
                left &= ~((uint64_t)1 << slot);
                more = true;
            }
        }
    }
    return left != 0;
}

// ---------------------------------------------------------------------------- roads

// Four arms, of the given priorities in turn: lanes k come in, 100 + k go out, 10 + 4 k + j lead
// from arm k to arm j.
static world* crossing_of(double box, const verge_priority priorities[2])
{
    world* w = world_open();
    for (int32_t k = 0; k < 4; ++k) {
        const double a = 1.57079632679 * k, c = cos(a), s = sin(a), far = 120.0;
        const double in[2] = { -0.5 * WIDTH * s, 0.5 * WIDTH * c }; // right of the way in
        verge_lane_def* lane = add_straight(w, k, far * c + in[0], far * s + in[1],
                                            box * c + in[0], box * s + in[1], -1);
        lane->priority = priorities[k % 2];
        add_straight(w, 100 + k, box * c - in[0], box * s - in[1], far * c - in[0],
                     far * s - in[1], -1);
        for (int32_t j = 0; j < 4; ++j) {
            if (j != k) {
                lane->successors[lane->successor_count++] = 10 + 4 * k + j;
            }
        }
    }
    for (int32_t k = 0; k < 16; ++k) {
        const int32_t from = k / 4, to = k % 4;
        if (from != to) {
            const double a = 1.57079632679 * from, b = 1.57079632679 * to, h = 0.5 * WIDTH;
            const double begin[3] = { box * cos(a) - h * sin(a), box * sin(a) + h * cos(a),
                                      a + 3.14159265359 };
            const double end[3] = { box * cos(b) + h * sin(b), box * sin(b) - h * cos(b), b };
            add_curve(w, 10 + k, begin, end, 100 + to);
        }
    }
    world_build(w);
    return w;
}

static world* crossing(double box)
{
    static const verge_priority none[2] = { VERGE_PRIORITY_NONE, VERGE_PRIORITY_NONE };
    return crossing_of(box, none);
}

// A ring with four arms: 1 + k come in, 11 + k lead onto the ring, 21 + k from entry k to exit k + 1,
// 31 + k past arm k, 41 + k off the ring, 51 + k go out.
static world* roundabout(double radius)
{
    world* w = world_open();
    const double pi = 3.14159265359, part = 0.5, mouth = radius + 16.0, h = 0.5 * WIDTH;
    for (int32_t k = 0; k < 4; ++k) {
        const double a = 0.5 * pi * k, c = cos(a), s = sin(a), on = a + part, off = a - part;
        const double in[3] = { mouth * c - h * s, mouth * s + h * c, a + pi };
        const double out[3] = { mouth * c + h * s, mouth * s - h * c, a };
        const double join[3] = { radius * cos(on), radius * sin(on), on + 0.5 * pi };
        const double leave[3] = { radius * cos(off), radius * sin(off), off + 0.5 * pi };
        const double b = a + 0.5 * pi - part;
        const double next[3] = { radius * cos(b), radius * sin(b), b + 0.5 * pi };
        add_straight(w, 1 + k, in[0] + 90.0 * c, in[1] + 90.0 * s, in[0], in[1], 11 + k);
        add_curve(w, 11 + k, in, join, 21 + k);
        add_curve(w, 21 + k, join, next, 31 + (k + 1) % 4);
        verge_lane_def* parts = &w->lanes[w->def.road.lane_count - 1u];
        parts->successors[parts->successor_count++] = 41 + (k + 1) % 4;
        add_curve(w, 31 + k, leave, join, 21 + k);
        add_curve(w, 41 + k, leave, out, 51 + k);
        add_straight(w, 51 + k, out[0], out[1], out[0] + 120.0 * c, out[1] + 120.0 * s, -1);
    }
    world_build(w);
    return w;
}

// A street (0, 1, 2) that another one (3) crosses in its lane 1. 1 is 20 m long.
static world* street(void)
{
    world* w = world_open();
    add_straight(w, 0, -150.0, 0.0, -10.0, 0.0, 1);
    add_straight(w, 1, -10.0, 0.0, 10.0, 0.0, 2);
    add_straight(w, 2, 10.0, 0.0, 200.0, 0.0, -1);
    add_straight(w, 3, 0.0, -150.0, 0.0, 150.0, -1);
    world_build(w);
    return w;
}

// ---------------------------------------------------------------------------- claims

static void all_vehicles_pass_a_crossing_one_after_the_other(void** state)
{
    (void)state;
    test_rng rng = test_rng_seeded("crossing");
    for (uint32_t round = 0; round < test_rounds(60); ++round) {
        world* w = crossing(test_rng_between(&rng, 8.5, 14.0));
        const uint32_t count = 4 + test_rng_below(&rng, 13);
        double left[4];
        for (uint32_t k = 0; k < 4; ++k) {
            left[k] = test_rng_between(&rng, 3.0, 30.0);
        }
        for (uint32_t i = 0; i < count; ++i) {
            const uint32_t arm = i % 4;
            const int32_t to = (int32_t)(arm + 1u + test_rng_below(&rng, 3)) % 4;
            const double length = verge_road_length(w->road, (int32_t)arm);
            const double speed = fmin(test_rng_between(&rng, 3.0, 9.0), sqrt(4.0 * left[arm]));
            add(w, true, (int32_t)arm, length - left[arm] - 2.5, speed, 100 + to);
            left[arm] += test_rng_between(&rng, 10.0, 16.0);
        }
        uint32_t cycles = 0;
        for (; w->count > 0 && cycles < 400; ++cycles) {
            drive(w, 0);
            assert_false(has_circle(w));
            if (overlaps(w) > 0) {
                show(w);
                fail_msg("round %u: contact after %.1f s", round, CYCLE * cycles);
            }
        }
        if (w->count > 0) {
            look(w);
            show(w);
            fail_msg("round %u: %u of %u vehicles did not arrive", round, w->count, count);
        }
        world_close(w);
    }
}

static void rings_keep_a_hole_and_everybody_gets_off(void** state)
{
    (void)state;
    test_rng rng = test_rng_seeded("roundabout");
    for (uint32_t round = 0; round < test_rounds(30); ++round) {
        world* w = roundabout(test_rng_between(&rng, 18.0, 24.0));
        const uint32_t count = 8 + test_rng_below(&rng, 9);
        double left[4] = { 4.0, 6.0, 8.0, 5.0 };
        for (uint32_t i = 0; i < count; ++i) {
            const uint32_t arm = i % 4;
            const int32_t to = (int32_t)(arm + 1u + test_rng_below(&rng, 3)) % 4;
            const double length = verge_road_length(w->road, 1 + (int32_t)arm);
            add(w, true, 1 + (int32_t)arm, length - left[arm] - 2.5, 4.0, 51 + to);
            left[arm] += test_rng_between(&rng, 12.0, 16.0);
        }
        uint32_t cycles = 0;
        for (; w->count > 0 && cycles < 600; ++cycles) {
            drive(w, 0);
            assert_false(has_circle(w));
        }
        if (w->count > 0) {
            look(w);
            show(w);
            fail_msg("round %u: %u of %u vehicles did not arrive", round, w->count, count);
        }
        world_close(w);
    }
}

// A queue stands behind the crossing, with room for some vehicles. The rest wait before it, also
// where nobody crosses.
static void nobody_stands_on_a_crossing_that_has_no_room_behind_it(void** state)
{
    (void)state;
    test_rng rng = test_rng_seeded("spillback");
    for (uint32_t round = 0; round < test_rounds(60); ++round) {
        world* w = street();
        const double room = test_rng_between(&rng, 3.0, 30.0); // behind the area
        const verge_lane_position area = verge_road_project_on(w->road, 1, 0.0, 0.0);
        const bool crossed = test_rng_below(&rng, 2) == 0;
        add(w, true, 2, room, 0.0, VERGE_NO_LANE); // held
        for (uint32_t k = 0; k < 6; ++k) {
            add(w, true, 0, 120.0 - 14.0 * k, test_rng_between(&rng, 2.0, 9.0), VERGE_NO_LANE);
        }
        if (crossed) {
            add(w, true, 3, test_rng_between(&rng, 20.0, 120.0), 8.0, VERGE_NO_LANE);
        }
        uint32_t waiting = 0;
        for (uint32_t cycles = 0; cycles < 120; ++cycles) {
            drive(w, 1);
        }
        for (uint32_t i = 0; i < w->count; ++i) {
            const bool inside = w->positions[i].lane_id == 1
                                && fabs(w->positions[i].s - area.s) < 0.5 * (w->vehicles[i].length + WIDTH);
            if (inside) {
                look(w);
                show(w);
                fail_msg("round %u: room %.1f m, vehicle %d stands in the area", round, room,
                         w->vehicles[i].id);
            }
            waiting += w->positions[i].lane_id != 2;
        }
        assert_true(waiting >= 2);
        look(w);
        assert_int_equal(overlaps(w), 0);
        for (uint32_t cycles = 0; cycles < 200; ++cycles) { // the queue moves on
            drive(w, 0);
        }
        assert_int_equal(w->count, 0);
        world_close(w);
    }
}

// The crossing point lies a few metres behind a lane boundary, within one decision step of both.
static void an_area_behind_a_lane_boundary_has_an_order_too(void** state)
{
    (void)state;
    for (double before = 0.5; before < 12.0; before += 0.5) {
        world* w = world_open();
        add_straight(w, 0, -80.0, 0.0, -before, 0.0, 1);
        add_straight(w, 1, -before, 0.0, 60.0, 0.0, -1);
        add_straight(w, 2, 0.0, -80.0, 0.0, -before, 3);
        add_straight(w, 3, 0.0, -before, 0.0, 60.0, -1);
        world_build(w);
        add(w, true, 0, 80.0 - 20.0, 9.0, VERGE_NO_LANE);
        add(w, true, 2, 80.0 - 20.0, 9.0, VERGE_NO_LANE);
        for (uint32_t cycles = 0; w->count > 0 && cycles < 60; ++cycles) {
            drive(w, 0);
            assert_true((w->order->before[0] | w->order->before[1]) != 3);
            assert_int_equal(overlaps(w), 0);
        }
        assert_int_equal(w->count, 0);
        world_close(w);
    }
}

// Two full lanes, one of which ends: the sequence takes one of each in turn, and has no circle.
static void the_end_of_a_lane_takes_one_of_each_lane_in_turn(void** state)
{
    (void)state;
    test_rng rng = test_rng_seeded("zipper");
    for (uint32_t round = 0; round < test_rounds(60); ++round) {
        world* w = world_open();
        add_straight(w, 0, 0.0, 0.0, 150.0, 0.0, -1)->left = 1;
        add_straight(w, 1, 0.0, WIDTH, 400.0, WIDTH, -1)->right = 0;
        world_build(w);
        const double speed = test_rng_between(&rng, 0.0, 6.0), phase = test_rng_between(&rng, 1.0, 6.0);
        for (uint32_t k = 0; k < 10; ++k) {
            add(w, true, (int32_t)(k % 2), 140.0 - 8.0 * (k / 2) - (k % 2 == 1 ? phase : 0.0), speed, 1);
        }
        look(w);
        assert_false(has_circle(w));
        int32_t lane_of[10];
        for (uint32_t slot = 0; slot < 10; ++slot) {
            lane_of[w->order->rank[slot]] = w->positions[w->model.input_index[slot]].lane_id;
        }
        for (uint32_t k = 1; k < 10; ++k) {
            assert_int_not_equal(lane_of[k], lane_of[k - 1]);
        }
        world_close(w);
    }
}

// Who has passed the line of an arm with a stop sign without a stop at it; notes who has stopped.
static int32_t passed_without_stop(const world* w, uint64_t* stopped)
{
    for (uint32_t i = 0; i < w->count; ++i) {
        const verge_lane_position* at = &w->positions[i];
        const verge_vehicle* v = &w->vehicles[i];
        const bool sign = verge_road_priority(w->road, at->lane_id) == VERGE_PRIORITY_STOP;
        const double left = verge_road_length(w->road, at->lane_id) - at->s - 0.5 * v->length;
        if (sign && v->speed < 0.3 && left < 4.5) {
            *stopped |= (uint64_t)1 << v->id;
        }
        if (sign && left < -0.5 && (*stopped >> v->id & 1u) == 0) {
            return v->id;
        }
    }
    return -1;
}

// Some of them are planned, some not. Each arm, or every second one, has a stop sign.
static void everybody_stops_at_a_stop_sign_and_all_get_through(void** state)
{
    (void)state;
    test_rng rng = test_rng_seeded("stop");
    for (uint32_t round = 0; round < test_rounds(60); ++round) {
        const verge_priority rules[2][2] = { { VERGE_PRIORITY_STOP, VERGE_PRIORITY_STOP },
                                             { VERGE_PRIORITY_MAJOR, VERGE_PRIORITY_STOP } };
        world* w = crossing_of(test_rng_between(&rng, 8.5, 14.0), rules[round % 2]);
        const uint32_t count = 1 + test_rng_below(&rng, 8);
        double left[4] = { 15.0, 25.0, 20.0, 18.0 };
        for (uint32_t i = 0; i < count; ++i) {
            const uint32_t arm = i % 4;
            const int32_t to = (int32_t)(arm + 1u + test_rng_below(&rng, 3)) % 4;
            const double length = verge_road_length(w->road, (int32_t)arm);
            add(w, test_rng_below(&rng, 2) == 0, (int32_t)arm, length - left[arm] - 2.5,
                test_rng_between(&rng, 3.0, 8.0), 100 + to);
            left[arm] += test_rng_between(&rng, 12.0, 20.0);
        }
        uint64_t stopped = 0;
        for (uint32_t cycles = 0; w->count > 0 && cycles < 240; ++cycles) {
            drive(w, 0);
            const int32_t passed = passed_without_stop(w, &stopped);
            if (passed >= 0 || overlaps(w) > 0) {
                show(w);
                fail_msg("round %u: vehicle %d did not stop, or contact", round, passed);
            }
        }
        if (w->count > 0) {
            look(w);
            show(w);
            fail_msg("round %u: %u of %u vehicles did not arrive", round, w->count, count);
        }
        world_close(w);
    }
}

static void who_stops_first_at_a_crossing_of_stop_signs_goes_first(void** state)
{
    (void)state;
    static const verge_priority all[2] = { VERGE_PRIORITY_STOP, VERGE_PRIORITY_STOP };
    test_rng rng = test_rng_seeded("all-way");
    for (uint32_t round = 0; round < test_rounds(40); ++round) {
        world* w = crossing_of(10.0, all);
        const int32_t first = (int32_t)test_rng_below(&rng, 4);
        const int32_t second = (first + 1 + 2 * (int32_t)test_rng_below(&rng, 2)) % 4;
        const double left = test_rng_between(&rng, 8.0, 30.0);
        const double later = left + test_rng_between(&rng, 15.0, 30.0);
        const double length = verge_road_length(w->road, first);
        add(w, test_rng_below(&rng, 2) == 0, second, length - later - 2.5, 6.0,
            100 + (second + 2) % 4);
        add(w, test_rng_below(&rng, 2) == 0, first, length - left - 2.5, 6.0,
            100 + (first + 2) % 4);
        bool gone = false;
        for (uint32_t cycles = 0; !gone && cycles < 80; ++cycles) {
            drive(w, 0);
            assert_int_equal(w->positions[0].lane_id, second); // added first
            gone = w->positions[1].lane_id != first;
        }
        assert_true(gone);
        world_close(w);
    }
}

// A planned vehicle has waited for long before a major street. Its drivers come one after the other,
// in the order that they see.
static void who_has_priority_does_not_brake_for_who_waits(void** state)
{
    (void)state;
    test_rng rng = test_rng_seeded("cedes");
    for (uint32_t round = 0; round < test_rounds(40); ++round) {
        world* w = world_open();
        add_straight(w, 0, -100.0, 0.0, 100.0, 0.0, -1)->priority =
            round % 2 == 0 ? VERGE_PRIORITY_MINOR : VERGE_PRIORITY_STOP;
        add_straight(w, 1, 0.0, -150.0, 0.0, 100.0, -1)->priority = VERGE_PRIORITY_MAJOR;
        world_build(w);
        w->order->of_humans = true;
        add(w, true, 0, 100.0 - 8.0, 0.0, VERGE_NO_LANE);
        const double speed = test_rng_between(&rng, 7.0, LIMIT);
        double left = test_rng_between(&rng, 30.0, 38.0);
        for (uint32_t k = 0; k < 3; ++k) {
            add(w, false, 1, 150.0 - left, speed, VERGE_NO_LANE);
            left += test_rng_between(&rng, 2.5, 3.2) * speed;
        }
        w->turns.count = 1;
        w->turns.of[0] = (verge_turn){ .vehicle_id = w->vehicles[0].id };
        w->turns.of[0].arrival = w->scene.utime - 20000000; // it has waited for 20 s
        for (uint32_t cycle = 0; cycle < 20 && w->count == 4; ++cycle) {
            drive(w, 1);
            for (uint32_t i = 1; i < w->count; ++i) {
                if (w->vehicles[i].speed < speed - 0.2) {
                    show(w);
                    fail_msg("round %u: vehicle %d brakes", round, w->vehicles[i].id);
                }
            }
        }
        world_close(w);
    }
}

// What a lane's signal shows is a wall a metre before its line; without it there is none.
static void a_red_signal_is_a_wall_and_a_green_one_is_not(void** state)
{
    (void)state;
    world* w = street();
    verge_signal signal = { 0, VERGE_SIGNAL_RED, -1.0 };
    w->scene.signals = &signal;
    w->scene.signal_count = 1;
    add(w, true, 0, 100.0, 8.0, VERGE_NO_LANE);
    look(w);
    const double length = verge_road_length(w->road, 0);
    CHECK_NEAR(vg_order_wall(&w->model, &w->flow, 0), length - 101.0, 0.1);
    assert_int_equal(vg_order_wall_why(&w->model, &w->flow, 0).why, VERGE_WHY_SIGNAL);
    signal.state = VERGE_SIGNAL_GREEN;
    look(w);
    assert_true(vg_order_wall(&w->model, &w->flow, 0) >= VG_FAR_AWAY);
    world_close(w);
}

// The major street is left to a vehicle that comes later than the one on the minor street.
static void priority_goes_before_arrival(void** state)
{
    (void)state;
    for (uint32_t minor = 0; minor < 2; ++minor) {
        world* w = world_open();
        verge_lane_def* one = add_straight(w, 0, -100.0, 0.0, 100.0, 0.0, -1);
        one->priority = minor == 0 ? VERGE_PRIORITY_MINOR : VERGE_PRIORITY_MAJOR;
        verge_lane_def* other = add_straight(w, 1, 0.0, -100.0, 0.0, 100.0, -1);
        other->priority = minor == 1 ? VERGE_PRIORITY_MINOR : VERGE_PRIORITY_MAJOR;
        world_build(w);
        add(w, true, 0, 60.0, 8.0, VERGE_NO_LANE);
        add(w, true, 1, 55.0, 8.0, VERGE_NO_LANE); // half a second later
        look(w);
        assert_int_equal(w->order->rank[minor], 1);
        world_close(w);
    }
}

// A major street (0) and a minor one (1) that cross; or, at equal rank, a red signal for lane 1.
static world* ruled_crossing(bool red, verge_signal* signal)
{
    world* w = world_open();
    verge_lane_def* major = add_straight(w, 0, -120.0, 0.0, 120.0, 0.0, -1);
    verge_lane_def* minor = add_straight(w, 1, 0.0, -120.0, 0.0, 120.0, -1);
    *signal = (verge_signal){ 1, VERGE_SIGNAL_RED, -1.0 };
    if (red) {
        minor->stop_line_given = true;
        minor->stop_line = 114.0;
    } else {
        major->priority = VERGE_PRIORITY_MAJOR;
        minor->priority = VERGE_PRIORITY_MINOR;
    }
    world_build(w);
    if (red) {
        w->scene.signals = signal;
        w->scene.signal_count = 1;
    }
    return w;
}

// One that is far away, or brakes for the line, is expected to wait; one that is near and goes on
// as before is not.
static void a_driver_who_has_to_wait_and_does_not_brake_is_let_go(void** state)
{
    (void)state;
    for (uint32_t red = 0; red < 2; ++red) {
        verge_signal signal;
        world* w = ruled_crossing(red != 0, &signal);
        add(w, true, 0, 88.0, 10.0, VERGE_NO_LANE);
        add(w, false, 1, 86.0, 10.0, VERGE_NO_LANE);
        look(w);
        assert_int_equal(w->order->rank[0], 1);
        w->vehicles[1].acceleration = -2.0;
        look(w);
        assert_int_equal(w->order->rank[0], 0);
        w->vehicles[1].acceleration = 0.0;
        w->positions[1].s = 70.0; // it would have 40 m to stop in
        w->positions[0].s = 70.0; // and the planned one can still stop as well
        w->turns.count = 0;
        look(w);
        assert_int_equal(w->order->rank[0], 0);
        world_close(w);
    }
}

/// The planned vehicle relies on the other one while it can itself still stop gently. From then on
/// the other one has to brake, and is let go until it does.
static void nobody_is_relied_on_beyond_the_point_of_no_return_without_a_sign(void** state)
{
    (void)state;
    verge_signal signal;
    world* w = ruled_crossing(false, &signal);
    add(w, true, 0, 70.0, 10.0, VERGE_NO_LANE);
    add(w, false, 1, 66.0, 10.0, VERGE_NO_LANE);
    look(w);
    assert_int_equal(w->order->rank[0], 0);
    w->positions[0].s = 78.0; // 35 m before the area
    w->positions[1].s = 74.0;
    look(w);
    assert_int_equal(w->order->rank[0], 1);
    assert_true(w->turns.of[1].doubted);
    w->positions[0].s = 70.0; // back where it would have relied on it
    look(w);
    assert_int_equal(w->order->rank[0], 1);
    w->vehicles[1].acceleration = -2.0;
    look(w);
    assert_int_equal(w->order->rank[0], 0);
    world_close(w);
}

static void drivers_who_yield_to_nobody_are_not_run_into(void** state)
{
    (void)state;
    test_rng rng = test_rng_seeded("lawless");
    for (uint32_t round = 0; round < test_rounds(200); ++round) {
        verge_signal signal;
        world* w = ruled_crossing(round % 2 == 0, &signal);
        const double speed = test_rng_between(&rng, 4.0, LIMIT);
        const double away = test_rng_between(&rng, 40.0, 80.0);
        add(w, true, 0, 120.0 - away, speed, VERGE_NO_LANE);
        const double other = test_rng_between(&rng, 4.0, 12.0);
        const double theirs = away * other / speed + test_rng_between(&rng, -15.0, 15.0);
        add(w, false, 1, 120.0 - fmin(theirs, 115.0), other, VERGE_NO_LANE);
        w->steady = 2;
        for (uint32_t cycle = 0; cycle < 60 && w->count == 2; ++cycle) {
            drive(w, 0);
            if (w->count == 2 && overlaps(w) != 0) {
                printf("round %u\n", round);
                show(w);
                fail();
            }
        }
        world_close(w);
    }
}

// One vehicle on a ring has its rear `past` a place from which bodies touch those that come in. The
// other one has its front `before` that place. Returns where it has to stop, from there. [m]
static double wall_beside(double before, double v, double past, double u)
{
    const double half = 2.25;
    world* w = roundabout(20.0);
    add(w, true, 11, 1.0, v, 53);
    add(w, true, 31, 1.0, u, 53);
    look(w);
    const vg_share* area = w->order->shares;
    assert_int_equal(w->order->courses[0].share_count, 1);
    assert_int_equal(area->kind, VG_SHARE_MERGE);
    w->positions[0].s += area->enter - half - before;
    w->positions[1].s += area->other_enter + half + past;
    place(w, 0);
    place(w, 1);
    look(w);
    assert_int_equal(w->order->rank[0], 1);
    const double wall = vg_order_wall(&w->model, &w->flow, 0) - half - before;
    world_close(w);
    return wall;
}

// Unless it has to wait before the area, its nose comes half a second after the rear of the other
// one, even with an acceleration of 1.5 m/s^2. It waits for at most 2.2 m more than that.
static void where_lanes_meet_at_an_angle_a_nose_comes_half_a_second_after_the_rear(void** state)
{
    (void)state;
    uint32_t enters = 0, waits = 0;
    for (double before = 4.0; before <= 9.0; before += 1.0) {
        for (double v = 1.0; v * v < 6.0 * (before - 1.5) && v < 5.0; v += 1.0) {
            for (double u = 4.0; u <= 8.0; u += 1.0) {
                const double arrives = (sqrt(v * v + 3.0 * before) - v) / 1.5;
                for (double past = -7.0; past <= 3.0; past += 0.5) {
                    const double later = arrives + past / u; // than the rear
                    const bool line = wall_beside(before, v, past, u) < -2.9;
                    assert_false(!line && later < 0.5);
                    const double beside = past - 2.0 + before + (u - v) * before / v;
                    assert_false(line && later > 0.5 + 2.2 / u && beside > 0.0);
                    *(line ? &waits : &enters) += 1;
                }
            }
        }
    }
    assert_true(enters > 100 && waits > 100);
}

// On a full ring each is behind the next one. A vehicle that goes first because nobody moved lets
// a driver on the ring pass all the same.
static void a_vehicle_that_is_helped_does_not_enter_a_ring_before_a_driver(void** state)
{
    (void)state;
    for (uint32_t helped = 0; helped < 2; ++helped) {
        world* w = roundabout(20.0);
        add(w, true, 11, verge_road_length(w->road, 11) - 12.0, 1.0, 52);
        for (int32_t k = 0; k < 4; ++k) {
            add(w, false, 21 + k, verge_road_length(w->road, 21 + k) - 1.0, 5.0, VERGE_NO_LANE);
        }
        w->turns = (verge_turns){ .count = 1 };
        w->turns.of[0] = (verge_turn){ .vehicle_id = 1, .arrival = w->scene.utime,
                                       .helped = helped ? w->scene.utime : 0 };
        look(w);
        assert_true(w->order->rank[0] > w->order->rank[4]);
        world_close(w);
    }
}

// A human stands a little before an area, beyond its line: others wait, until it has not used its
// turn for three seconds.
static void a_human_who_does_not_use_its_turn_is_passed_over(void** state)
{
    (void)state;
    verge_signal signal;
    world* w = ruled_crossing(false, &signal);
    add(w, true, 0, 110.0, 0.0, VERGE_NO_LANE);
    add(w, false, 1, 100.0, 0.0, VERGE_NO_LANE);
    look(w);
    const double enter = (double)w->order->shares[w->order->shares_max].enter;
    w->positions[1].s += enter - 2.5 - 0.4; // its front is 0.4 m before the area
    for (uint32_t cycle = 0; cycle < 12; ++cycle) {
        look(w);
        assert_int_equal(w->order->rank[0], cycle <= 6 ? 1 : 0);
        w->scene.utime += 500000;
    }
    world_close(w);
}

// A vehicle that has nothing to wait for and stands is found after three seconds, named and helped.
static void a_vehicle_that_stands_without_a_cause_is_found(void** state)
{
    (void)state;
    world* w = street();
    add(w, true, 0, 100.0, 0.0, VERGE_NO_LANE);
    add(w, true, 3, 20.0, 0.0, VERGE_NO_LANE);
    uint32_t found = 0;
    for (uint32_t cycle = 0; cycle < 10; ++cycle) {
        look(w);
        found += w->order->unstuck;
        const verge_cause cause = vg_order_reason(&w->model, &w->flow, &w->scene, 0);
        if (cycle < 6) {
            assert_int_equal(found, 0);
        } else {
            assert_int_equal(cause.code, VERGE_WHY_BLOCKED);
        }
        w->scene.utime += 500000;
    }
    assert_int_equal(found, 2); // each once
    world_close(w);
}

// One vehicle on a straight lane that another lane crosses twice, and three vehicles on that one.
static world* cross_twice(uint32_t vehicles_max)
{
    world* w = world_open();
    w->def.vehicles_max = vehicles_max;
    w->def.controlled_max = 4;
    add_straight(w, 0, 0.0, 0.0, 90.0, 0.0, -1);
    add_curve(w, 1, (double[]){ -10.0, -20.0, 0.8 }, (double[]){ 25.0, 8.0, 0.0 }, 2);
    add_curve(w, 2, (double[]){ 25.0, 8.0, 0.0 }, (double[]){ 60.0, -20.0, -0.8 }, -1);
    world_build(w);
    (void)add(w, true, 0, 3.0, 5.0, 0);
    for (uint32_t i = 0; i < 3; ++i) {
        (void)add(w, true, 1, 2.0 + 7.0 * i, 5.0, 2);
    }
    look(w);
    return w;
}

static void areas_are_known_whatever_the_room_for_more_vehicles(void** state)
{
    (void)state;
    world *exact = cross_twice(4), *more = cross_twice(VERGE_VEHICLES_MAX);
    assert_true(exact->order->courses[0].share_count > 4); // more than there are vehicles
    for (uint32_t slot = 0; slot < 4; ++slot) {
        const vg_course* course = &exact->order->courses[slot];
        assert_int_equal(course->share_count, more->order->courses[slot].share_count);
        for (uint32_t k = 0; k < course->share_count; ++k) {
            const vg_share* a = &exact->order->shares[slot * exact->order->shares_max + k];
            const vg_share* b = &more->order->shares[slot * more->order->shares_max + k];
            assert_true(a->other == b->other && a->enter == b->enter && a->leave == b->leave);
        }
    }
    world_close(exact);
    world_close(more);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(all_vehicles_pass_a_crossing_one_after_the_other),
        cmocka_unit_test(rings_keep_a_hole_and_everybody_gets_off),
        cmocka_unit_test(nobody_stands_on_a_crossing_that_has_no_room_behind_it),
        cmocka_unit_test(an_area_behind_a_lane_boundary_has_an_order_too),
        cmocka_unit_test(the_end_of_a_lane_takes_one_of_each_lane_in_turn),
        cmocka_unit_test(everybody_stops_at_a_stop_sign_and_all_get_through),
        cmocka_unit_test(who_stops_first_at_a_crossing_of_stop_signs_goes_first),
        cmocka_unit_test(who_has_priority_does_not_brake_for_who_waits),
        cmocka_unit_test(a_red_signal_is_a_wall_and_a_green_one_is_not),
        cmocka_unit_test(priority_goes_before_arrival),
        cmocka_unit_test(a_driver_who_has_to_wait_and_does_not_brake_is_let_go),
        cmocka_unit_test(nobody_is_relied_on_beyond_the_point_of_no_return_without_a_sign),
        cmocka_unit_test(drivers_who_yield_to_nobody_are_not_run_into),
        cmocka_unit_test(where_lanes_meet_at_an_angle_a_nose_comes_half_a_second_after_the_rear),
        cmocka_unit_test(a_vehicle_that_is_helped_does_not_enter_a_ring_before_a_driver),
        cmocka_unit_test(a_human_who_does_not_use_its_turn_is_passed_over),
        cmocka_unit_test(a_vehicle_that_stands_without_a_cause_is_found),
        cmocka_unit_test(areas_are_known_whatever_the_room_for_more_vehicles),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
