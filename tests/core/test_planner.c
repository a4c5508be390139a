// The planner through its public interface: memory, refusals, and the properties of every plan.
#include "check.h"
#include "closed_loop.h"
#include "rng.h"

#include "verge/verge.h"

#include <math.h>
#include <stdlib.h>

enum { lane_total = 4, canary = 256 };
static const double lane_width = 4.0;
static const double road_length = 1500.0;

static verge_plan plan;

// ---------------------------------------------------------------------------- fixture

typedef struct road {
    verge_lane_def lanes[lane_total];
    double points[lane_total][2][2];
} road;

static verge_planner_def def_on(road* under)
{
    memset(under, 0, sizeof *under);
    for (int i = 0; i < lane_total; ++i) {
        under->points[i][0][1] = under->points[i][1][1] = lane_width * i;
        under->points[i][1][0] = road_length;
        under->lanes[i] = (verge_lane_def){
            .id = i, .points = (const double (*)[2])under->points[i], .point_count = 2,
            .width = lane_width, .speed_limit = 15.0,
            .left = i + 1 < lane_total ? i + 1 : VERGE_NO_LANE,
            .right = i > 0 ? i - 1 : VERGE_NO_LANE,
        };
    }
    verge_planner_def def = verge_planner_default_def();
    def.road = (verge_road_def){ under->lanes, lane_total };
    def.iterations = 300;
    def.nodes_max = 512;
    return def;
}

typedef struct built {
    verge_planner* planner;
    void* memory;
} built;

static built build(const verge_planner_def* def)
{
    const size_t size = verge_planner_memory_size(def);
    built out = { NULL, aligned_alloc(64, (size + 63) / 64 * 64) };
    assert_non_null(out.memory);
    assert_int_equal(verge_planner_init(&out.planner, def, out.memory, size), VERGE_OK);
    return out;
}

static verge_vehicle vehicle_at(int32_t id, bool controlled, int lane, double s, double v,
                                int32_t target)
{
    verge_vehicle vehicle = verge_vehicle_default();
    vehicle.id = id;
    vehicle.controlled = controlled;
    vehicle.x = s;
    vehicle.y = lane_width * lane;
    vehicle.speed = v;
    vehicle.target_lane = target;
    return vehicle;
}

/// Vehicles `apart` metres from one another in each lane, ids scattered.
static uint32_t random_flow(test_rng* rng, verge_vehicle* to, uint32_t controlled, uint32_t humans)
{
    double s[lane_total];
    for (int lane = 0; lane < lane_total; ++lane) {
        s[lane] = test_rng_between(rng, 50.0, 60.0);
    }
    const uint32_t count = controlled + humans;
    for (uint32_t i = 0; i < count; ++i) {
        const int lane = (int)test_rng_below(rng, lane_total);
        const int side = lane == 0 ? 1 : lane == lane_total - 1 ? -1 : 1 - 2 * (int)(i % 2);
        to[i] = vehicle_at((int32_t)(7 * i % 71), i < controlled, lane, s[lane],
                           test_rng_between(rng, 7.0, 10.0), i % 3 == 0 ? -1 : lane + side);
        s[lane] += test_rng_between(rng, 18.0, 30.0);
    }
    return count;
}

static void must_step(verge_planner* planner, int64_t utime, const verge_vehicle* vehicles,
                      uint32_t count)
{
    assert_int_equal(verge_planner_step(planner, utime, vehicles, count, &plan), VERGE_OK);
}

// ---------------------------------------------------------------------------- memory

static void the_memory_asked_for_is_enough_and_nothing_beyond_is_touched(void** state)
{
    (void)state;
    road under;
    test_rng rng = test_rng_seeded("canaries");
    for (uint32_t k = 0; k < 4; ++k) {
        verge_planner_def def = def_on(&under);
        def.nodes_max = k % 2 == 0 ? 64 : 2000;
        def.vehicles_max = k < 2 ? 12 : 64;
        def.controlled_max = k < 2 ? 4 : 16;
        const size_t size = verge_planner_memory_size(&def);
        uint8_t* memory = aligned_alloc(64, (size + 2 * canary + 63) / 64 * 64);
        assert_non_null(memory);
        memset(memory, 0xa5, size + 2 * canary);
        verge_planner* planner = NULL;
        assert_int_equal(verge_planner_init(&planner, &def, memory + canary, size), VERGE_OK);
        verge_vehicle vehicles[12];
        for (int64_t t = 0; t < 3; ++t) {
            must_step(planner, 1000000 * t, vehicles, random_flow(&rng, vehicles, 4, 8));
        }
        for (uint32_t i = 0; i < canary; ++i) {
            assert_int_equal(memory[i], 0xa5);
            assert_int_equal(memory[canary + size + i], 0xa5);
        }
        const verge_counters counters = verge_planner_counters(planner);
        assert_true(counters.arena_size == size && counters.arena_peak <= size);
        free(memory);
    }
}

static void less_memory_than_asked_for_is_refused_whatever_its_size(void** state)
{
    (void)state;
    road under;
    for (uint32_t k = 0; k < 2; ++k) {
        verge_planner_def def = def_on(&under);
        if (k == 1) { // so small that fitting the road takes more than planning
            def.nodes_max = 2;
            def.vehicles_max = def.controlled_max = 1;
        }
        const size_t size = verge_planner_memory_size(&def);
        uint8_t* memory = aligned_alloc(64, (size + canary + 63) / 64 * 64);
        assert_non_null(memory);
        const size_t steps = test_rounds(60);
        for (size_t i = 0; i <= steps; ++i) {
            const size_t given = i == steps ? size - 64 : size * i / steps / 64 * 64;
            verge_planner* planner = (verge_planner*)memory;
            memset(memory, 0xa5, size + canary);
            assert_int_equal(verge_planner_init(&planner, &def, memory, given), VERGE_ERR_MEMORY);
            assert_null(planner);
            for (uint32_t c = 0; c < canary; ++c) {
                assert_int_equal(memory[given + c], 0xa5);
            }
        }
        free(memory);
    }
}

static void memory_that_is_null_or_not_aligned_is_refused(void** state)
{
    (void)state;
    road under;
    const verge_planner_def def = def_on(&under);
    const size_t size = verge_planner_memory_size(&def);
    uint8_t* memory = aligned_alloc(64, (size + 127) / 64 * 64);
    verge_planner* planner = (verge_planner*)memory;
    for (uint32_t shift = 1; shift < 64; shift *= 2) {
        const verge_status status = verge_planner_init(&planner, &def, memory + shift, size);
        assert_int_equal(status, VERGE_ERR_MEMORY);
        assert_null(planner);
    }
    assert_int_equal(verge_planner_init(&planner, &def, NULL, size), VERGE_ERR_MEMORY);
    free(memory);
}

static void the_budget_adds_up(void** state)
{
    (void)state;
    road under;
    const verge_planner_def def = def_on(&under);
    verge_memory_term terms[VERGE_MEMORY_TERMS];
    verge_planner_memory_terms(&def, terms);
    size_t sum = 0;
    for (uint32_t i = 0; i < VERGE_MEMORY_TERMS; ++i) {
        assert_non_null(terms[i].text);
        sum += terms[i].size;
    }
    assert_true(sum == verge_planner_memory_size(&def));
}

static void a_bad_def_or_road_is_refused_and_needs_no_memory(void** state)
{
    (void)state;
    static uint8_t memory[64] __attribute__((aligned(64)));
    road under;
    verge_planner* planner = NULL;
    verge_planner_def def = def_on(&under);
    def.step_s = NAN;
    assert_int_equal(verge_planner_init(&planner, &def, memory, sizeof memory), VERGE_ERR_DEF);
    assert_true(verge_planner_memory_size(&def) == 0);
    def = def_on(&under);
    under.lanes[2].width = -1.0;
    assert_int_equal(verge_planner_init(&planner, &def, memory, sizeof memory), VERGE_ERR_ROAD);
    assert_true(verge_planner_memory_size(&def) == 0);
    assert_null(planner);
}

// ---------------------------------------------------------------------------- refusals

typedef void spoil(verge_vehicle* vehicle);
#define SPOIL(name, statement)                \
    static void name(verge_vehicle* vehicle)  \
    {                                         \
        statement;                            \
    }
SPOIL(id_negative, vehicle->id = -1)
SPOIL(x_nan, vehicle->x = NAN)
SPOIL(x_far, vehicle->x = 1.1e7)
SPOIL(y_infinite, vehicle->y = -INFINITY)
SPOIL(heading_nan, vehicle->heading = NAN)
SPOIL(heading_infinite, vehicle->heading = INFINITY)
SPOIL(speed_negative, vehicle->speed = -15.1)
SPOIL(speed_nan, vehicle->speed = NAN)
SPOIL(speed_large, vehicle->speed = 71.0)
SPOIL(acceleration_nan, vehicle->acceleration = NAN)
SPOIL(acceleration_large, vehicle->acceleration = 31.0)
SPOIL(yaw_infinite, vehicle->yaw_rate = INFINITY)
SPOIL(yaw_large, vehicle->yaw_rate = -5.5)
SPOIL(length_nan, vehicle->length = NAN)
SPOIL(length_small, vehicle->length = 0.4)
SPOIL(length_large, vehicle->length = 30.1)
SPOIL(width_nan, vehicle->width = NAN)
SPOIL(width_small, vehicle->width = 0.2)
SPOIL(width_large, vehicle->width = 4.1)
SPOIL(margin_nan, vehicle->margin = NAN)
SPOIL(margin_negative, vehicle->margin = -0.1)
SPOIL(margin_large, vehicle->margin = 101.0)
SPOIL(target_unknown, vehicle->target_lane = lane_total)
SPOIL(target_negative, vehicle->target_lane = -2)
SPOIL(cooperation_nan, vehicle->habit.cooperation = NAN)
SPOIL(cooperation_large, vehicle->habit.cooperation = 1.01)
SPOIL(cooperation_negative, vehicle->habit.cooperation = -0.01)
SPOIL(curvature_negative, vehicle->habit.weights.curvature = -1.0)
SPOIL(heading_weight_nan, vehicle->habit.weights.heading = NAN)
SPOIL(offset_infinite, vehicle->habit.weights.offset = INFINITY)
SPOIL(acceleration_negative, vehicle->habit.weights.acceleration = -1e-9)
SPOIL(jerk_nan, vehicle->habit.weights.jerk = NAN)
SPOIL(obstacle_large, vehicle->habit.weights.obstacle = 1e7)

static spoil* const spoils[] = {
    id_negative, x_nan, x_far, y_infinite, heading_nan, heading_infinite, speed_negative, speed_nan,
    speed_large, acceleration_nan, acceleration_large, yaw_infinite, yaw_large, length_nan,
    length_small, length_large, width_nan, width_small, width_large, margin_nan, margin_negative,
    margin_large, target_unknown, target_negative, cooperation_nan, cooperation_large,
    cooperation_negative, curvature_negative, heading_weight_nan, offset_infinite,
    acceleration_negative, jerk_nan, obstacle_large,
};

static void a_vehicle_with_one_bad_field_is_refused_and_the_plan_unchanged(void** state)
{
    (void)state;
    road under;
    const verge_planner_def def = def_on(&under);
    const built on = build(&def);
    verge_vehicle vehicles[3] = { vehicle_at(1, true, 0, 100.0, 9.0, 1),
                                  vehicle_at(2, true, 1, 130.0, 9.0, -1),
                                  vehicle_at(3, false, 2, 100.0, 9.0, -1) };
    must_step(on.planner, 1, vehicles, 3);
    static verge_plan before;
    memcpy(&before, &plan, sizeof plan);
    for (uint32_t k = 0; k < sizeof spoils / sizeof spoils[0]; ++k) {
        const verge_vehicle kept = vehicles[1];
        spoils[k](&vehicles[1]);
        const verge_road* on_road = verge_planner_road(on.planner);
        verge_vehicle_fault fault = { .field = NULL };
        const verge_status alone = verge_road_check_vehicle(on_road, &vehicles[1], NULL);
        const verge_status status = verge_planner_step(on.planner, 2, vehicles, 3, &plan);
        assert_int_equal(verge_vehicles_check(on_road, vehicles, 3, &fault), VERGE_ERR_VEHICLE);
        assert_int_equal(fault.vehicle_index, 1);
        assert_int_equal(fault.vehicle_id, vehicles[1].id);
        assert_non_null(fault.field);
        assert_true(fault.expected != NULL
                    || !(fault.value >= fault.min && fault.value <= fault.max));
        vehicles[1] = kept;
        assert_int_equal(verge_vehicles_check(on_road, vehicles, 3, &fault), VERGE_OK);
        assert_null(fault.field);
        if (status != VERGE_ERR_VEHICLE || alone != VERGE_ERR_VEHICLE) {
            fail_msg("spoil %u: step says %d, check says %d", k, status, alone);
        }
        assert_memory_equal(&before, &plan, sizeof plan);
    }
    assert_int_equal(verge_road_check_vehicle(verge_planner_road(on.planner), &vehicles[1], NULL),
                     VERGE_OK);
    vehicles[1].y = 300.0;
    assert_int_equal(verge_road_check_vehicle(verge_planner_road(on.planner), &vehicles[1], NULL),
                     VERGE_ERR_OFF_ROAD);
    free(on.memory);
}

static void far_from_the_origin_the_same_plan_is_made(void** state)
{
    (void)state;
    static const double shifts[][2] = { { 9.9e6, -9.9e6 }, { -5.3e5, 5.8e6 } }; // and a UTM zone's
    static verge_plan near;
    road under;
    verge_vehicle vehicles[3] = { vehicle_at(1, true, 0, 100.0, 9.0, 1),
                                  vehicle_at(2, true, 1, 130.0, 9.0, -1),
                                  vehicle_at(3, false, 2, 100.0, 9.0, -1) };
    verge_planner_def def = def_on(&under);
    built on = build(&def);
    must_step(on.planner, 1, vehicles, 3);
    near = plan;
    free(on.memory);
    for (size_t k = 0; k < sizeof shifts / sizeof shifts[0]; ++k) {
        const double dx = shifts[k][0], dy = shifts[k][1];
        verge_vehicle moved[3];
        def = def_on(&under);
        for (int i = 0; i < lane_total; ++i) {
            for (int end = 0; end < 2; ++end) {
                under.points[i][end][0] += dx;
                under.points[i][end][1] += dy;
            }
        }
        for (int i = 0; i < 3; ++i) {
            moved[i] = vehicles[i];
            moved[i].x += dx;
            moved[i].y += dy;
        }
        on = build(&def);
        must_step(on.planner, 1, moved, 3);
        free(on.memory);
        assert_int_equal(plan.vehicle_count, near.vehicle_count);
        for (uint32_t i = 0; i < near.vehicle_count; ++i) {
            const verge_vehicle_plan *a = &plan.vehicles[i], *b = &near.vehicles[i];
            assert_int_equal(a->status, b->status);
            assert_int_equal(a->point_count, b->point_count);
            for (uint32_t p = 0; p < b->point_count; ++p) {
                CHECK_NEAR(a->points[p].x - dx, b->points[p].x, 1e-3);
                CHECK_NEAR(a->points[p].y - dy, b->points[p].y, 1e-3);
            }
        }
    }
}

static void what_a_human_does_not_need_is_not_asked_of_it(void** state)
{
    (void)state;
    road under;
    const verge_planner_def def = def_on(&under);
    const built on = build(&def);
    verge_vehicle human = vehicle_at(1, false, 0, 100.0, 9.0, -1);
    human.habit.cooperation = NAN;
    human.habit.weights.offset = -1.0;
    human.yaw_rate = NAN;
    must_step(on.planner, 1, &human, 1);
    free(on.memory);
}

static void duplicates_and_crowds_are_refused(void** state)
{
    (void)state;
    road under;
    verge_planner_def def = def_on(&under);
    def.vehicles_max = 6;
    def.controlled_max = 2;
    const built on = build(&def);
    verge_vehicle vehicles[7];
    for (int i = 0; i < 7; ++i) {
        vehicles[i] = vehicle_at(i, false, 0, 100.0 + 20.0 * i, 9.0, -1);
    }
    assert_int_equal(verge_planner_step(on.planner, 1, vehicles, 7, &plan), VERGE_ERR_CAPACITY);
    vehicles[0].controlled = vehicles[1].controlled = vehicles[2].controlled = true;
    assert_int_equal(verge_planner_step(on.planner, 1, vehicles, 6, &plan), VERGE_ERR_CAPACITY);
    vehicles[2].controlled = false;
    vehicles[5].id = 0;
    assert_int_equal(verge_planner_step(on.planner, 1, vehicles, 6, &plan), VERGE_ERR_DUPLICATE);
    verge_vehicle_fault fault;
    assert_int_equal(verge_vehicles_check(verge_planner_road(on.planner), vehicles, 6, &fault),
                     VERGE_ERR_DUPLICATE);
    assert_string_equal(fault.field, "id");
    assert_true(fault.value == (double)vehicles[fault.vehicle_index].id);
    vehicles[5].id = 5;
    must_step(on.planner, 1, vehicles, 6);
    assert_int_equal(verge_planner_counters(on.planner).steps, 1); // refused ones do not count
    free(on.memory);
}

// ---------------------------------------------------------------------------- what a plan holds

static bool finite_point(const verge_point* p)
{
    return isfinite(p->x) && isfinite(p->y) && isfinite(p->heading) && isfinite(p->speed)
           && isfinite(p->acceleration) && isfinite(p->curvature) && isfinite(p->jerk);
}

static const verge_vehicle* find(const verge_vehicle* vehicles, uint32_t count, int32_t id)
{
    for (uint32_t i = 0; i < count; ++i) {
        if (vehicles[i].id == id) {
            return &vehicles[i];
        }
    }
    fail_msg("the plan speaks of vehicle %d, which nobody sent", id);
    return NULL;
}

static void check_vehicle_plan(const verge_planner_def* def, const verge_vehicle_plan* of,
                               const verge_vehicle* vehicle)
{
    assert_true(vehicle->controlled);
    assert_int_equal(of->point_count, def->points);
    assert_int_equal(of->action_count, def->steps);
    assert_true((of->status == VERGE_PLANNED) == (of->reason == VERGE_REASON_NONE));
    CHECK_NEAR(of->points[0].x, vehicle->x, 1e-6);
    CHECK_NEAR(of->points[0].y, vehicle->y, 1e-6);
    CHECK_NEAR(of->points[0].speed, vehicle->speed, 1e-6);
    for (uint32_t k = 0; k < of->point_count; ++k) {
        assert_true(finite_point(&of->points[k]));
        CHECK_NEAR(of->points[k].t, k * def->point_s, 1e-9);
        CHECK_BETWEEN(of->points[k].heading, -M_PI - 1e-12, M_PI + 1e-12);
        assert_true(of->points[k].speed >= 0.0);
    }
    for (uint32_t t = 0; t < of->action_count; ++t) {
        const verge_action_step* step = &of->actions[t];
        CHECK_NEAR(step->t0, t * def->step_s, 1e-9);
        CHECK_NEAR(step->t1, (t + 1) * def->step_s, 1e-9);
        assert_true((unsigned)step->action < VERGE_ACTION_COUNT);
        assert_true(isfinite(step->s) && isfinite(step->d) && step->v >= 0.0);
        assert_true(step->ahead_id != of->vehicle_id && step->behind_id != of->vehicle_id);
        char text[160];
        const size_t length = verge_action_say(step, text, sizeof text);
        assert_true(length > 5 && length == strlen(text));
    }
}

static void check_plan(const verge_planner_def* def, const verge_vehicle* vehicles, uint32_t count)
{
    uint32_t controlled = 0, fallbacks = 0;
    for (uint32_t i = 0; i < count; ++i) {
        controlled += vehicles[i].controlled;
    }
    assert_int_equal(plan.vehicle_count, controlled);
    assert_int_equal(plan.prediction_count, count - controlled);
    for (uint32_t i = 0; i < plan.vehicle_count; ++i) {
        const verge_vehicle_plan* of = &plan.vehicles[i];
        assert_true(i == 0 || plan.vehicles[i - 1].vehicle_id < of->vehicle_id);
        check_vehicle_plan(def, of, find(vehicles, count, of->vehicle_id));
        fallbacks += of->status != VERGE_PLANNED;
    }
    assert_int_equal(plan.fallback_count, fallbacks);
    for (uint32_t i = 0; i < plan.prediction_count; ++i) {
        const verge_prediction* of = &plan.predictions[i];
        const verge_vehicle* vehicle = find(vehicles, count, of->vehicle_id);
        assert_false(vehicle->controlled);
        assert_int_equal(of->point_count, def->points);
        CHECK_NEAR(of->points[0].x, vehicle->x, 0.0);
        CHECK_NEAR(of->points[0].y, vehicle->y, 0.0);
        for (uint32_t k = 0; k < of->point_count; ++k) {
            CHECK_NEAR(of->points[k].t, k * def->point_s, 1e-9);
            assert_true(isfinite(of->points[k].x) && isfinite(of->points[k].y)
                        && isfinite(of->points[k].heading));
        }
    }
}

static void every_controlled_vehicle_is_planned_and_every_other_one_predicted(void** state)
{
    (void)state;
    test_rng rng = test_rng_seeded("whole plans");
    road under;
    const verge_planner_def def = def_on(&under);
    const built on = build(&def);
    for (uint32_t k = 0; k < test_rounds(20); ++k) {
        verge_vehicle vehicles[VERGE_VEHICLES_MAX];
        const uint32_t count =
            random_flow(&rng, vehicles, 1 + test_rng_below(&rng, 8), test_rng_below(&rng, 10));
        must_step(on.planner, 1000000 * k, vehicles, count);
        check_plan(&def, vehicles, count);
        assert_int_equal(plan.utime, 1000000 * k);
        assert_int_equal(plan.search.iterations, def.iterations);
        CHECK_BETWEEN(plan.search.reward, 0.0, 1.0);
    }
    free(on.memory);
}

static void the_full_capacity_works(void** state)
{
    (void)state;
    test_rng rng = test_rng_seeded("full house");
    road under;
    verge_planner_def def = def_on(&under);
    def.iterations = test_rounds(200);
    const built on = build(&def);
    verge_vehicle vehicles[VERGE_VEHICLES_MAX];
    const uint32_t count = random_flow(&rng, vehicles, VERGE_CONTROLLED_MAX,
                                       VERGE_VEHICLES_MAX - VERGE_CONTROLLED_MAX);
    must_step(on.planner, 1, vehicles, count);
    check_plan(&def, vehicles, count);
    free(on.memory);
}

static void nobody_or_only_humans_is_no_error(void** state)
{
    (void)state;
    road under;
    const verge_planner_def def = def_on(&under);
    const built on = build(&def);
    must_step(on.planner, 1, NULL, 0);
    assert_int_equal(plan.vehicle_count + plan.prediction_count, 0);
    const verge_vehicle humans[2] = { vehicle_at(4, false, 0, 100.0, 9.0, -1),
                                      vehicle_at(2, false, 0, 130.0, 5.0, -1) };
    must_step(on.planner, 2, humans, 2);
    check_plan(&def, humans, 2);
    must_step(on.planner, 3, NULL, 0);
    free(on.memory);
}

static void a_vehicle_off_the_road_gets_a_fallback_and_the_others_their_plans(void** state)
{
    (void)state;
    road under;
    const verge_planner_def def = def_on(&under);
    const built on = build(&def);
    verge_vehicle vehicles[4] = { vehicle_at(1, true, 0, 100.0, 9.0, 1),
                                  vehicle_at(2, true, 0, 200.0, 9.0, -1),
                                  vehicle_at(3, false, 0, 100.0, 9.0, -1),
                                  vehicle_at(4, true, 2, 100.0, 9.0, -1) };
    vehicles[1].y = 200.0;
    vehicles[2].y = -150.0;
    must_step(on.planner, 1, vehicles, 4);
    check_plan(&def, vehicles, 4);
    assert_int_equal(plan.vehicles[0].status, VERGE_PLANNED);
    assert_int_equal(plan.vehicles[1].reason, VERGE_REASON_OFF_ROAD);
    assert_int_equal(plan.vehicles[2].status, VERGE_PLANNED);
    assert_int_equal(plan.fallback_count, 1);
    const verge_vehicle_plan* off = &plan.vehicles[1];
    for (uint32_t t = 0; t < off->action_count; ++t) {
        assert_int_equal(off->actions[t].action, VERGE_DECELERATE);
        assert_int_equal(off->actions[t].lane_id, VERGE_NO_LANE);
    }
    assert_true(off->points[off->point_count - 1].speed < vehicles[1].speed);
    // The human beside the road is believed to go straight on.
    const verge_pose* last = &plan.predictions[0].points[def.points - 1];
    CHECK_NEAR(last->x, 100.0 + 9.0 * last->t, 1e-6);
    CHECK_NEAR(last->y, -150.0, 1e-6);
    free(on.memory);
}

// ---------------------------------------------------------------------------- sameness

static void the_order_of_the_vehicles_does_not_matter(void** state)
{
    (void)state;
    test_rng rng = test_rng_seeded("order");
    road under;
    const verge_planner_def def = def_on(&under);
    const built on = build(&def);
    for (uint32_t k = 0; k < test_rounds(6); ++k) {
        verge_vehicle vehicles[16];
        const uint32_t count = random_flow(&rng, vehicles, 6, 6);
        verge_planner_reset(on.planner);
        must_step(on.planner, 1, vehicles, count);
        const uint64_t digest = plan.digest;
        for (uint32_t i = count - 1; i > 0; --i) {
            const uint32_t j = test_rng_below(&rng, i + 1);
            const verge_vehicle kept = vehicles[i];
            vehicles[i] = vehicles[j];
            vehicles[j] = kept;
        }
        verge_planner_reset(on.planner);
        must_step(on.planner, 1, vehicles, count);
        assert_true(plan.digest == digest);
    }
    free(on.memory);
}

static void two_planners_of_one_def_stay_together_and_a_reset_starts_over(void** state)
{
    (void)state;
    test_rng rng = test_rng_seeded("sameness");
    road under;
    const verge_planner_def def = def_on(&under);
    const built one = build(&def), two = build(&def);
    verge_vehicle flows[4][12];
    uint64_t digests[4];
    for (uint32_t k = 0; k < 4; ++k) {
        const uint32_t count = random_flow(&rng, flows[k], 4, 8);
        must_step(one.planner, 500000 * k, flows[k], count);
        digests[k] = plan.digest;
        must_step(two.planner, 500000 * k, flows[k], count);
        assert_true(plan.digest == digests[k]);
    }
    verge_planner_reset(one.planner);
    for (uint32_t k = 0; k < 4; ++k) {
        must_step(one.planner, 500000 * k, flows[k], 12);
        assert_true(plan.digest == digests[k]);
    }
    free(one.memory);
    free(two.memory);
}

static void tasks_in_reverse(void* context, void (*task)(void* arg, uint32_t index), void* arg,
                             uint32_t count)
{
    *(uint32_t*)context += count;
    for (uint32_t i = count; i > 0; --i) {
        task(arg, i - 1);
    }
}

static void the_executor_does_not_change_the_plan(void** state)
{
    (void)state;
    test_rng rng = test_rng_seeded("executor");
    road under;
    verge_planner_def def = def_on(&under);
    const built alone = build(&def);
    uint32_t tasks = 0;
    def.executor = tasks_in_reverse;
    def.executor_context = &tasks;
    const built spread = build(&def);
    verge_vehicle vehicles[12];
    const uint32_t count = random_flow(&rng, vehicles, 8, 4);
    must_step(alone.planner, 1, vehicles, count);
    const uint64_t digest = plan.digest;
    must_step(spread.planner, 1, vehicles, count);
    assert_true(plan.digest == digest);
    assert_true(tasks >= 8);
    free(alone.memory);
    free(spread.memory);
}

/// Drives all vehicles exactly as planned and predicted for `cycle` seconds.
static void drive_on(const verge_planner_def* def, verge_vehicle* vehicles, uint32_t count,
                     double cycle)
{
    const uint32_t k = (uint32_t)(cycle / def->point_s + 0.5);
    for (uint32_t i = 0; i < count; ++i) {
        verge_vehicle* v = &vehicles[i];
        for (uint32_t p = 0; p < plan.vehicle_count; ++p) {
            if (plan.vehicles[p].vehicle_id == v->id) {
                take_point(v, &plan.vehicles[p].points[k]);
            }
        }
        for (uint32_t p = 0; p < plan.prediction_count; ++p) {
            if (plan.predictions[p].vehicle_id == v->id) {
                const verge_pose* at = &plan.predictions[p].points[k];
                v->x = at->x;
                v->y = at->y;
            }
        }
    }
}

static void nothing_new_means_the_same_actions(void** state)
{
    (void)state;
    road under;
    verge_planner_def def = def_on(&under);
    def.iterations = 1000;
    const built on = build(&def);
    // At the speed limit: a change of lanes is all there is to do.
    verge_vehicle vehicles[3] = { vehicle_at(1, true, 0, 100.0, 15.0, 1),
                                  vehicle_at(2, true, 1, 40.0, 15.0, -1),
                                  vehicle_at(3, true, 2, 90.0, 15.0, -1) };
    must_step(on.planner, 0, vehicles, 3);
    verge_action now[3];
    uint32_t switches = 0;
    for (uint32_t i = 0; i < 3; ++i) {
        now[i] = plan.vehicles[i].actions[0].action;
    }
    for (uint32_t cycle = 1; cycle <= 60; ++cycle) { // 6 s
        drive_on(&def, vehicles, 3, 0.1);
        must_step(on.planner, 100000 * (int64_t)cycle, vehicles, 3);
        assert_int_equal(plan.fallback_count, 0);
        for (uint32_t i = 0; i < 3; ++i) {
            switches += plan.vehicles[i].actions[0].action != now[i];
            now[i] = plan.vehicles[i].actions[0].action;
        }
    }
    CHECK_AT_MOST(switches, 4); // it begins once, ends once, and regains its speed once
    CHECK_NEAR(vehicles[0].y, lane_width, 0.5);
    CHECK_NEAR(vehicles[1].y, lane_width, 0.5);
    CHECK_NEAR(vehicles[2].y, 2 * lane_width, 0.5);
    free(on.memory);
}

/// Alone, 7 m/s: a change planned anew twice a second takes as long as it was planned to at first.
static void a_change_takes_as_long_as_it_was_planned_to(void** state)
{
    (void)state;
    road under;
    const verge_planner_def def = def_on(&under);
    built one = build(&def);
    verge_vehicle vehicle = vehicle_at(1, true, 1, 50.0, 7.0, 2);
    double crossed = 0.0, centred = 0.0;
    for (int cycle = 0; cycle < 12 && centred == 0.0; ++cycle) {
        must_step(one.planner, cycle * 500000, &vehicle, 1);
        for (int k = 1; k <= 5; ++k) {
            const double t = 0.5 * cycle + 0.1 * k;
            const double y = plan.vehicles[0].points[k].y;
            crossed = crossed == 0.0 && y > 1.5 * lane_width ? t : crossed;
            centred = centred == 0.0 && y > 2.0 * lane_width - 0.5 ? t : centred;
        }
        drive_on(&def, &vehicle, 1, 0.5);
    }
    // Steering at 0.4 rad/s allows no less than 3.2 s for the whole.
    CHECK_BETWEEN(crossed, 1.2, 2.0);
    CHECK_BETWEEN(centred, crossed + 0.3, 3.2);
    free(one.memory);
}

/// A change that has arrived is over: the next trajectory does not continue it, and the decision's
/// acceleration is driven again.
static void a_change_that_has_arrived_is_not_continued(void** state)
{
    (void)state;
    road under;
    const verge_planner_def def = def_on(&under);
    built one = build(&def);
    for (int32_t start = 0; start < 3; ++start) {
        const int32_t target = start == 1 ? 2 : 1;
        verge_vehicle vehicle = vehicle_at(1, true, start, 50.0, 7.0, target);
        verge_planner_reset(one.planner);
        uint32_t arrived = 0, changes = 0;
        for (int cycle = 0; cycle < 16; ++cycle) {
            const bool there = fabs(vehicle.y - target * lane_width) < 0.2;
            must_step(one.planner, cycle * 500000, &vehicle, 1);
            const bool changing = plan.vehicles[0].change_lane_id != VERGE_NO_LANE;
            assert_true(!there || !changing);
            arrived += there;
            changes += changing;
            drive_on(&def, &vehicle, 1, 0.5);
        }
        assert_true(arrived >= 4 && changes >= 3);
        CHECK_BETWEEN(vehicle.speed, 7.0 + 1.0, 25.0);
    }
    free(one.memory);
}

/// A convoy behind a human who brakes at 2.5 m/s^2, in either order of ids: in each cycle the front
/// vehicle brakes for the human, whatever was predicted of those behind it, and nobody meets.
static void a_convoy_brakes_from_its_front(void** state)
{
    (void)state;
    enum { cars = 5 };
    road under;
    const verge_planner_def def = def_on(&under);
    built on = build(&def);
    for (int order = 0; order < 2; ++order) {
        verge_vehicle vehicles[cars + 1];
        for (int i = 0; i < cars; ++i) { // 0.8 s behind one another
            vehicles[i] = vehicle_at(order == 0 ? i : cars - i, true, 1, 50.0 + 15.0 * i, 12.0, -1);
        }
        vehicles[cars] = vehicle_at(40, false, 1, 50.0 + 15.0 * cars, 12.0, -1);
        verge_planner_reset(on.planner);
        uint32_t fallbacks = 0;
        for (int cycle = 0; cycle < 24; ++cycle) {
            must_step(on.planner, cycle * 500000, vehicles, cars + 1);
            fallbacks += plan.fallback_count;
            verge_vehicle human = vehicles[cars];
            drive_on(&def, vehicles, cars, 0.5);
            human.acceleration = human.speed > 1.5 ? -2.5 : 0.0;
            human.x += 0.5 * human.speed + 0.125 * human.acceleration;
            human.speed += 0.5 * human.acceleration;
            vehicles[cars] = human;
            for (int i = 0; i < cars; ++i) {
                assert_false(verge_vehicles_overlap(&vehicles[i], &vehicles[i + 1]));
            }
        }
        CHECK_AT_MOST(fallbacks, 4);
    }
    free(on.memory);
}

static void humans_drive_by_the_idm_and_are_predicted_as_measured(void** state)
{
    (void)state;
    road under;
    const verge_planner_def def = def_on(&under);
    const built on = build(&def);
    verge_vehicle vehicles[4] = { vehicle_at(1, true, 0, 120.0, 3.0, -1),
                                  vehicle_at(2, false, 0, 90.0, 9.0, -1),
                                  vehicle_at(3, false, 2, 90.0, 9.0, -1),
                                  vehicle_at(4, false, 50, 90.0, 9.0, -1) };
    vehicles[3].heading = 1.0; // off the road
    must_step(on.planner, 0, vehicles, 4);
    verge_vehicle advanced[4];
    memcpy(advanced, vehicles, sizeof vehicles);
    const size_t size = (verge_humans_memory_size(&def) + 63) / 64 * 64;
    void* memory = aligned_alloc(64, size);
    verge_humans* humans = NULL;
    assert_int_equal(verge_humans_init(&humans, &def, memory, size), VERGE_OK);
    assert_int_equal(verge_humans_advance(humans, verge_planner_road(on.planner), NULL, advanced, 4, def.point_s),
                     VERGE_OK);
    free(memory);
    assert_memory_equal(&advanced[0], &vehicles[0], sizeof vehicles[0]);
    // Behind a slow one both brake; where the road is free one speeds up, the other may not.
    assert_true(advanced[1].speed < 9.0 && advanced[2].speed > 9.0);
    assert_true(plan.predictions[0].points[30].x < 90.0 + 3.0 * 9.0 - 1.0);
    CHECK_NEAR(plan.predictions[1].points[30].x, 90.0 + 3.0 * 9.0, 1e-3);
    CHECK_NEAR(advanced[3].x, plan.predictions[2].points[1].x, 1e-4); // off the road: straight on
    CHECK_NEAR(advanced[3].y, plan.predictions[2].points[1].y, 1e-4);
    vehicles[2].speed = 0.0; // a standing vehicle is predicted to stand
    verge_planner_reset(on.planner);
    must_step(on.planner, 0, vehicles, 4);
    CHECK_NEAR(plan.predictions[1].points[30].x, 90.0, 0.1);
    vehicles[2].speed = 9.0; // a braking vehicle is predicted to continue braking
    vehicles[2].acceleration = -6.0;
    must_step(on.planner, 0, vehicles, 4);
    CHECK_AT_MOST(plan.predictions[1].points[30].x, 90.0 + 9.0 * 9.0 / (2.0 * 6.0) + 1.0);
    free(on.memory);
}

static void sentences_say_what_a_step_does_and_fit_their_space(void** state)
{
    (void)state;
    const verge_action_step step = { .action = VERGE_CHANGE_RIGHT, .ahead_id = 3, .behind_id = 12 };
    char text[128];
    (void)verge_action_say(&step, text, sizeof text);
    assert_string_equal(text, "changing to the right lane behind vehicle 3, ahead of vehicle 12");
    for (size_t size = 1; size < 64; ++size) {
        char small[65];
        memset(small, '#', sizeof small);
        assert_true(verge_action_say(&step, small, size) == size - 1);
        assert_int_equal(small[size - 1], '\0');
        assert_int_equal(small[size], '#');
        assert_memory_equal(small, text, size - 1);
    }
    assert_true(verge_action_say(&step, NULL, 0) == 0);
    for (int32_t k = -9; k < 9; ++k) { // no value is without words
        assert_non_null(verge_status_text((verge_status)k));
        assert_non_null(verge_reason_text((verge_reason)k));
        assert_non_null(verge_action_name((verge_action)k));
    }
}

static void bodies_touch_as_rectangles_do(void** state)
{
    (void)state;
    const verge_vehicle a = vehicle_at(1, true, 0, 0.0, 0.0, -1);
    verge_vehicle b = vehicle_at(2, true, 0, 5.5, 0.0, -1);
    assert_false(verge_vehicles_overlap(&a, &b));
    CHECK_NEAR(verge_vehicles_distance(&a, &b), 0.5, 1e-9);
    b.margin = 0.6;
    assert_true(verge_vehicles_overlap(&a, &b));
    CHECK_NEAR(verge_vehicles_distance(&a, &b), 0.0, 0.0);
    b.margin = 0.0;
    b.heading = M_PI / 2.0;
    CHECK_NEAR(verge_vehicles_distance(&a, &b), 2.0, 1e-9);
}

/// Two posts appear so near on both sides of the announced path that no sampled trajectory leaves
/// enough room beside them, though nothing touches.
static void a_fallback_goes_on_with_a_change_of_lane_and_remembers_it(void** state)
{
    (void)state;
    road under;
    verge_planner_def def = def_on(&under);
    built at = build(&def);
    verge_vehicle vehicles[3] = { vehicle_at(1, true, 1, 100.0, 15.0, 2) };
    int64_t utime = 1000000;
    do { // until it is on its way between the lanes
        must_step(at.planner, utime, vehicles, 1);
        take_point(&vehicles[0], &plan.vehicles[0].points[5]);
        utime += 500000;
        assert_true(utime < 20000000);
    } while (vehicles[0].y < lane_width * 1.15);
    const verge_vehicle_plan last = plan.vehicles[0];
    assert_int_equal(last.change_lane_id, 2);

    const verge_point* beside = &last.points[5 + 6];
    for (int side = 0; side < 2; ++side) {
        verge_vehicle* post = &vehicles[1 + side];
        *post = vehicle_at(2 + side, false, 0, 0.0, 0.0, VERGE_NO_LANE);
        post->length = post->width = 0.5;
        const double away = (side == 0 ? 1.0 : -1.0) * (1.0 + 0.25 + 0.16);
        post->x = beside->x - away * sin(beside->heading);
        post->y = beside->y + away * cos(beside->heading);
        post->heading = beside->heading;
    }
    must_step(at.planner, utime, vehicles, 3);
    const verge_vehicle_plan* now = &plan.vehicles[0];
    assert_int_equal(now->status, VERGE_FALLBACK_KEEP_LANE);
    assert_int_equal(now->reason, VERGE_REASON_COLLISION);
    assert_int_equal(now->change_lane_id, 2);
    CHECK_NEAR(now->change_end, last.change_end - 0.5, 1e-9);
    for (uint32_t k = 0; k + 5 < def.points; ++k) {
        CHECK_NEAR(now->points[k].x, last.points[k + 5].x, 0.1);
        CHECK_NEAR(now->points[k].y, last.points[k + 5].y, 0.02);
    }
    CHECK_AT_MOST(now->points[def.points - 1].acceleration, -1.0); // a stop after its end
    free(at.memory);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(the_memory_asked_for_is_enough_and_nothing_beyond_is_touched),
        cmocka_unit_test(less_memory_than_asked_for_is_refused_whatever_its_size),
        cmocka_unit_test(memory_that_is_null_or_not_aligned_is_refused),
        cmocka_unit_test(the_budget_adds_up),
        cmocka_unit_test(a_bad_def_or_road_is_refused_and_needs_no_memory),
        cmocka_unit_test(a_vehicle_with_one_bad_field_is_refused_and_the_plan_unchanged),
        cmocka_unit_test(far_from_the_origin_the_same_plan_is_made),
        cmocka_unit_test(what_a_human_does_not_need_is_not_asked_of_it),
        cmocka_unit_test(duplicates_and_crowds_are_refused),
        cmocka_unit_test(every_controlled_vehicle_is_planned_and_every_other_one_predicted),
        cmocka_unit_test(the_full_capacity_works),
        cmocka_unit_test(nobody_or_only_humans_is_no_error),
        cmocka_unit_test(a_vehicle_off_the_road_gets_a_fallback_and_the_others_their_plans),
        cmocka_unit_test(the_order_of_the_vehicles_does_not_matter),
        cmocka_unit_test(two_planners_of_one_def_stay_together_and_a_reset_starts_over),
        cmocka_unit_test(the_executor_does_not_change_the_plan),
        cmocka_unit_test(nothing_new_means_the_same_actions),
        cmocka_unit_test(a_change_takes_as_long_as_it_was_planned_to),
        cmocka_unit_test(a_change_that_has_arrived_is_not_continued),
        cmocka_unit_test(a_convoy_brakes_from_its_front),
        cmocka_unit_test(humans_drive_by_the_idm_and_are_predicted_as_measured),
        cmocka_unit_test(sentences_say_what_a_step_does_and_fit_their_space),
        cmocka_unit_test(bodies_touch_as_rectangles_do),
        cmocka_unit_test(a_fallback_goes_on_with_a_change_of_lane_and_remembers_it),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
