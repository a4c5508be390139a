// The model of the flow against straight double-precision readings of the paper: Table 1, Eq. 2
// and 3, the IDM, conflicts by brute force, and R_i with Eq. 4 and 5.
#include "stage.h"

#include "road/road.h"

#define WIDTH STAGE_WIDTH
// As in flow.c: bodies with this much air between them count as in the path. [m]
static const double path_air = 0.4;

static double lateral(const vg_flow* flow, uint32_t slot)
{
    return WIDTH * (double)flow->lane[slot] + (double)flow->d[slot];
}

// ---------------------------------------------------------------------------- Table 1

/// Half a lane a step, but no more than one metre across in two along.
static double across(double v, double dt)
{
    return fmin(0.5 * STAGE_WIDTH * dt / 1.5, 0.5 * v * dt);
}

static void keep_accelerate_decelerate_change_the_state_as_table_1_says(void** state)
{
    (void)state;
    test_rng rng = test_rng_seeded("table 1");
    stage* at = stage_open(3, 2000.0);
    const double dt = at->def.step_s, a = 0.6;
    for (uint32_t k = 0; k < test_rounds(3000); ++k) {
        const double s = test_rng_between(&rng, 10.0, 900.0);
        const double v = k % 5 == 0 ? test_rng_between(&rng, 0.0, a * dt)
                                    : test_rng_between(&rng, 0.0, 30.0);
        const double d = test_rng_between(&rng, -1.9, 1.9);
        const uint8_t action = (uint8_t)test_rng_below(&rng, 3);
        stage_clear(at);
        stage_add(at, true, 1, s, d, v, -1);
        stage_begin(at);
        stage_step(at, &at->root, &action);
        double ds = v * dt, dv = 0.0;
        if (action == VERGE_ACCELERATE) {
            ds += 0.5 * a * dt * dt;
            dv = a * dt;
        } else if (action == VERGE_DECELERATE && v >= a * dt) {
            ds -= 0.5 * a * dt * dt;
            dv = -a * dt;
        } else if (action == VERGE_DECELERATE) { // stops on the way
            ds = v * v / (2.0 * a);
            dv = -v;
        }
        CHECK_NEAR(at->root.station[0], s + ds, 2e-3);
        CHECK_NEAR(at->root.v[0], v + dv, 1e-5);
        assert_true(at->root.v[0] >= 0.0f);
        const double left = fabs(d) - across(v, dt); // a step back to the centre
        CHECK_NEAR(fabs((double)at->root.d[0]), left > 0.0 ? left : 0.0, 1e-4);
        assert_int_equal(at->root.lane[0], 1);
    }
    stage_close(at);
}

static void a_change_moves_half_a_lane_and_never_past_the_next_centre(void** state)
{
    (void)state;
    test_rng rng = test_rng_seeded("lane change");
    stage* at = stage_open(3, 2000.0);
    for (uint32_t k = 0; k < test_rounds(3000); ++k) {
        const double d = test_rng_between(&rng, -2.0, 2.0), v = test_rng_between(&rng, 0.0, 30.0);
        const bool to_left = test_rng_below(&rng, 2) == 0;
        const uint8_t action = to_left ? VERGE_CHANGE_LEFT : VERGE_CHANGE_RIGHT;
        stage_clear(at);
        stage_add(at, true, 1, 100.0, d, v, -1);
        stage_begin(at);
        stage_step(at, &at->root, &action);
        // Mirrored, so that the change is always towards growing x.
        const double x = to_left ? d : -d;
        const double goal = x < -0.3 ? 0.0 : WIDTH; // coming from the other side: this centre first
        if (fabs(x + 0.3) > 1e-4) {
            const double moved = (lateral(&at->root, 0) - WIDTH) * (to_left ? 1.0 : -1.0);
            CHECK_NEAR(moved, fmin(x + across(v, at->def.step_s), goal), 1e-4);
            const bool over = moved > 0.5 * WIDTH + 0.051; // clearly nearer to the next centre
            if (over || moved < 0.5 * WIDTH + 0.049) {
                assert_int_equal(at->root.lane[0], 1 + (over ? (to_left ? 1 : -1) : 0));
            }
        }
        CHECK_NEAR(at->root.station[0], 100.0 + v * at->def.step_s, 1e-3);
        CHECK_NEAR(at->root.v[0], v, 1e-5);
    }
    stage_close(at);
}

static void two_steps_make_a_whole_change_and_the_id_flips_with_the_second(void** state)
{
    (void)state;
    stage* at = stage_open(2, 2000.0);
    const uint8_t left = VERGE_CHANGE_LEFT;
    stage_add(at, true, 0, 100.0, 0.0, 10.0, 1);
    stage_begin(at);
    stage_step(at, &at->root, &left);
    assert_int_equal(at->root.lane[0], 0);
    CHECK_NEAR(at->root.d[0], 2.0, 1e-4);
    stage_step(at, &at->root, &left);
    assert_int_equal(at->root.lane[0], 1);
    CHECK_NEAR(at->root.d[0], 0.0, 1e-4);
    stage_close(at);
}

static void short_steps_change_lanes_at_the_same_pace(void** state)
{
    (void)state;
    stage* at = stage_open(2, 2000.0);
    at->def.step_s = 0.5;
    const uint8_t left = VERGE_CHANGE_LEFT;
    stage_add(at, true, 0, 100.0, 0.0, 10.0, 1);
    stage_begin(at);
    for (int k = 1; k <= 6; ++k) {
        stage_step(at, &at->root, &left);
        CHECK_NEAR(lateral(&at->root, 0), 4.0 * k / 6.0, 1e-3);
    }
    assert_int_equal(at->root.lane[0], 1);
    stage_close(at);
}

// ---------------------------------------------------------------------------- Eq. 3

typedef struct body {
    double s, y, v;
} body;

static double idm_by_hand(const verge_planner_def* def, double v, double desired, double gap,
                          double lead_v)
{
    const double wanted = fmax(def->idm_gap, def->idm_gap + v * def->idm_headway_s
                                                 + v * (v - lead_v) / (2.0 * def->idm_comfort));
    const double a = def->idm_acceleration
                     * (1.0 - pow(v / desired, 4.0) - pow(wanted / fmax(gap, 1.0), 2.0));
    return fmax(a, -def->idm_braking_max);
}

/// Where vehicle j is a step later without an action.
static body later(const stage* at, uint32_t j)
{
    const vg_flow* flow = &at->root;
    const double dt = at->def.step_s;
    body now = { flow->station[j], lateral(flow, j), flow->v[j] };
    if (j < at->scene.controlled_count) {
        return (body){ now.s + now.v * dt, now.y, now.v };
    }
    double lead_v = now.v, gap = INFINITY; // to the nearest tail
    for (uint32_t k = 0; k < at->count; ++k) {
        const double ds = flow->station[k] - now.s;
        const double half_widths = at->scene.half_width[k] + at->scene.half_width[j];
        const double to_tail = ds - at->scene.half_length[k] - at->scene.half_length[j];
        if (k != j && ds > 0.0 && to_tail < gap
            && fabs(lateral(flow, k) - now.y) < half_widths + path_air) {
            lead_v = flow->v[k];
            gap = to_tail;
        }
    }
    // On as measured: to the limit if it speeds up, else to the speed that two more seconds of its
    // acceleration lead to.
    const double measured = at->vehicles[j].acceleration, v0 = at->vehicles[j].speed;
    const double most = fmax(STAGE_LIMIT, v0);
    const double desired = measured > 0.1 ? most : fmax(fmin(v0 + 2.0 * measured, most), 0.05);
    verge_planner_def def = at->def;
    def.idm_braking_max = fmax(def.idm_braking_max, -measured);
    const double a = idm_by_hand(&def, now.v, desired, gap, lead_v);
    if (now.v + a * dt < 0.0) { // stops on the way
        return (body){ now.s + now.v * now.v / (-2.0 * a), now.y, 0.0 };
    }
    return (body){ now.s + now.v * dt + 0.5 * a * dt * dt, now.y, now.v + a * dt };
}

typedef struct window {
    double low, high;
    double ahead_gap, ahead_v; // of the leader: from the looker's centre to its tail
    double behind_gap;         // from the looker's centre to the follower's nose
    double doubt;              // distance to the nearest comparison that could go either way
} window;

/// The speeds allowed to planned vehicle i when it ends `beyond` metres past where its present
/// speed takes it, at y.
static window window_of(const stage* at, uint32_t i, double y, double beyond)
{
    const double tau = at->def.reaction_s, mth = at->def.headway_s;
    const double s = at->root.station[i] + at->root.v[i] * at->def.step_s;
    window w = { -INFINITY, INFINITY, INFINITY, 0.0, INFINITY, INFINITY };
    double nose = INFINITY;
    for (uint32_t j = 0; j < at->count; ++j) {
        const body other = later(at, j);
        const double air = fabs(other.y - y) - at->scene.half_width[i] - at->scene.half_width[j];
        const double ds = other.s - s, gap = fabs(ds) - at->scene.half_length[j];
        if (j == i) {
            continue;
        }
        w.doubt = fmin(w.doubt, fmin(fabs(air - path_air), fabs(ds)));
        if (air >= path_air) {
            continue;
        }
        if (ds > 0.0 && gap < w.ahead_gap) {
            const double free_way = gap - at->scene.half_length[i] - beyond;
            w.ahead_gap = gap;
            w.ahead_v = other.v;
            w.high = fmin((mth * other.v + free_way) / (tau + mth), free_way / tau);
        } else if (ds <= 0.0 && gap < nose) {
            const double free_way = gap - at->scene.half_length[i] + beyond;
            nose = w.behind_gap = gap;
            w.low = other.v - (free_way - tau * other.v) / mth;
        }
    }
    return w;
}

/// 1 inside, 0 outside, -1 too close to tell in single precision.
static int inside(window w, double v)
{
    const double slack = 2e-3;
    if (w.doubt < slack || fabs(v - w.low) < slack || fabs(v - w.high) < slack) {
        return -1;
    }
    return v > w.low && v < w.high;
}

static void check_keeping(const stage* at, uint32_t i, uint8_t legal, uint32_t* told)
{
    const double dt = at->def.step_s, v = at->root.v[i];
    const double d = at->root.d[i], back = fmin(fabs(d), across(v, dt));
    const double kept = WIDTH * at->root.lane[i] + d - (d > 0.0 ? back : -back);
    const double gain = at->def.acceleration * dt, loss = fmin(at->def.deceleration * dt, v);
    const double stop_s = v / at->def.deceleration; // [s]
    const double braked = v >= at->def.deceleration * dt ? -0.5 * at->def.deceleration * dt * dt
                                                         : 0.5 * v * stop_s - v * dt;
    const int fits[3] = { inside(window_of(at, i, kept, 0.0), v),
                          inside(window_of(at, i, kept, 0.5 * gain * dt), v + gain),
                          inside(window_of(at, i, kept, braked), v - loss) };
    if (fits[0] < 0 || fits[1] < 0 || fits[2] < 0 || fabs(v + gain - STAGE_LIMIT) < 1e-4) {
        return;
    }
    const uint8_t expected =
        (uint8_t)((fits[0] ? 1u : 0u) | (fits[1] && v + gain < STAGE_LIMIT ? 2u : 0u)
                  | (fits[2] && v > 0.0 ? 4u : 0u));
    if (expected != 0) {
        assert_int_equal(legal & 7u, expected);
        ++told[expected];
    } else { // nothing fits: exactly one way out is left
        const uint8_t only = legal & 7u;
        assert_true(only == 1u || only == 2u || only == 4u);
        ++told[0];
    }
}

static void check_changes(const stage* at, uint32_t i, uint8_t legal, uint32_t* told)
{
    const double v = at->root.v[i], d = at->root.d[i];
    const int32_t lane = at->root.lane[i], target = at->scene.target[i];
    const double back = fmin(fabs(d), across(v, at->def.step_s));
    const window keep = window_of(at, i, WIDTH * lane + d - (d > 0.0 ? back : -back), 0.0);
    if (keep.doubt < 2e-3 || fabs(keep.ahead_gap - 60.0) < 1e-2
        || fabs(v - 0.5) < 1e-4) {
        return;
    }
    const bool overtake = keep.ahead_gap < 60.0 && keep.ahead_v < 0.6 * STAGE_LIMIT;
    for (int side = -1; side <= 1; side += 2) { // right, left
        const uint8_t action = side > 0 ? VERGE_CHANGE_LEFT : VERGE_CHANGE_RIGHT;
        const bool finishing = d * side < -0.3;
        const bool beside = lane + side >= 0 && lane + side < (int32_t)at->def.road.lane_count;
        const bool wanted = target >= 0 && (target - lane) * side > 0;
        const double goal = finishing ? 0.0 : WIDTH;
        const double y = WIDTH * lane + side * fmin(d * side + 0.5 * WIDTH, goal);
        const bool allowed = v >= 0.5
                             && (finishing || (beside && (wanted || overtake)));
        const window there = window_of(at, i, y, 0.0);
        const double half = at->scene.half_length[i];
        const double room = fmin(at->def.change_gap, at->def.idm_gap + at->def.idm_headway_s * v);
        const double least = fmin(there.ahead_gap, there.behind_gap) - half;
        const int window_fits = inside(there, v);
        const int fits = window_fits < 0 || fabs(least - room) < 5e-3
                             ? -1 : window_fits == 1 && least > room;
        if (fits >= 0 && fabs(d * side + 0.3) > 1e-4) {
            assert_int_equal((legal >> action) & 1, allowed && fits == 1);
            told[allowed * 2 + fits]++;
        }
    }
}

static void the_actions_left_are_those_whose_new_speed_lies_in_the_window(void** state)
{
    (void)state;
    test_rng rng = test_rng_seeded("speed window");
    stage* at = stage_open(3, 2000.0);
    at->def.search = VERGE_SEARCH_PAPER; // its rules
    uint32_t told[8] = { 0 }, changes[4] = { 0 };
    for (uint32_t k = 0; k < test_rounds(20000); ++k) {
        const uint32_t planned = 1 + test_rng_below(&rng, 6), humans = test_rng_below(&rng, 6);
        stage_fill(at, &rng, planned, humans, 100.0, 100.0 + 30.0 * (planned + humans), 6.0);
        for (uint32_t i = 0; i < at->count; ++i) {
            at->positions[i].d = k % 2 == 0 ? 0.0 : test_rng_between(&rng, -1.9, 1.9);
            at->vehicles[i].length = test_rng_between(&rng, 3.0, 6.0);
        }
        stage_begin(at);
        vg_moves moves;
        memset(&moves, 0, sizeof moves);
        vg_flow_moves(&at->scene, &at->root, &moves);
        for (uint32_t i = 0; i < planned; ++i) {
            assert_true(moves.legal[i] != 0 && moves.legal[i] < 32);
            check_keeping(at, i, moves.legal[i], told);
            check_changes(at, i, moves.legal[i], changes);
        }
    }
    if (test_rounds(100) == 100) { // every case was met
        for (uint32_t c = 0; c < 8; ++c) {
            assert_true(told[c] > 0 || c == 6); // the window is an interval: KS lies between
        }
        assert_true(changes[2] > 100 && changes[3] > 100 && changes[1] > 100);
    }
    stage_close(at);
}

/// Lane 0 ends 300 m before lane 1 does.
static void who_waits_at_a_lanes_end_sets_off_when_there_is_room_beside(void** state)
{
    (void)state;
    stage* at = stage_open(2, 600.0);
    at->points[0][1][0] = 300.0;
    stage_build(at);
    for (uint32_t k = 0; k < 3; ++k) { // alone; someone beside; no way left
        vg_moves moves;
        memset(&moves, 0, sizeof moves);
        stage_clear(at);
        stage_add(at, true, 0, k == 2 ? 297.0 : 288.0, 0.0, 0.0, 1);
        stage_add(at, false, 1, k == 1 ? 289.0 : 450.0, 0.0, 0.0, -1);
        stage_begin(at);
        vg_flow_moves(&at->scene, &at->root, &moves);
        assert_int_equal((moves.legal[0] >> VERGE_ACCELERATE) & 1, k == 0);
    }
    stage_clear(at); // and an approaching vehicle slows down well before
    stage_add(at, true, 0, 250.0, 0.0, 10.0, 1);
    stage_begin(at);
    vg_moves moves;
    memset(&moves, 0, sizeof moves);
    vg_flow_moves(&at->scene, &at->root, &moves);
    assert_int_equal(moves.legal[0] & 7, 1 << VERGE_DECELERATE);
    assert_true((moves.legal[0] >> VERGE_CHANGE_LEFT & 1) != 0);
    stage_close(at);
}

// ---------------------------------------------------------------------------- humans

static void humans_follow_the_idm_behind_the_nearest_vehicle_in_their_path(void** state)
{
    (void)state;
    test_rng rng = test_rng_seeded("idm");
    stage* at = stage_open(3, 2000.0);
    for (uint32_t k = 0; k < test_rounds(5000); ++k) {
        stage_fill(at, &rng, test_rng_below(&rng, 6), 1 + test_rng_below(&rng, 8), 100.0, 300.0,
                   6.0);
        for (uint32_t i = 0; k % 2 == 0 && i < at->count; ++i) {
            at->vehicles[i].acceleration = test_rng_between(&rng, -8.0, 3.0);
        }
        stage_begin(at);
        vg_moves moves;
        memset(&moves, 0, sizeof moves);
        vg_flow_moves(&at->scene, &at->root, &moves);
        for (uint32_t j = at->scene.controlled_count; j < at->count; ++j) {
            const body expected = later(at, j);
            CHECK_NEAR(moves.station[0][j], expected.s, 2e-3);
            CHECK_NEAR(moves.v[0][j], expected.v, 1e-3);
            CHECK_NEAR(moves.y[0][j], expected.y, 1e-4);
        }
    }
    stage_close(at);
}

/// Humans in a file behind one planned vehicle that does as it likes; each starts with room to
/// stop behind its leader's stop.
static void start_file(stage* at, test_rng* rng, uint32_t count)
{
    double s = 500.0, lead_v = test_rng_between(rng, 0.0, STAGE_LIMIT);
    stage_clear(at);
    stage_add(at, true, 0, s, 0.0, lead_v, -1);
    for (uint32_t i = 1; i < count; ++i) {
        const double v = test_rng_between(rng, 0.0, STAGE_LIMIT);
        const double braking = fmax(0.0, v * v - lead_v * lead_v) / (2.0 * 1.5);
        s -= 5.0 + 2.0 + 2.0 * v + braking + test_rng_between(rng, 0.0, 10.0);
        stage_add(at, false, 0, s, 0.0, v, -1);
        lead_v = v;
    }
    stage_begin(at);
}

static void humans_with_room_never_touch_their_leader_in_steps_up_to_a_second(void** state)
{
    (void)state;
    test_rng rng = test_rng_seeded("no collision behind");
    stage* at = stage_open(1, 2000.0);
    double smallest = INFINITY;
    for (uint32_t k = 0; k < test_rounds(2000); ++k) {
        at->def.step_s = test_rng_between(&rng, 0.25, 1.0);
        start_file(at, &rng, 6);
        uint8_t action = VERGE_KEEP_SPEED;
        for (uint32_t t = 0; t < 40; ++t) {
            action = test_rng_below(&rng, 3) == 0 ? (uint8_t)test_rng_below(&rng, 3) : action;
            stage_step(at, &at->root, &action);
            for (uint32_t i = 1; i < at->count; ++i) {
                const double gap = (double)at->root.station[i - 1] - at->root.station[i] - 5.0;
                smallest = fmin(smallest, gap);
                CHECK_BETWEEN(gap, 0.0, 2000.0);
            }
        }
    }
    assert_true(smallest < 10.0); // they did come near
    stage_close(at);
}

static void a_human_stays_in_its_lane_where_the_lane_leads(void** state)
{
    (void)state;
    stage* at = stage_open(2, 500.0); // the straight lane is the longer one: stations are its own
    static const double slanted[3][2] = { { 0.0, 4.0 }, { 200.0, 12.0 }, { 400.0, 20.0 } };
    at->lanes[1].points = slanted;
    at->lanes[1].point_count = 3;
    stage_build(at);
    stage_add(at, false, 1, 50.0, 0.3, 10.0, -1);
    stage_begin(at);
    for (uint32_t t = 0; t < 12; ++t) {
        stage_step(at, &at->root, NULL);
        CHECK_NEAR(at->root.d[0], 0.3, 0.05);
    }
    stage_close(at);
}

static void keeping_a_lane_that_leads_aside_stays_on_its_centre(void** state)
{
    (void)state;
    stage* at = stage_open(2, 500.0); // the straight lane is the longer one: stations are its own
    static const double slanted[3][2] = { { 0.0, 4.0 }, { 200.0, 12.0 }, { 400.0, 20.0 } };
    at->lanes[1].points = slanted;
    at->lanes[1].point_count = 3;
    stage_build(at);
    stage_add(at, true, 1, 50.0, 0.0, 10.0, -1);
    stage_begin(at);
    const uint8_t keep = VERGE_KEEP_SPEED;
    for (uint32_t t = 0; t < 12; ++t) {
        stage_step(at, &at->root, &keep);
        CHECK_NEAR(at->root.d[0], 0.0, 0.05);
    }
    stage_close(at);
}

static void lanes_shorter_than_a_step_are_passed_in_one(void** state)
{
    (void)state;
    stage* at = stage_open(6, 100.0);
    for (uint32_t i = 0; i < 6; ++i) { // one behind the other, 10 m each, the last long
        at->lanes[i].left = at->lanes[i].right = VERGE_NO_LANE;
        at->points[i][0][0] = 10.0 * i;
        at->points[i][1][0] = i < 5 ? 10.0 * (i + 1) : 500.0;
        at->points[i][0][1] = at->points[i][1][1] = 0.0;
        at->lanes[i].successor_count = i < 5;
        at->lanes[i].successors[0] = (int32_t)i + 1;
    }
    stage_build(at);
    stage_add(at, true, 0, 5.0, 0.0, 20.0, 5);
    stage_add(at, false, 1, 5.0, 0.0, 20.0, -1);
    stage_begin(at);
    const uint8_t keep = VERGE_KEEP_SPEED;
    stage_step(at, &at->root, &keep); // 30 m: from 5 m to 35 m
    assert_int_equal(at->root.lane[0], 3);
    CHECK_NEAR(vg_lane_s(&at->road->lanes[3], at->root.station[0]), 5.0, 0.02);
    const int32_t human = at->root.lane[1];
    assert_true(human >= 3);
    const double s = vg_lane_s(&at->road->lanes[human], at->root.station[1]);
    CHECK_BETWEEN(s, 0.0, at->road->lanes[human].length);
    stage_close(at);
}

// ---------------------------------------------------------------------------- conflicts

typedef struct sweep {
    bool touching_at_start, touches, near_at_start, comes_near;
} sweep;

/// Two bodies from one instant to the next in steps of 10 ms, straight.
static sweep sweep_of(const stage* at, const vg_flow* next, double slack)
{
    const double length = at->scene.half_length[0] + at->scene.half_length[1];
    const double width = at->scene.half_width[0] + at->scene.half_width[1];
    const int steps = (int)(at->def.step_s / 0.01 + 0.5);
    const double x0 = at->root.station[1] - at->root.station[0];
    const double x1 = next->station[1] - next->station[0];
    const double y0 = lateral(&at->root, 1) - lateral(&at->root, 0);
    const double y1 = lateral(next, 1) - lateral(next, 0);
    sweep out = { false, false, false, false };
    for (int k = 0; k <= steps; ++k) {
        const double u = (double)k / steps;
        const double x = fabs(x0 + u * (x1 - x0)), y = fabs(y0 + u * (y1 - y0));
        const bool touch = x < length - 1e-4 && y < width - 1e-4;
        const bool near = x < length + 1.0 + slack && y < width + 0.3 + slack;
        out.touches |= touch;
        out.comes_near |= near;
        out.touching_at_start |= k == 0 && x < length + 1e-3 && y < width + 1e-3;
        out.near_at_start |= k == 0 && near;
    }
    return out;
}

static void random_pair(stage* at, test_rng* rng, bool second_planned)
{
    stage_clear(at);
    stage_add(at, true, test_rng_below(rng, 3), 200.0, test_rng_between(rng, -2.0, 2.0),
              test_rng_between(rng, 0.0, 30.0), -1);
    stage_add(at, second_planned, test_rng_below(rng, 3), test_rng_between(rng, 150.0, 250.0),
              test_rng_between(rng, -2.0, 2.0), test_rng_between(rng, 0.0, 30.0), -1);
    at->vehicles[0].length = test_rng_between(rng, 3.0, 12.0);
    at->vehicles[1].margin = test_rng_below(rng, 2) == 0 ? 0.0 : test_rng_between(rng, 0.0, 0.5);
    stage_begin(at);
}

static void conflicts_are_those_of_bodies_moved_in_small_steps(void** state)
{
    (void)state;
    test_rng rng = test_rng_seeded("conflicts");
    stage* at = stage_open(3, 2000.0);
    uint32_t touching = 0, near = 0, clear = 0;
    for (uint32_t k = 0; k < test_rounds(100000); ++k) {
        random_pair(at, &rng, k % 4 != 0);
        const uint8_t actions[2] = { (uint8_t)test_rng_below(&rng, 5),
                                     (uint8_t)test_rng_below(&rng, 5) };
        vg_moves moves;
        memset(&moves, 0, sizeof moves);
        vg_flow_moves(&at->scene, &at->root, &moves);
        vg_flow next = at->root;
        vg_flow_advance(&at->scene, &at->root, &moves, actions, &next);
        const uint32_t found = vg_flow_conflicts(&at->scene, &at->root, &moves, actions);
        // Between two small steps a body moves up to 0.3 m: what passes a corner there is missed.
        const sweep loose = sweep_of(at, &next, 0.16), tight = sweep_of(at, &next, -1e-3);
        if (at->scene.controlled_count == 2) {
            assert_true(found == 0 || found == 3); // a conflict is one of both
        }
        if (!loose.near_at_start && tight.comes_near) {
            assert_true(found != 0);
            ++near;
        }
        if (!tight.touching_at_start && tight.touches) {
            assert_true(found != 0); // whatever air there was before
            ++touching;
        }
        if (!loose.comes_near) {
            assert_int_equal(found, 0);
            ++clear;
        }
    }
    assert_true(test_rounds(100) < 100 || (touching > 1000 && near > 1000 && clear > 1000));
    stage_close(at);
}

static void changing_into_each_others_lanes_is_a_conflict(void** state)
{
    (void)state;
    stage* at = stage_open(2, 2000.0);
    for (int offset = -5; offset <= 5; ++offset) {
        stage_clear(at);
        stage_add(at, true, 0, 200.0, 0.0, 10.0, 1);
        stage_add(at, true, 1, 200.0 + offset, 0.0, 10.0, 0);
        stage_begin(at);
        vg_moves moves;
        memset(&moves, 0, sizeof moves);
        vg_flow_moves(&at->scene, &at->root, &moves);
        const uint8_t swap[2] = { VERGE_CHANGE_LEFT, VERGE_CHANGE_RIGHT }, stay[2] = { 0, 0 };
        assert_int_equal(vg_flow_conflicts(&at->scene, &at->root, &moves, swap), 3);
        assert_int_equal(vg_flow_conflicts(&at->scene, &at->root, &moves, stay), 0);
    }
    stage_close(at);
}

typedef struct pose {
    double x, y;
} pose;

static pose centre_of(const stage* at, const vg_flow* flow, uint32_t slot)
{
    const vg_lane* lane = &at->road->lanes[flow->lane[slot]];
    const vg_reference here = vg_lane_at(lane, vg_lane_s(lane, flow->station[slot]));
    return (pose){ here.x - flow->d[slot] * here.sin_heading,
                   here.y + flow->d[slot] * here.cos_heading };
}

/// A ramp (lane 1) that comes to a straight lane (0) at x = 200; both go on as lane 2.
static stage* open_merge(void)
{
    static const double ramp[6][2] = { { 0, -40 },  { 50, -25 }, { 100, -12 },
                                       { 140, -5 }, { 170, -1 }, { 200, 0 } };
    stage* at = stage_open(3, 200.0);
    for (uint32_t i = 0; i < 3; ++i) {
        at->lanes[i].left = at->lanes[i].right = VERGE_NO_LANE;
        at->lanes[i].successor_count = i < 2;
        at->lanes[i].successors[0] = 2;
    }
    at->lanes[1].points = ramp;
    at->lanes[1].point_count = 6;
    at->points[2][0][0] = 200.0;
    at->points[2][1][0] = 600.0;
    at->points[2][0][1] = at->points[2][1][1] = 0.0;
    stage_build(at);
    return at;
}

static void who_meets_where_lanes_merge_has_a_conflict_first(void** state)
{
    (void)state;
    test_rng rng = test_rng_seeded("merge");
    stage* at = open_merge();
    uint32_t met = 0;
    for (uint32_t k = 0; k < test_rounds(400); ++k) {
        stage_clear(at);
        stage_add(at, true, 0, test_rng_between(&rng, 60.0, 120.0), 0.0,
                  test_rng_between(&rng, 6.0, 12.0), -1);
        stage_add(at, true, 1, test_rng_between(&rng, 60.0, 120.0), 0.0,
                  test_rng_between(&rng, 6.0, 12.0), -1);
        stage_begin(at);
        bool conflict = false;
        for (uint32_t t = 0; t < 12 && !conflict; ++t) { // both keep their speeds
            const uint8_t keep[2] = { VERGE_KEEP_SPEED, VERGE_KEEP_SPEED };
            vg_moves moves;
            memset(&moves, 0, sizeof moves);
            vg_flow_moves(&at->scene, &at->root, &moves);
            conflict = vg_flow_conflicts(&at->scene, &at->root, &moves, keep) != 0;
            stage_step(at, &at->root, keep);
            const pose a = centre_of(at, &at->root, 0), b = centre_of(at, &at->root, 1);
            const double apart = hypot(a.x - b.x, a.y - b.y);
            met += conflict;
            if (!conflict) {
                CHECK_BETWEEN(apart, 2.0, 1000.0); // bodies are 2 m wide: nearer they overlap
            }
        }
    }
    assert_true(test_rounds(100) < 100 || met > 50);
    stage_close(at);
}

static void the_nearest_in_the_path_are_ahead_and_behind(void** state)
{
    (void)state;
    test_rng rng = test_rng_seeded("neighbours");
    stage* at = stage_open(3, 2000.0);
    for (uint32_t k = 0; k < test_rounds(2000); ++k) {
        stage_fill(at, &rng, 4, 6, 100.0, 200.0, 6.0);
        for (uint32_t i = 0; i < at->count; ++i) {
            int32_t ahead = -1, behind = -1, found_ahead = 7, found_behind = 7;
            double lead = INFINITY, back = -INFINITY;
            for (uint32_t j = 0; j < at->count; ++j) {
                const double ds = at->positions[j].s - at->positions[i].s;
                if (j == i || at->positions[j].lane_id != at->positions[i].lane_id) {
                    continue;
                }
                if (ds > 0.0 && ds < lead) {
                    lead = ds;
                    ahead = (int32_t)j;
                } else if (ds <= 0.0 && ds > back) {
                    back = ds;
                    behind = (int32_t)j;
                }
            }
            vg_flow_neighbours(&at->scene, &at->root, i, &found_ahead, &found_behind);
            assert_int_equal(found_ahead, ahead);
            assert_int_equal(found_behind, behind);
        }
    }
    stage_close(at);
}

// ---------------------------------------------------------------------------- reward

typedef struct story {
    uint32_t steps;
    uint8_t actions[VERGE_STEPS_MAX][VERGE_CONTROLLED_MAX];
    double v[VERGE_STEPS_MAX][VERGE_CONTROLLED_MAX];
    double worth[VERGE_STEPS_MAX][VERGE_CONTROLLED_MAX]; // of the lane, to one with this target
    double tight[VERGE_STEPS_MAX][VERGE_CONTROLLED_MAX]; // 1: set out for a lane without any room
    bool doubtful; // a comparison could go either way in single precision
} story;

/// How much of the room it wants a change that begins now does not leave. [1]
static double tightness_of(const stage* at, uint32_t i, uint8_t action, bool* doubtful)
{
    const double d = at->root.d[i], v = at->root.v[i];
    if ((action != VERGE_CHANGE_LEFT && action != VERGE_CHANGE_RIGHT) || fabs(d) > 0.3) {
        return 0.0;
    }
    const int side = action == VERGE_CHANGE_LEFT ? 1 : -1;
    const double y = WIDTH * at->root.lane[i] + side * fmin(d * side + 0.5 * WIDTH, WIDTH);
    const window w = window_of(at, i, y, 0.0);
    const double room = fmin(w.ahead_gap, w.behind_gap) - at->scene.half_length[i];
    const double crawling = at->def.idm_gap + at->def.idm_headway_s * v;
    const double wanted = fmin(at->def.change_gap_wanted, 2.0 * crawling);
    *doubtful = *doubtful || w.doubt < 2e-3 || fabs(fabs(d) - 0.3) < 1e-4;
    return room < wanted ? 1.0 - room / wanted : 0.0;
}

static void tell(const stage* at, const vg_flow* flow, const uint8_t* actions, story* to)
{
    const uint32_t t = to->steps++;
    for (uint32_t i = 0; i < at->scene.controlled_count; ++i) {
        const int32_t target = at->vehicles[i].target_lane;
        to->actions[t][i] = actions[i];
        to->v[t][i] = flow->v[i];
        const int changes = target < 0 ? 0 : abs(flow->lane[i] - target);
        const bool centred = fabsf(flow->d[i]) <= 0.5f;
        to->worth[t][i] = !centred ? 0.0 : changes == 0 ? 1.0 : 0.25 / changes;
    }
}

/// R_i in its three parts, less what tight changes cost; a story that ended early drives on as it
/// is.
static double reward_of(const stage* at, const story* of, uint32_t i)
{
    const verge_planner_def* def = &at->def;
    const double pace = def->cruise_share * STAGE_LIMIT;
    const double care = at->vehicles[i].habit.cooperation / 0.5; // 1: the normal habit's
    double lane = 0.0, same = 0.0, tight = 0.0;
    for (uint32_t t = 0; t < def->steps; ++t) {
        tight += t < of->steps ? of->tight[t][i] : 0.0;
        const uint32_t told = t < of->steps ? t : of->steps - 1u;
        const double v = of->v[told][i];
        lane += of->worth[told][i] * (v > STAGE_LIMIT ? STAGE_LIMIT / v : fmin(1.0, v / pace));
        same += t == 0 || t >= of->steps || of->actions[t][i] == of->actions[t - 1u][i] ? 1.0 : 0.0;
    }
    return def->reward_target * of->worth[of->steps - 1u][i]
           + def->reward_lane * lane / def->steps + def->reward_consistency * same / def->steps
           - def->reward_room * care * tight / def->steps;
}

/// Eq. 4 and 5.
static double flow_reward_of(const stage* at, const story* of)
{
    const uint32_t count = at->scene.controlled_count;
    double sum = 0.0;
    for (uint32_t i = 0; i < count; ++i) {
        const double gamma = at->vehicles[i].habit.cooperation;
        double others = 0.0;
        for (uint32_t j = 0; j < count; ++j) {
            others += j == i ? 0.0 : reward_of(at, of, j);
        }
        sum += (reward_of(at, of, i) + gamma * others) / (1.0 + (count - 1.0) * gamma);
    }
    return sum / count;
}

/// Random legal actions to the horizon or the end; actions do not mind conflicts here.
static void play(stage* at, test_rng* rng, story* of)
{
    of->steps = 0;
    of->doubtful = false;
    while (of->steps < at->def.steps
           && (of->steps == 0 || !vg_flow_terminal(&at->scene, &at->root))) {
        vg_moves moves;
        memset(&moves, 0, sizeof moves);
        vg_flow next = at->root;
        uint8_t actions[VERGE_CONTROLLED_MAX] = { 0 };
        vg_flow_moves(&at->scene, &at->root, &moves);
        for (uint32_t i = 0; i < at->scene.controlled_count; ++i) {
            actions[i] = stage_pick(rng, moves.legal[i]);
            of->tight[of->steps][i] = tightness_of(at, i, actions[i], &of->doubtful);
        }
        vg_flow_advance(&at->scene, &at->root, &moves, actions, &next);
        at->root = next;
        tell(at, &at->root, actions, of);
    }
}

static void the_reward_is_equation_5_over_the_three_parts_of_each_vehicle(void** state)
{
    (void)state;
    test_rng rng = test_rng_seeded("reward");
    stage* at = stage_open(3, 2000.0);
    uint32_t early = 0;
    for (uint32_t k = 0; k < test_rounds(5000); ++k) {
        stage_fill(at, &rng, 1 + test_rng_below(&rng, 5), test_rng_below(&rng, 4), 100.0, 250.0,
                   8.0);
        story of;
        play(at, &rng, &of);
        const double reward = vg_flow_reward(&at->scene, &at->root, of.steps, true);
        const double expected = fmin(fmax(flow_reward_of(at, &of), 0.0), 1.0);
        CHECK_BETWEEN(reward, 0.0, 1.0);
        if (!of.doubtful) {
            CHECK_NEAR(reward, expected, 2e-5);
        }
        const double cut = vg_flow_reward(&at->scene, &at->root, of.steps, false);
        CHECK_BETWEEN(cut, 0.0, reward + 1e-12); // what ended badly never earns more
        early += of.steps < at->def.steps;
    }
    assert_true(test_rounds(100) < 100 || early > 20);
    stage_close(at);
}

static void equal_cooperation_of_whatever_size_gives_the_mean(void** state)
{
    (void)state;
    test_rng rng = test_rng_seeded("mean");
    stage* at = stage_open(3, 2000.0);
    for (uint32_t k = 0; k < test_rounds(1000); ++k) {
        stage_fill(at, &rng, 4, 0, 100.0, 250.0, 8.0);
        const double gamma = k % 3 == 0 ? 0.0 : k % 3 == 1 ? 1.0 : test_rng_unit(&rng);
        for (uint32_t i = 0; i < 4; ++i) {
            at->vehicles[i].habit.cooperation = gamma;
        }
        stage_begin(at);
        story of;
        play(at, &rng, &of);
        double mean = 0.0;
        for (uint32_t i = 0; i < 4; ++i) {
            mean += 0.25 * reward_of(at, &of, i);
        }
        if (!of.doubtful) {
            CHECK_NEAR(vg_flow_reward(&at->scene, &at->root, of.steps, true), fmax(mean, 0.0), 2e-5);
        }
    }
    stage_close(at);
}

static void doing_the_right_thing_steadily_earns_everything(void** state)
{
    (void)state;
    stage* at = stage_open(2, 2000.0);
    stage_add(at, true, 0, 100.0, 0.0, STAGE_LIMIT, 0);
    stage_add(at, true, 1, 100.0, 0.0, STAGE_LIMIT, -1);
    at->def.target_distance = 1000.0;
    stage_begin(at);
    const uint8_t keep[2] = { VERGE_KEEP_SPEED, VERGE_KEEP_SPEED };
    for (uint32_t t = 0; t < at->def.steps; ++t) {
        assert_false(vg_flow_terminal(&at->scene, &at->root));
        stage_step(at, &at->root, keep);
    }
    CHECK_NEAR(vg_flow_reward(&at->scene, &at->root, at->def.steps, true), 1.0, 1e-5);
    stage_close(at);
}

static void a_flow_is_terminal_when_all_have_driven_their_distance_in_the_target(void** state)
{
    (void)state;
    stage* at = stage_open(2, 2000.0);
    stage_add(at, true, 0, 100.0, 0.0, 10.0, 0);
    stage_add(at, true, 1, 100.0, 0.0, 10.0, 0);
    stage_begin(at);
    const uint8_t keep[2] = { VERGE_KEEP_SPEED, VERGE_KEEP_SPEED };
    for (uint32_t t = 0; t < 5; ++t) {
        stage_step(at, &at->root, keep);
        assert_false(vg_flow_terminal(&at->scene, &at->root)); // the second is in the wrong lane
    }
    stage_clear(at);
    stage_add(at, true, 0, 100.0, 0.0, 10.0, 0);
    stage_add(at, true, 1, 100.0, 0.0, 10.0, -1); // wants nothing: does not matter
    stage_begin(at);
    stage_step(at, &at->root, keep);
    assert_false(vg_flow_terminal(&at->scene, &at->root)); // 15 m of 20 m
    stage_step(at, &at->root, keep);
    assert_true(vg_flow_terminal(&at->scene, &at->root));
    stage_close(at);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(keep_accelerate_decelerate_change_the_state_as_table_1_says),
        cmocka_unit_test(a_change_moves_half_a_lane_and_never_past_the_next_centre),
        cmocka_unit_test(two_steps_make_a_whole_change_and_the_id_flips_with_the_second),
        cmocka_unit_test(short_steps_change_lanes_at_the_same_pace),
        cmocka_unit_test(the_actions_left_are_those_whose_new_speed_lies_in_the_window),
        cmocka_unit_test(who_waits_at_a_lanes_end_sets_off_when_there_is_room_beside),
        cmocka_unit_test(humans_follow_the_idm_behind_the_nearest_vehicle_in_their_path),
        cmocka_unit_test(humans_with_room_never_touch_their_leader_in_steps_up_to_a_second),
        cmocka_unit_test(a_human_stays_in_its_lane_where_the_lane_leads),
        cmocka_unit_test(keeping_a_lane_that_leads_aside_stays_on_its_centre),
        cmocka_unit_test(lanes_shorter_than_a_step_are_passed_in_one),
        cmocka_unit_test(conflicts_are_those_of_bodies_moved_in_small_steps),
        cmocka_unit_test(changing_into_each_others_lanes_is_a_conflict),
        cmocka_unit_test(who_meets_where_lanes_merge_has_a_conflict_first),
        cmocka_unit_test(the_nearest_in_the_path_are_ahead_and_behind),
        cmocka_unit_test(the_reward_is_equation_5_over_the_three_parts_of_each_vehicle),
        cmocka_unit_test(equal_cooperation_of_whatever_size_gives_the_mean),
        cmocka_unit_test(doing_the_right_thing_steadily_earns_everything),
        cmocka_unit_test(a_flow_is_terminal_when_all_have_driven_their_distance_in_the_target),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
