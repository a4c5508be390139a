/// Goal: from the bytes of plan and state messages a vehicle makes the trajectory of its roadside
///       unit, bit for bit; where the two had different input, it says so, and which.
/// Method: the closed loop of the shipped scenarios, with random vehicles, planned or not, speeds,
///         errors of measurement and lost messages. The roadside unit is the daemon's cycle. Each
///         message is encoded and decoded. The vehicle has a planner of its own, with another seed.
#include "check.h"
#include "rng.h"

#include "common/world.h"
#include "rsu/cycle.h"

#include "codec.h"
#include "verge/message.h"
#include "verge/repeat.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { TICKS = 5, CYCLES_OF_EPISODE = 20 }; // of 0.1 s in a cycle
static const int64_t EPOCH = 1700000000000000; // [us]

static const char* const SCENES[] = {
    "freeway-4av-2hv", "ramp-case1", "crossing", "roundabout", "zipper", "overtaking", "ramp-case3",
};
enum { SCENE_COUNT = sizeof SCENES / sizeof SCENES[0] };

/// What is not heard of the states.
typedef struct losses {
    double  share;   ///< of all states: heard by nobody
    int32_t rsu_id;  ///< states of this vehicle do not reach the roadside unit, -1 none
    int32_t unit_id; ///< states of this vehicle do not reach the unit on board, -1 none
    bool    last;    ///< of these two vehicles it is only the last state before the cycle
} losses;

typedef struct episode {
    scenario       scene;
    world          world;
    void*          memory[2];
    verge_planner* planners[2]; ///< of the roadside unit, of the vehicle
    cycle          rsu;
    repeat         unit;
    repeat_result  result;
    int32_t        own_id;      ///< the vehicle on board of which the unit is
    int64_t        number;      ///< of the next cycle
} episode;

static verge_planner* planner_of(const verge_planner_def* def, void** memory)
{
    verge_planner* planner = NULL;
    const size_t size = (verge_planner_memory_size(def) + 63) / 64 * 64;
    *memory = aligned_alloc(64, size);
    assert_non_null(*memory);
    assert_int_equal(verge_planner_init(&planner, def, *memory, size), VERGE_OK);
    return planner;
}

/// Which vehicles there are, which of them are planned, and how they begin.
static void draw_vehicles(episode* self, test_rng* rng)
{
    for (uint32_t i = 0; i < self->scene.vehicle_count; ++i) {
        verge_vehicle* start = &self->scene.vehicles[i].start;
        start->controlled = test_rng_unit(rng) < 0.6;
        start->target_lane = start->controlled ? start->target_lane : VERGE_NO_LANE;
        start->speed *= test_rng_between(rng, 0.3, 1.6);
        const double along = test_rng_between(rng, -6.0, 6.0);
        start->x += along * cos(start->heading);
        start->y += along * sin(start->heading);
    }
    self->own_id = self->scene.vehicles[0].start.id;
    self->scene.vehicles[0].start.controlled = true;
}

static episode* open_episode(const char* name, const verge_planner_def* steps, test_rng* rng)
{
    char path[512];
    episode* self = calloc(1, sizeof *self);
    assert_non_null(self);
    snprintf(path, sizeof path, "%s/apps/scenarios/%s.json", VERGE_SOURCE_DIR, name);
    if (!scenario_load(&self->scene, path, NULL)) {
        fail_msg("%s", self->scene.file.error);
    }
    draw_vehicles(self, rng);
    assert_true(world_init(&self->world, &self->scene));
    for (uint32_t i = 1; i < self->scene.vehicle_count; ++i) {
        self->world.vehicles[i].left = test_rng_unit(rng) < 0.1;
        self->world.vehicles[i].present = !self->world.vehicles[i].left;
    }
    verge_planner_def def = self->scene.def;
    def.iterations = 200;
    def.step_s = steps->step_s;
    def.steps = steps->steps;
    self->planners[0] = planner_of(&def, &self->memory[0]);
    const uint32_t map_crc32 = wire_map_crc32(&def.road);
    const cycle_def how = { self->planners[0], def.vehicles_max, def.controlled_max,
                            inbox_default_limits(), 9, map_crc32 };
    cycle_init(&self->rsu, &how);
    def.seed = 77;
    def.iterations = 1;
    def.nodes_max = 2;
    self->planners[1] = planner_of(&def, &self->memory[1]);
    const repeat_def on_board = { self->planners[1], def.vehicles_max, def.controlled_max,
                                  inbox_default_limits(), map_crc32 };
    repeat_init(&self->unit, &on_board);
    return self;
}

static void close_episode(episode* self)
{
    world_free(&self->world);
    scenario_free(&self->scene);
    free(self->memory[0]);
    free(self->memory[1]);
    free(self);
}

/// Over the wire and back.
static const transport_message* carried(transport_kind kind, const void* value)
{
    static transport_message sealed, received;
    uint8_t bytes[CODEC_SIZE_MAX];
    message_seal(kind, value, &sealed.as);
    const size_t size = codec_encode(kind, &sealed.as, bytes);
    assert_true(codec_decode(kind, bytes, size, &received));
    return &received;
}

/// What a vehicle says of itself now: what it measures.
static verge_vehicle_state_t measured(const episode* self, const verge_vehicle* vehicle,
                                      test_rng* rng)
{
    verge_vehicle seen = *vehicle;
    seen.x += test_rng_between(rng, -0.05, 0.05);
    seen.y += test_rng_between(rng, -0.05, 0.05);
    seen.heading += test_rng_between(rng, -0.005, 0.005);
    seen.speed += seen.speed > 1.0 ? test_rng_between(rng, -0.1, 0.1) : 0.0;
    return wire_state_from_vehicle(&seen, VERGE_NORMAL, EPOCH + world_utime(&self->world),
                                   (int32_t)self->world.tick, -1);
}

static void hear_rsu(episode* self, const verge_vehicle_state_t* state)
{
    transport_message message = *carried(TRANSPORT_STATE, state);
    message.arrival_utime = state->utime + 3000;
    assert_true(cycle_offer(&self->rsu, &message));
}

static void hear_unit(episode* self, const verge_vehicle_state_t* state)
{
    repeat_state(&self->unit, &carried(TRANSPORT_STATE, state)->as.state);
}

/// Half a second: the vehicles move, and send their states.
static void drive(episode* self, const losses* lost, test_rng* rng)
{
    static verge_vehicle vehicles[VERGE_VEHICLES_MAX];
    for (uint32_t tick = 0; tick < TICKS; ++tick) {
        world_advance(&self->world);
        const uint32_t count = world_states(&self->world, vehicles);
        for (uint32_t i = 0; i < count; ++i) {
            const verge_vehicle_state_t state = measured(self, &vehicles[i], rng);
            const bool sent = test_rng_unit(rng) >= lost->share;
            const bool heard = lost->last && tick + 1 < TICKS;
            if (sent && (heard || state.vehicle_id != lost->rsu_id)) {
                hear_rsu(self, &state);
            }
            if (sent && (heard || state.vehicle_id != lost->unit_id)) {
                hear_unit(self, &state);
            }
        }
    }
}

/// The roadside unit plans, 10 ms after the last states, and the vehicles follow.
static void plan(episode* self)
{
    cycle_run(&self->rsu, self->number++, EPOCH + world_utime(&self->world) + 10000);
    assert_int_equal(self->rsu.status, VERGE_OK);
    for (uint32_t i = 0; i < self->rsu.plan.vehicle_count; ++i) {
        world_follow(&self->world, &self->rsu.plan.vehicles[i], world_time(&self->world));
    }
}

/// The unit hears all messages of the cycle but one (-1: all). True: the cycle is whole.
static bool hear_plans(episode* self, int32_t lost_index)
{
    bool whole = false;
    for (uint32_t i = 0; i < self->rsu.message_count; ++i) {
        if ((int32_t)i != lost_index) {
            whole = repeat_plan(&self->unit,
                                &carried(TRANSPORT_PLAN, &self->rsu.messages[i])->as.plan);
        }
    }
    return whole;
}

/// The trajectories of all vehicles, to the last bit.
static bool all_same(const episode* self)
{
    const verge_plan *a = &self->rsu.plan, *b = &self->unit.plan;
    bool same = a->vehicle_count == b->vehicle_count || a->vehicle_count == 0;
    for (uint32_t i = 0; same && i < a->vehicle_count; ++i) {
        same = a->vehicles[i].vehicle_id == b->vehicles[i].vehicle_id
               && a->vehicles[i].status == b->vehicles[i].status
               && memcmp(a->vehicles[i].points, b->vehicles[i].points,
                         a->vehicles[i].point_count * sizeof a->vehicles[i].points[0]) == 0;
    }
    return same;
}

/// Does the result name this difference?
static bool names(const episode* self, repeat_kind kind, int32_t vehicle_id)
{
    bool named = false;
    for (uint32_t i = 0; i < self->result.difference_count; ++i) {
        named = named || (self->result.differences[i].kind == kind
                          && self->result.differences[i].vehicle_id == vehicle_id);
    }
    return named;
}

static const verge_planner_def* usual_steps(void)
{
    static verge_planner_def def;
    def = verge_planner_default_def();
    return &def;
}

// ---- the same input, the same trajectory --------------------------------------------------

typedef struct tally {
    uint32_t cycles, first; ///< of them, first ones with another result
    uint32_t lanes;         ///< that were told by the sum
    uint32_t plans, changes, fallbacks, replanned, passes, uncontrolled;
} tally;

static void count(tally* sum, const verge_plan* plan)
{
    sum->plans += plan->vehicle_count;
    sum->fallbacks += plan->fallback_count;
    sum->replanned += plan->replanned_count;
    sum->uncontrolled += plan->prediction_count;
    for (uint32_t i = 0; i < plan->vehicle_count; ++i) {
        sum->changes += plan->vehicles[i].change_lane_id != VERGE_NO_LANE ? 1 : 0;
        sum->passes += plan->vehicles[i].pass_count;
    }
}

/// The vehicle begins to listen in a cycle of its own choice. It does not know the last plans then:
/// that is the one thing that may make a difference.
static void run_episode(episode* self, tally* sum, test_rng* rng)
{
    const uint32_t joins = test_rng_below(rng, 4);
    const losses lost = { .share = 0.3, .rsu_id = -1, .unit_id = -1 };
    for (uint32_t n = 0; n < CYCLES_OF_EPISODE; ++n) {
        drive(self, &lost, rng);
        plan(self);
        if (n < joins) {
            self->unit.state_count = 0; // not there yet
            continue;
        }
        if (!hear_plans(self, -1)) {
            continue; // no vehicle is planned any more
        }
        repeat_run(&self->unit, self->own_id, &self->result);
        const bool same = all_same(self);
        if (self->result.planned && n > joins) {
            assert_true(self->result.same);
        } else if (self->result.planned && !self->result.same) {
            assert_true(names(self, REPEAT_LAST_MISSED, -1));
        }
        if (n > joins && !same) {
            fail_msg("%s: cycle %u differs", self->scene.name, n);
        }
        sum->first += same ? 0 : 1;
        for (uint32_t i = 0; i < self->result.difference_count; ++i) {
            sum->lanes += self->result.differences[i].kind == REPEAT_OTHER_LANE ? 1 : 0;
        }
        sum->cycles += 1;
        count(sum, &self->rsu.plan);
    }
}

static void run(const verge_planner_def* steps, uint32_t cycles, tally* sum, test_rng* rng)
{
    for (uint32_t k = 0; sum->cycles < cycles; ++k) {
        episode* self = open_episode(SCENES[k % SCENE_COUNT], steps, rng);
        run_episode(self, sum, rng);
        close_episode(self);
    }
    printf("             %u cycles, %u plans: %u change lane, %u fall back, %u made again, %u "
           "areas, %u others; lanes from the sum: %u; first ones that differ: %u\n", sum->cycles,
           sum->plans, sum->changes, sum->fallbacks, sum->replanned, sum->passes,
           sum->uncontrolled, sum->lanes, sum->first);
}

/// Excluded are the first cycles of a vehicle that comes: 1 of 40 at most. All others are the same.
static void from_messages_alone_a_vehicle_makes_the_trajectories_of_the_roadside_unit(void** state)
{
    (void)state;
    test_rng rng = test_rng_seeded("on board");
    tally    sum = { 0 };
    run(usual_steps(), test_rounds(1000), &sum, &rng);
    CHECK_AT_MOST(sum.first, sum.cycles / 40 + 1);
    if (test_rounds_suffice()) {
        assert_true(sum.changes > 100 && sum.fallbacks > 10 && sum.replanned > 5);
        assert_true(sum.passes > 500 && sum.uncontrolled > 500);
    }
}

/// A message holds seven steps, and whole milliseconds.
static void longer_decisions_and_odd_times_make_no_difference(void** state)
{
    (void)state;
    test_rng rng = test_rng_seeded("steps");
    verge_planner_def def = *usual_steps();
    tally longer = { 0 }, odd = { 0 };
    def.step_s = 1.0;
    def.steps = 10;
    run(&def, test_rounds(100), &longer, &rng);
    def.step_s = 1.0 / 0.7;
    def.steps = 6;
    run(&def, test_rounds(100), &odd, &rng);
}

// ---- other input, and its name ------------------------------------------------------------

/// The id of a vehicle that is only seen, -1: there is none.
static int32_t human_of(const episode* self)
{
    for (uint32_t i = 0; i < self->world.vehicle_count; ++i) {
        const world_vehicle* vehicle = &self->world.vehicles[i];
        if (vehicle->present && !vehicle->state.controlled) {
            return vehicle->state.id;
        }
    }
    return -1;
}

/// A freeway after two cycles that both have heard whole; at least one vehicle is only seen.
static episode* open_freeway(test_rng* rng)
{
    const losses none = { .rsu_id = -1, .unit_id = -1 };
    episode* self = open_episode("freeway-4av-2hv", usual_steps(), rng);
    while (human_of(self) < 0) {
        close_episode(self);
        self = open_episode("freeway-4av-2hv", usual_steps(), rng);
    }
    for (uint32_t n = 0; n < 2; ++n) {
        drive(self, &none, rng);
        plan(self);
        assert_true(hear_plans(self, -1));
        repeat_run(&self->unit, self->own_id, &self->result);
        assert_true(self->result.planned && all_same(self));
    }
    assert_true(self->result.same && self->result.difference_count == 0);
    return self;
}

/// One more cycle.
static void run_cycle(episode* self, const losses* lost, test_rng* rng)
{
    drive(self, lost, rng);
    plan(self);
    assert_true(hear_plans(self, -1));
    repeat_run(&self->unit, self->own_id, &self->result);
    assert_true(self->result.planned);
}

static void an_older_state_is_found_and_the_plan_is_the_same(void** state)
{
    (void)state;
    test_rng rng = test_rng_seeded("older");
    for (uint32_t round = 0; round < test_rounds(20); ++round) {
        episode* self = open_freeway(&rng);
        const losses lost = { .rsu_id = human_of(self), .unit_id = -1, .last = true };
        run_cycle(self, &lost, &rng);
        assert_true(self->result.same && all_same(self));
        assert_int_equal(self->result.difference_count, 1);
        assert_true(names(self, REPEAT_OLDER_STATE, lost.rsu_id));
        assert_true(self->result.differences[0].state_utime
                    == EPOCH + world_utime(&self->world) - 100000);
        close_episode(self);
    }
}

/// A clock ahead of the others: the state is newer than the plan that uses it.
static void a_newer_state_is_found_and_the_plan_is_the_same(void** state)
{
    (void)state;
    test_rng rng = test_rng_seeded("newer");
    const losses none = { .rsu_id = -1, .unit_id = -1 };
    episode* self = open_freeway(&rng);
    const int32_t human = human_of(self);
    drive(self, &none, &rng);
    for (uint32_t i = 0; i < self->world.vehicle_count; ++i) {
        if (self->world.vehicles[i].state.id == human) {
            verge_vehicle_state_t ahead = measured(self, &self->world.vehicles[i].state, &rng);
            ahead.utime += 30000;
            hear_rsu(self, &ahead);
            hear_unit(self, &ahead);
        }
    }
    plan(self);
    assert_true(hear_plans(self, -1));
    repeat_run(&self->unit, self->own_id, &self->result);
    assert_true(self->result.same && all_same(self));
    assert_true(names(self, REPEAT_NEWER_STATE, human));
    close_episode(self);
}

static void a_vehicle_that_the_roadside_unit_did_not_hear_is_found_and_the_plan_is_the_same(
    void** state)
{
    (void)state;
    test_rng rng = test_rng_seeded("unheard");
    episode* self = open_freeway(&rng);
    verge_vehicle stranger = self->world.vehicles[0].state;
    stranger.id = 99;
    stranger.controlled = false;
    stranger.x += 25.0;
    const losses none = { .rsu_id = -1, .unit_id = -1 };
    for (uint32_t n = 0; n < 3; ++n) {
        const verge_vehicle_state_t seen = measured(self, &stranger, &rng);
        hear_unit(self, &seen);
        run_cycle(self, &none, &rng);
        assert_true(self->result.same && all_same(self));
        assert_int_equal(self->result.difference_count, 1);
        assert_true(names(self, REPEAT_UNHEARD_BY_RSU, 99));
    }
    close_episode(self);
}

/// The unit forgets the lanes after each cycle. The sum tells those of up to two vehicles.
static void lanes_that_were_forgotten_are_found_and_the_plan_is_the_same(void** state)
{
    (void)state;
    test_rng rng = test_rng_seeded("lanes");
    const losses none = { .rsu_id = -1, .unit_id = -1 };
    uint32_t found = 0;
    for (uint32_t round = 0; round < test_rounds(20); ++round) {
        episode* self = open_episode("crossing", usual_steps(), &rng);
        for (uint32_t n = 0; n < CYCLES_OF_EPISODE; ++n) {
            drive(self, &none, &rng);
            plan(self);
            verge_planner_reset(self->planners[1]);
            if (hear_plans(self, -1)) {
                repeat_run(&self->unit, self->own_id, &self->result);
                const bool more = names(self, REPEAT_STATE_MISSED, -1);
                const bool lanes = self->result.difference_count > 0 && !more;
                assert_true(more || !self->result.planned || self->result.same);
                assert_true(!lanes || self->result.differences[0].kind == REPEAT_OTHER_LANE);
                found += lanes ? 1 : 0;
            }
        }
        close_episode(self);
    }
    assert_true(found > 0 || !test_rounds_suffice());
    printf("             %u cycles with other lanes\n", found);
}

static void a_state_that_was_not_heard_on_board_is_named(void** state)
{
    (void)state;
    test_rng rng = test_rng_seeded("missed");
    const losses none = { .rsu_id = -1, .unit_id = -1 };
    episode* self = open_freeway(&rng);
    const losses own = { .rsu_id = -1, .unit_id = self->own_id, .last = true };
    run_cycle(self, &own, &rng);
    assert_false(self->result.same);
    assert_true(names(self, REPEAT_STATE_MISSED, self->own_id));
    assert_true(self->result.differences[0].state_utime == EPOCH + world_utime(&self->world));
    run_cycle(self, &none, &rng); // nothing stays of it
    assert_true(self->result.same && all_same(self) && self->result.difference_count == 0);
    close_episode(self);
}

static void the_cycle_after_one_that_was_not_heard_whole_says_so_if_it_differs(void** state)
{
    (void)state;
    test_rng rng = test_rng_seeded("lost plan");
    const losses none = { .rsu_id = -1, .unit_id = -1 };
    uint32_t differ = 0;
    for (uint32_t round = 0; round < test_rounds(60); ++round) {
        episode* self = open_freeway(&rng);
        drive(self, &none, &rng);
        plan(self);
        assert_false(hear_plans(self, 0));
        repeat_run(&self->unit, self->own_id, &self->result);
        assert_false(self->result.planned);
        run_cycle(self, &none, &rng);
        differ += self->result.same ? 0 : 1;
        assert_true(self->result.same || names(self, REPEAT_LAST_MISSED, -1));
        run_cycle(self, &none, &rng);
        assert_true(self->result.same && all_same(self));
        close_episode(self);
    }
    assert_true(differ > 0 || !test_rounds_suffice());
}

static void a_late_plan_and_the_one_after_it_are_named(void** state)
{
    (void)state;
    test_rng rng = test_rng_seeded("late");
    const losses none = { .rsu_id = -1, .unit_id = -1 };
    episode* self = open_freeway(&rng);
    drive(self, &none, &rng);
    plan(self);
    cycle_retime(&self->rsu, self->rsu.utime + 250000);
    assert_true(hear_plans(self, -1));
    repeat_run(&self->unit, self->own_id, &self->result);
    assert_true(self->result.planned && !self->result.same);
    assert_true(names(self, REPEAT_LATE, -1));
    run_cycle(self, &none, &rng);
    assert_true(self->result.same || names(self, REPEAT_LATE, -1));
    run_cycle(self, &none, &rng);
    assert_true(self->result.same && all_same(self));
    close_episode(self);
}

static void what_is_sent_while_a_plan_is_late_is_no_cycle(void** state)
{
    (void)state;
    test_rng rng = test_rng_seeded("overrun");
    const losses none = { .rsu_id = -1, .unit_id = -1 };
    episode* self = open_freeway(&rng);
    cycle_overrun(&self->rsu, self->rsu.utime + 500000);
    assert_true(self->rsu.message_count > 0);
    assert_false(hear_plans(self, -1));
    run_cycle(self, &none, &rng);
    assert_true(self->result.same && all_same(self) && self->result.difference_count == 0);
    close_episode(self);
}

static void a_cycle_that_is_heard_twice_is_one_cycle(void** state)
{
    (void)state;
    test_rng rng = test_rng_seeded("twice");
    const losses none = { .rsu_id = -1, .unit_id = -1 };
    episode* self = open_freeway(&rng);
    assert_false(hear_plans(self, -1)); // as on a second bus
    run_cycle(self, &none, &rng);
    assert_true(self->result.same && all_same(self) && self->result.difference_count == 0);
    close_episode(self);
}

static void a_plan_for_another_road_is_not_repeated(void** state)
{
    (void)state;
    test_rng rng = test_rng_seeded("road");
    const losses none = { .rsu_id = -1, .unit_id = -1 };
    episode* self = open_freeway(&rng);
    self->rsu.def.map_crc32 ^= 1;
    drive(self, &none, &rng);
    plan(self);
    assert_true(hear_plans(self, -1));
    repeat_run(&self->unit, self->own_id, &self->result);
    assert_false(self->result.planned);
    assert_true(names(self, REPEAT_OTHER_ROAD, -1));
    close_episode(self);
}

/// What the messages do not tell: the parameters.
static void other_parameters_give_another_result_without_a_cause(void** state)
{
    (void)state;
    test_rng rng = test_rng_seeded("parameters");
    const losses none = { .rsu_id = -1, .unit_id = -1 };
    episode* self = open_freeway(&rng);
    verge_planner_def def = self->scene.def;
    def.points = 21;
    free(self->memory[1]);
    self->planners[1] = planner_of(&def, &self->memory[1]);
    self->unit.def.planner = self->planners[1];
    run_cycle(self, &none, &rng);
    assert_false(self->result.same);
    assert_int_equal(self->result.difference_count, 1);
    assert_true(names(self, REPEAT_OTHER_RESULT, -1));
    close_episode(self);
}

/// One number of a message, or a few bits of it, as no roadside unit would send it.
static void spoil(verge_vehicle_plan_t* message, test_rng* rng)
{
    uint8_t* bytes = (uint8_t*)message;
    int32_t* const counts[] = { &message->action_count, &message->pass_count,
                                &message->point_count, &message->plans_in_cycle };
    for (uint32_t i = 0; i < 1 + test_rng_below(rng, 4); ++i) {
        bytes[test_rng_below(rng, sizeof *message)] ^= (uint8_t)(1u << test_rng_below(rng, 8));
    }
    if (test_rng_unit(rng) < 0.2) {
        *counts[test_rng_below(rng, 4)] = (int32_t)test_rng_below(rng, 8);
    }
}

static void whatever_the_plans_hold_a_result_is_given_and_the_next_cycle_but_one_is_the_same(
    void** state)
{
    (void)state;
    test_rng rng = test_rng_seeded("spoilt");
    const losses none = { .rsu_id = -1, .unit_id = -1 };
    episode* self = open_freeway(&rng);
    uint32_t whole = 0, differ = 0, after = 0;
    for (uint32_t round = 0; round < test_rounds(300); ++round) {
        drive(self, &none, &rng);
        plan(self);
        if (self->rsu.plan.vehicle_count == 0) { // all have left
            close_episode(self);
            self = open_freeway(&rng);
            after = 0;
            continue;
        }
        const bool spoilt = test_rng_unit(&rng) < 0.5;
        for (uint32_t i = 0; spoilt && i < self->rsu.message_count; ++i) {
            spoil(&self->rsu.messages[i], &rng);
        }
        after = spoilt ? 0 : after + 1;
        if (hear_plans(self, -1)) {
            repeat_run(&self->unit, self->own_id, &self->result);
            whole += spoilt ? 1 : 0;
            differ += spoilt && !self->result.same ? 1 : 0;
            assert_true(after < 2 || !self->result.planned || self->result.same);
        }
    }
    assert_true((whole > 0 && differ > 0) || !test_rounds_suffice());
    close_episode(self);
}

static void every_difference_has_words(void** state)
{
    (void)state;
    for (int kind = REPEAT_UNHEARD_BY_RSU; kind <= REPEAT_OTHER_RESULT; ++kind) {
        assert_string_not_equal(repeat_kind_text((repeat_kind)kind), "unknown");
    }
    assert_string_equal(repeat_kind_text((repeat_kind)0), "unknown");
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(from_messages_alone_a_vehicle_makes_the_trajectories_of_the_roadside_unit),
        cmocka_unit_test(longer_decisions_and_odd_times_make_no_difference),
        cmocka_unit_test(an_older_state_is_found_and_the_plan_is_the_same),
        cmocka_unit_test(a_newer_state_is_found_and_the_plan_is_the_same),
        cmocka_unit_test(
            a_vehicle_that_the_roadside_unit_did_not_hear_is_found_and_the_plan_is_the_same),
        cmocka_unit_test(lanes_that_were_forgotten_are_found_and_the_plan_is_the_same),
        cmocka_unit_test(a_state_that_was_not_heard_on_board_is_named),
        cmocka_unit_test(the_cycle_after_one_that_was_not_heard_whole_says_so_if_it_differs),
        cmocka_unit_test(a_late_plan_and_the_one_after_it_are_named),
        cmocka_unit_test(what_is_sent_while_a_plan_is_late_is_no_cycle),
        cmocka_unit_test(a_cycle_that_is_heard_twice_is_one_cycle),
        cmocka_unit_test(a_plan_for_another_road_is_not_repeated),
        cmocka_unit_test(other_parameters_give_another_result_without_a_cause),
        cmocka_unit_test(
            whatever_the_plans_hold_a_result_is_given_and_the_next_cycle_but_one_is_the_same),
        cmocka_unit_test(every_difference_has_words),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
