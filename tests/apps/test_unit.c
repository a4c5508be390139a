/// Goal: an on-vehicle unit follows a plan that is fresh and safe, departs from one that is not in
///       the very cycle, decides alone without one, and stops without a position. Bad messages
///       change a counter only.
/// Method: a planner on a straight road of two lanes makes the plans of a roadside unit; messages
///         and cycles come on a synthetic clock; the vehicle drives what the unit says.
#include "check.h"
#include "rng.h"

#include "obu/unit.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>

enum { OWN = 7, HUMAN = 4, RSU = 3 };
static const int64_t EPOCH = INT64_C(1700000000) * 1000000; // [us]
static const uint32_t MAP = 0x1234567;

#define LINE 160.0 // [m] the stop line of the right lane; it counts under a signal only
static const double RIGHT[][2] = { { 0.0, 0.0 }, { 900.0, 0.0 } };
static const double LEFT[][2] = { { 0.0, 3.75 }, { 900.0, 3.75 } };
static const verge_lane_def LANES[] = {
    { .id = 0, .points = RIGHT, .point_count = 2, .width = 3.75, .speed_limit = 20.0, .left = 1,
      .right = VERGE_NO_LANE, .stop_line_given = true, .stop_line = LINE },
    { .id = 1, .points = LEFT, .point_count = 2, .width = 3.75, .speed_limit = 20.0,
      .left = VERGE_NO_LANE, .right = 0 },
};

static int64_t instant(double t)
{
    return EPOCH + llround(t * 1e6);
}

/// The own vehicle, one human, a roadside unit, the on-vehicle unit, and what it said last.
typedef struct rig {
    void*          memory;
    verge_planner* planner;
    unit*          unit;
    verge_vehicle  own, human;
    bool           has_human;
    int32_t        cycle;
    verge_plan     plan;
    verge_vehicle_trajectory_t said;
    bool           spoke;
} rig;

static verge_planner_def def_small(void)
{
    verge_planner_def def = verge_planner_default_def();
    def.road = (verge_road_def){ LANES, 2 };
    def.iterations = 60;
    def.nodes_max = 64;
    def.vehicles_max = 4;
    def.controlled_max = 1;
    return def;
}

static rig* rig_open(double speed)
{
    rig* self = calloc(1, sizeof *self);
    assert_non_null(self);
    const verge_planner_def def = def_small();
    const size_t size = (verge_planner_memory_size(&def) + 63) / 64 * 64;
    self->memory = aligned_alloc(64, size);
    assert_int_equal(verge_planner_init(&self->planner, &def, self->memory, size), VERGE_OK);
    const unit_def made = { .planner = def, .vehicle_id = OWN, .rsu_id = -1, .map_crc32 = MAP,
                            .limits = inbox_default_limits(), .own_bus = -1 };
    char error[256] = "";
    self->unit = unit_open(&made, error, sizeof error);
    assert_non_null(self->unit);
    self->own = self->human = verge_vehicle_default();
    self->own.id = OWN;
    self->own.controlled = true;
    self->own.x = 100.0;
    self->own.speed = speed;
    self->own.target_lane = 0;
    self->human.id = HUMAN;
    return self;
}

static void rig_close(rig* self)
{
    unit_close(self->unit);
    free(self->memory);
    free(self);
}

static transport_message* message_of_kind(transport_kind kind, double t, uint64_t sender)
{
    static transport_message message;
    memset(&message, 0, sizeof message);
    message.kind = kind;
    message.arrival_utime = instant(t);
    message.sender = sender;
    return &message;
}

static bool hear(rig* self, const verge_vehicle* vehicle, double t)
{
    transport_message* message = message_of_kind(TRANSPORT_STATE, t, 100u + (uint64_t)vehicle->id);
    message->as.state = wire_state_from_vehicle(vehicle, VERGE_NORMAL, instant(t),
                                                (int32_t)llround(t * 1e3), -1);
    return unit_offer(self->unit, message);
}

static void hear_states(rig* self, double t)
{
    assert_true(hear(self, &self->own, t));
    assert_true(!self->has_human || hear(self, &self->human, t));
}

/// The message of the roadside unit's plan for the present states.
static verge_vehicle_plan_t plan_at(rig* self, double t)
{
    verge_vehicle vehicles[2] = { self->own, self->human };
    const uint32_t count = self->has_human ? 2 : 1;
    assert_int_equal(verge_planner_step(self->planner, instant(t), vehicles, count, &self->plan),
                     VERGE_OK);
    const wire_plan_header header = {
        .utime = instant(t), .valid_until_utime = instant(t + 3.0), .state_utime = instant(t),
        .rsu_id = RSU, .cycle = self->cycle++, .plans_in_cycle = 1, .digest = self->plan.digest,
        .map_crc32 = MAP,
    };
    return wire_plan_from_vehicle_plan(&header, &self->plan.vehicles[0]);
}

static bool offer(rig* self, const verge_vehicle_plan_t* plan, double t)
{
    transport_message* message = message_of_kind(TRANSPORT_PLAN, t, 1);
    message->as.plan = *plan;
    return unit_offer(self->unit, message);
}

static void check_said(const rig* self)
{
    const char* fault = wire_trajectory_check(&self->said);
    if (fault != NULL) {
        fail_msg("%s", fault);
    }
    assert_int_equal(self->said.vehicle_id, OWN);
}

/// A cycle of the unit.
static const verge_vehicle_trajectory_t* cycle_at(rig* self, double t)
{
    self->spoke = unit_cycle(self->unit, instant(t), &self->said);
    if (self->spoke) {
        check_said(self);
    }
    return &self->said;
}

/// The own vehicle drives to where the last trajectory has it at t.
static void drive_to(rig* self, double t)
{
    const int64_t dt = (int64_t)self->said.dt_ms * 1000;
    const int32_t k = (int32_t)((instant(t) - self->said.utime + dt / 2) / dt);
    assert_true(k >= 0 && k < self->said.point_count);
    const verge_plan_point_t* point = &self->said.points[k];
    self->own.x = point->x;
    self->own.y = point->y;
    self->own.heading = (double)point->heading;
    self->own.speed = (double)point->speed;
    self->own.acceleration = (double)point->acceleration;
    self->own.yaw_rate = (double)point->curvature * self->own.speed;
    self->human.x += 0.1 * self->human.speed;
}

static void expect(const rig* self, wire_unit_mode mode, wire_unit_reason reason)
{
    assert_true(self->spoke);
    if (self->said.mode != (int)mode || self->said.mode_reason != (int)reason) {
        fail_msg("%s, %s, expected %s, %s", wire_unit_mode_name(self->said.mode),
                 wire_unit_reason_name(self->said.mode_reason), wire_unit_mode_name((int32_t)mode),
                 wire_unit_reason_name((int32_t)reason));
    }
}

/// Drives from t0 to t1 with a plan every 0.5 s, following all the time.
static void follow(rig* self, double t0, double t1)
{
    const int from = (int)lround(t0 * 10.0), to = (int)lround(t1 * 10.0);
    for (int i = from; i < to; ++i) {
        const double t = 0.1 * i;
        hear_states(self, t);
        if (i % 5 == 0) {
            const verge_vehicle_plan_t plan = plan_at(self, t);
            assert_true(offer(self, &plan, t));
        }
        (void)cycle_at(self, t);
        expect(self, WIRE_FOLLOWING, WIRE_UNIT_NONE);
        drive_to(self, t + 0.1);
    }
}

// ---- following ----------------------------------------------------------------------------

static void the_points_of_a_fresh_plan_are_driven(void** state)
{
    (void)state;
    rig* self = rig_open(15.0);
    const verge_vehicle_plan_t plan = plan_at(self, 0.0);
    assert_true(offer(self, &plan, 0.0));
    for (int i = 0; i < 5; ++i) {
        hear_states(self, 0.1 * i);
        const verge_vehicle_trajectory_t* said = cycle_at(self, 0.1 * i);
        expect(self, WIRE_FOLLOWING, WIRE_UNIT_NONE);
        assert_int_equal(said->followed_cycle, plan.cycle);
        assert_int_equal(said->rsu_id, RSU);
        assert_int_equal(said->point_count, plan.point_count - i);
        assert_memory_equal(said->points, plan.points + i,
                            (size_t)said->point_count * sizeof plan.points[0]);
        assert_int_equal(said->action, plan.actions[0].action);
        drive_to(self, 0.1 * (i + 1));
    }
    assert_int_equal(unit_count(self->unit).tracked, 5);
    rig_close(self);
}

/// The car is 0.4 m beside the plan: it gets new points along the same actions, from where it is.
static void beside_the_plan_new_points_begin_where_the_vehicle_is(void** state)
{
    (void)state;
    rig* self = rig_open(15.0);
    hear_states(self, 0.0);
    const verge_vehicle_plan_t plan = plan_at(self, 0.0);
    assert_true(offer(self, &plan, 0.0));
    self->own.y += 0.4;
    self->own.x += 1.5;
    assert_true(hear(self, &self->own, 0.1));
    const verge_vehicle_trajectory_t* said = cycle_at(self, 0.1);
    expect(self, WIRE_FOLLOWING, WIRE_UNIT_NONE);
    CHECK_NEAR(said->points[0].x, self->own.x, 1e-9);
    CHECK_NEAR(said->points[0].y, self->own.y, 1e-9);
    assert_int_equal(said->status, VERGE_PLANNED);
    rig_close(self);
}

// ---- departing ----------------------------------------------------------------------------

/// The human of the other lane drives into the own one, 20 m ahead: at the first state that shows
/// it, the unit departs, and its trajectory is clear.
static void a_plan_that_meets_a_body_is_departed_from_in_the_same_cycle(void** state)
{
    (void)state;
    rig* self = rig_open(18.0);
    self->has_human = true;
    self->human.x = 118.0;
    self->human.y = 3.75;
    self->human.speed = 12.0;
    follow(self, 0.0, 0.7);
    self->human.heading = -0.12; // drifts to the right, 1.4 m/s
    self->human.y -= 0.3;
    self->human.x = self->own.x + 11.0;
    hear_states(self, 0.7);
    (void)cycle_at(self, 0.7);
    expect(self, WIRE_DEPARTING, WIRE_UNIT_CONTACT);
    assert_int_equal(self->said.mode_vehicle, HUMAN);
    const verge_plan_point_t* last = &self->said.points[self->said.point_count - 1];
    const double human_x = self->human.x + 3.0 * 12.0 * cos(0.12);
    assert_true(last->x < human_x - 5.0 || fabs(last->y - self->human.y) > 2.0);
    rig_close(self);
}

static void a_human_that_brakes_hard_is_expected_to_go_on_braking(void** state)
{
    (void)state;
    rig* self = rig_open(18.0);
    self->has_human = true;
    self->human.x = 127.0;
    self->human.speed = 17.5;
    follow(self, 0.0, 0.7);
    self->human.x = self->own.x + 22.0;
    self->human.acceleration = -7.0;
    self->human.speed -= 0.7;
    hear_states(self, 0.7);
    (void)cycle_at(self, 0.7);
    expect(self, WIRE_DEPARTING, WIRE_UNIT_CONTACT);
    assert_true((double)self->said.points[10].speed < self->own.speed - 1.0);
    rig_close(self);
}

static void the_plan_departed_from_is_not_followed_again_but_a_newer_one_is(void** state)
{
    (void)state;
    rig* self = rig_open(15.0);
    self->has_human = true;
    self->human.x = 150.0;
    self->human.y = 3.75;
    self->human.speed = 15.0;
    follow(self, 0.0, 0.6);
    verge_vehicle there = self->human, lying = self->human;
    lying.x = self->own.x + 12.0;
    lying.y = 0.5;
    lying.speed = 6.0;
    lying.id = 9; // another body, for one cycle
    hear_states(self, 0.6);
    assert_true(hear(self, &lying, 0.6));
    (void)cycle_at(self, 0.6);
    expect(self, WIRE_DEPARTING, WIRE_UNIT_CONTACT);
    drive_to(self, 0.7);
    lying.y = there.y + 3.0; // gone: off to the side
    lying.x += 300.0;
    lying.id = 9;
    hear_states(self, 0.7);
    (void)hear(self, &lying, 0.7);
    (void)cycle_at(self, 0.7);
    assert_int_equal(self->said.mode, WIRE_DEPARTING); // the same plan
    drive_to(self, 0.8);
    for (double t = 0.8; t < 2.75; t += 0.1) { // what was heard of vehicle 9 is forgotten
        hear_states(self, t);
        (void)cycle_at(self, t);
        drive_to(self, t + 0.1);
    }
    hear_states(self, 2.8);
    const verge_vehicle_plan_t plan = plan_at(self, 2.8);
    assert_true(offer(self, &plan, 2.8));
    (void)cycle_at(self, 2.8);
    expect(self, WIRE_FOLLOWING, WIRE_UNIT_NONE);
    rig_close(self);
}

static void a_plan_that_begins_far_from_the_vehicle_is_departed_from(void** state)
{
    (void)state;
    const double dx[] = { 1.2, 0.0, 0.0 }, dy[] = { 0.0, -1.1, 0.0 }, dv[] = { 0.0, 0.0, 1.3 };
    for (int k = 0; k < 3; ++k) {
        rig* self = rig_open(15.0);
        hear_states(self, 0.0);
        const verge_vehicle_plan_t plan = plan_at(self, 0.0);
        assert_true(offer(self, &plan, 0.0));
        self->own.x += dx[k];
        self->own.y += dy[k];
        self->own.speed += dv[k];
        assert_true(hear(self, &self->own, 0.001));
        (void)cycle_at(self, 0.002);
        expect(self, WIRE_DEPARTING, WIRE_UNIT_PLAN_FAR);
        CHECK_NEAR(self->said.points[0].y, self->own.y, 1e-6);
        CHECK_NEAR((double)self->said.points[0].speed, self->own.speed, 1e-5);
        rig_close(self);
    }
}

static bool show(rig* self, verge_signal_state shown, int64_t change_utime, double t)
{
    transport_message* message = message_of_kind(TRANSPORT_SIGNAL, t, 2);
    message->as.signal = (verge_lane_signal_t){
        .utime = instant(t), .change_utime = change_utime, .lane = 0, .state = (int16_t)shown,
        .map_crc32 = (int32_t)MAP, .protocol_version = WIRE_PROTOCOL_VERSION,
    };
    return unit_offer(self->unit, message);
}

/// The roadside unit does not know the signal; the on-vehicle unit hears it.
static void a_plan_past_a_red_signal_is_departed_from_and_the_vehicle_stops(void** state)
{
    (void)state;
    rig* self = rig_open(12.0);
    follow(self, 0.0, 0.7);
    for (int i = 7; i < 130; ++i) {
        const double t = 0.1 * i;
        hear_states(self, t);
        assert_true(show(self, VERGE_SIGNAL_RED, 0, t));
        if (i % 5 == 0) {
            const verge_vehicle_plan_t plan = plan_at(self, t);
            assert_true(offer(self, &plan, t));
        }
        (void)cycle_at(self, t);
        if (self->own.x + 0.5 * self->own.length > LINE - 12.0) {
            expect(self, WIRE_DEPARTING, WIRE_UNIT_RED_SIGNAL);
        }
        drive_to(self, t + 0.1);
        assert_true(self->own.x + 0.5 * self->own.length <= LINE);
    }
    assert_true(self->own.speed < 0.1);
    assert_true(self->own.x + 0.5 * self->own.length > LINE - 5.0);
    hear_states(self, 13.0);
    assert_true(show(self, VERGE_SIGNAL_GREEN, 0, 13.0));
    const verge_vehicle_plan_t plan = plan_at(self, 13.0);
    assert_true(offer(self, &plan, 13.0));
    (void)cycle_at(self, 13.0);
    expect(self, WIRE_FOLLOWING, WIRE_UNIT_NONE);
    rig_close(self);
}

static void a_plan_that_passes_after_the_known_end_of_the_red_is_followed(void** state)
{
    (void)state;
    rig* self = rig_open(12.0);
    self->own.x = LINE - 0.5 * self->own.length - 1.0; // a metre before the line
    hear_states(self, 0.0);
    const verge_vehicle_plan_t plan = plan_at(self, 0.0);
    assert_true(show(self, VERGE_SIGNAL_RED, instant(0.05), 0.0)); // passed in 0.1 s
    assert_true(offer(self, &plan, 0.0));
    (void)cycle_at(self, 0.001);
    expect(self, WIRE_FOLLOWING, WIRE_UNIT_NONE);
    assert_true(show(self, VERGE_SIGNAL_RED, instant(0.6), 0.01));
    (void)cycle_at(self, 0.011);
    expect(self, WIRE_DEPARTING, WIRE_UNIT_RED_SIGNAL);
    rig_close(self);
}

// ---- alone --------------------------------------------------------------------------------

static void without_a_roadside_unit_the_vehicle_drives_alone(void** state)
{
    (void)state;
    rig* self = rig_open(12.0);
    for (int i = 0; i < 60; ++i) {
        hear_states(self, 0.1 * i);
        (void)cycle_at(self, 0.1 * i);
        expect(self, WIRE_ALONE, WIRE_UNIT_NEVER_HEARD);
        assert_int_equal(self->said.followed_cycle, -1);
        assert_int_equal(self->said.rsu_id, -1);
        drive_to(self, 0.1 * (i + 1));
    }
    assert_true(self->own.speed > 15.0); // towards the limit
    rig_close(self);
}

/// The last plan was for 1.5 s; the roadside unit's cycle is 0.5 s.
static void after_three_silent_cycles_the_vehicle_is_alone(void** state)
{
    (void)state;
    rig* self = rig_open(15.0);
    follow(self, 0.0, 2.0); // the last plan came at 1.5 s
    for (int i = 20; i <= 31; ++i) {
        hear_states(self, 0.1 * i);
        (void)cycle_at(self, 0.1 * i);
        const bool silent = i > 30;
        expect(self, silent ? WIRE_ALONE : WIRE_FOLLOWING,
               silent ? WIRE_UNIT_SILENT : WIRE_UNIT_NONE);
        drive_to(self, 0.1 * (i + 1));
    }
    follow(self, 3.5, 4.5); // and back
    rig_close(self);
}

static void a_withdrawn_plan_is_not_followed(void** state)
{
    (void)state;
    rig* self = rig_open(15.0);
    follow(self, 0.0, 0.6);
    const wire_plan_header header = { .utime = instant(0.6), .valid_until_utime = instant(0.6),
                                      .rsu_id = RSU, .cycle = self->cycle, .map_crc32 = MAP };
    const verge_vehicle_plan_t none = wire_plan_cancelled(&header, OWN, VERGE_REASON_STALE);
    assert_true(offer(self, &none, 0.6));
    hear_states(self, 0.6);
    (void)cycle_at(self, 0.6);
    expect(self, WIRE_ALONE, WIRE_UNIT_CANCELLED);
    rig_close(self);
}

static void a_plan_of_another_road_or_version_is_not_followed(void** state)
{
    (void)state;
    for (int k = 0; k < 2; ++k) {
        rig* self = rig_open(15.0);
        hear_states(self, 0.0);
        verge_vehicle_plan_t plan = plan_at(self, 0.0);
        plan.map_crc32 += k == 0 ? 1 : 0;
        plan.protocol_version = (int16_t)(plan.protocol_version + k);
        assert_false(offer(self, &plan, 0.0));
        (void)cycle_at(self, 0.0);
        expect(self, WIRE_ALONE, k == 0 ? WIRE_UNIT_OTHER_MAP : WIRE_UNIT_OTHER_VERSION);
        rig_close(self);
    }
}

static void a_vehicle_that_asks_for_no_plan_is_alone(void** state)
{
    (void)state;
    rig* self = rig_open(15.0);
    hear_states(self, 0.0);
    const verge_vehicle_plan_t plan = plan_at(self, 0.0);
    assert_true(offer(self, &plan, 0.0));
    self->own.controlled = false;
    assert_true(hear(self, &self->own, 0.01));
    (void)cycle_at(self, 0.02);
    expect(self, WIRE_ALONE, WIRE_UNIT_NOT_WANTED);
    rig_close(self);
}

// ---- stopping -----------------------------------------------------------------------------

/// The localisation falls silent at 1 s: from 0.3 s later on the vehicle brakes along its last
/// trajectory, to a standstill in its lane, without a jolt. When the position is back it drives on.
static void without_a_position_the_vehicle_stops_in_its_lane(void** state)
{
    (void)state;
    rig* self = rig_open(12.0);
    follow(self, 0.0, 1.0);
    double speed = self->own.speed, acceleration = self->own.acceleration;
    int i = 10;
    for (; i < 120 && speed > 0.0; ++i) {
        (void)cycle_at(self, 0.1 * i);
        assert_true(self->spoke);
        if (i > 12) {
            expect(self, WIRE_STOPPING, WIRE_UNIT_NO_POSITION);
            // An acceleration ends with limited jerk, a^2 / (2 j).
            CHECK_AT_MOST((double)self->said.points[1].speed, speed + (i < 17 ? 0.3 : 0.01));
            const double jerk = ((double)self->said.points[1].acceleration - acceleration) / 0.1;
            CHECK_BETWEEN(jerk, -12.5, 12.5);
            CHECK_BETWEEN(self->said.points[0].y, -0.3, 0.3);
        }
        speed = (double)self->said.points[1].speed;
        acceleration = (double)self->said.points[1].acceleration;
        drive_to(self, 0.1 * (i + 1));
    }
    CHECK_NEAR(speed, 0.0, 1e-3);
    hear_states(self, 0.1 * i);
    (void)cycle_at(self, 0.1 * i);
    assert_int_equal(self->said.mode, WIRE_ALONE);
    rig_close(self);
}

static void before_the_first_position_nothing_is_said(void** state)
{
    (void)state;
    rig* self = rig_open(12.0);
    const verge_vehicle_plan_t plan = plan_at(self, 0.0);
    assert_true(offer(self, &plan, 0.0));
    (void)cycle_at(self, 0.0);
    assert_false(self->spoke);
    assert_int_equal(unit_count(self->unit).without, 1);
    self->own.heading = NAN; // nor with half a state
    transport_message* message = message_of_kind(TRANSPORT_STATE, 0.1, 1);
    message->as.state = wire_state_from_vehicle(&self->own, VERGE_NORMAL, instant(0.1), 1, -1);
    message->as.state.heading = NAN;
    (void)unit_offer(self->unit, message);
    (void)cycle_at(self, 0.1);
    assert_false(self->spoke);
    rig_close(self);
}

static void a_body_in_contact_stops_the_vehicle(void** state)
{
    (void)state;
    rig* self = rig_open(6.0);
    follow(self, 0.0, 0.6);
    self->has_human = true;
    self->human.x = self->own.x + 4.0;
    self->human.speed = 0.0;
    hear_states(self, 0.6);
    (void)cycle_at(self, 0.6);
    expect(self, WIRE_STOPPING, WIRE_UNIT_TOUCHING);
    assert_int_equal(self->said.mode_vehicle, HUMAN);
    assert_int_equal(self->said.status, VERGE_FALLBACK_BRAKE);
    rig_close(self);
}

static void off_the_road_the_vehicle_brakes_straight_ahead(void** state)
{
    (void)state;
    rig* self = rig_open(8.0);
    follow(self, 0.0, 0.6);
    self->own.y = -1.95; // its centre leaves the lane by 0.1 m
    self->own.x += 0.5;
    assert_true(hear(self, &self->own, 0.6));
    self->own.y = -4.0;
    (void)hear(self, &self->own, 0.65);
    (void)cycle_at(self, 0.7);
    assert_true(self->spoke);
    assert_true(self->said.mode == WIRE_STOPPING || self->said.mode == WIRE_DEPARTING);
    rig_close(self);
}

// ---- bad messages -------------------------------------------------------------------------

/// Each bad plan is refused, and the vehicle goes on following the good one.
static void a_bad_plan_moves_nothing(void** state)
{
    (void)state;
    rig* self = rig_open(15.0);
    follow(self, 0.0, 1.0);
    const verge_vehicle_plan_t good = plan_at(self, 1.0);
    assert_true(offer(self, &good, 1.0));
    enum { BAD = 8 };
    static const leader_verdict expected[BAD] = {
        LEADER_OLD, LEADER_OUT_OF_RANGE, LEADER_FUTURE, LEADER_OVER,
        LEADER_OTHER_RSU, LEADER_CONTRADICTS, LEADER_TOO_SOON, LEADER_OTHER_MAP,
    };
    for (int k = 0; k < BAD; ++k) {
        verge_vehicle_plan_t bad = good;
        bad.utime += k == 2 ? 50000 : k == 6 ? 5000 : k == 0 || k == 5 ? 0 : 20000;
        bad.points[3].x = k == 1 ? NAN : bad.points[3].x - 50.0;
        bad.valid_until_utime = k == 3 ? good.utime + 20000 : bad.valid_until_utime;
        bad.rsu_id += k == 4 ? 1 : 0;
        if (k == 5) { // of another vehicle of the same cycle
            bad.vehicle_id = HUMAN;
            bad.digest++;
        }
        bad.map_crc32 += k == 7 ? 1 : 0;
        assert_false(offer(self, &bad, k == 3 ? 1.05 : 1.0));
        assert_int_equal(unit_leader(self->unit)->counters[expected[k]], 1);
    }
    hear_states(self, 1.0);
    (void)cycle_at(self, 1.0);
    // The road of another one was heard lately, but the good plan counts.
    expect(self, WIRE_FOLLOWING, WIRE_UNIT_NONE);
    assert_memory_equal(self->said.points, good.points,
                        (size_t)good.point_count * sizeof good.points[0]);
    rig_close(self);
}

static void another_sender_of_the_same_id_is_not_followed_until_the_first_is_silent(void** state)
{
    (void)state;
    rig* self = rig_open(15.0);
    follow(self, 0.0, 1.0); // the last plan came at 0.5 s
    for (int i = 10; i < 40; ++i) {
        const double t = 0.1 * i;
        hear_states(self, t);
        if (i % 5 == 0) {
            transport_message* message = message_of_kind(TRANSPORT_PLAN, t, 2);
            message->as.plan = plan_at(self, t);
            assert_int_equal(unit_offer(self->unit, message), t > 2.0 + 1e-9);
        }
        (void)cycle_at(self, t);
        drive_to(self, t + 0.1);
    }
    assert_int_equal(unit_leader(self->unit)->counters[LEADER_SAME_ID], 3);
    expect(self, WIRE_FOLLOWING, WIRE_UNIT_NONE);
    rig_close(self);
}

static void of_two_roadside_units_the_one_with_the_lower_id_is_followed(void** state)
{
    (void)state;
    rig* self = rig_open(15.0);
    for (int i = 0; i < 60; ++i) {
        const double t = 0.1 * i;
        hear_states(self, t);
        if (i % 5 == 0) {
            verge_vehicle_plan_t high = plan_at(self, t), low = high;
            high.rsu_id = RSU + 1;
            const bool low_sends = i >= 10 && i < 30;
            assert_true(!low_sends || offer(self, &low, t));
            const bool followed = offer(self, &high, t);
            assert_int_equal(followed, i < 10 || t > 4.0 + 1e-9);
        }
        (void)cycle_at(self, t);
        const int32_t followed = i < 10 || i > 40 ? RSU + 1 : RSU; // 1.5 s after the low one's last
        assert_true(self->said.mode != WIRE_FOLLOWING || self->said.rsu_id == followed);
        drive_to(self, t + 0.1);
    }
    expect(self, WIRE_FOLLOWING, WIRE_UNIT_NONE);
    rig_close(self);
}

/// 1,000 plans a second from one sender: the vehicle keeps one that fits.
static void a_babbling_roadside_unit_does_no_harm(void** state)
{
    (void)state;
    rig* self = rig_open(15.0);
    follow(self, 0.0, 1.0);
    const verge_vehicle_plan_t good = plan_at(self, 1.0);
    assert_true(offer(self, &good, 1.0));
    for (int i = 10; i < 13; ++i) {
        hear_states(self, 0.1 * i);
        for (int k = 1; k < 10; ++k) { // until the next millisecond that is a cycle's
            verge_vehicle_plan_t babble = good;
            babble.utime += 1000 * k;
            assert_false(offer(self, &babble, 0.1 * i + 0.001 * k));
        }
        (void)cycle_at(self, 0.1 * i + 0.01);
        expect(self, WIRE_FOLLOWING, WIRE_UNIT_NONE);
        drive_to(self, 0.1 * (i + 1));
    }
    assert_int_equal(unit_leader(self->unit)->counters[LEADER_TOO_SOON], 27);
    rig_close(self);
}

static void a_state_with_the_own_id_from_another_bus_is_counted_only(void** state)
{
    (void)state;
    const unit_def made = { .planner = def_small(), .vehicle_id = OWN, .rsu_id = -1,
                            .map_crc32 = MAP, .limits = inbox_default_limits(), .own_bus = 1 };
    char error[256] = "";
    unit* self = unit_open(&made, error, sizeof error);
    assert_non_null(self);
    verge_vehicle own = verge_vehicle_default();
    own.id = OWN;
    own.x = 50.0;
    for (uint32_t bus = 0; bus < 2; ++bus) {
        transport_message* message = message_of_kind(TRANSPORT_STATE, 0.0, 1);
        message->bus = bus;
        message->as.state = wire_state_from_vehicle(&own, VERGE_NORMAL, instant(0.0), 1, -1);
        assert_int_equal(unit_offer(self, message), bus == 1);
    }
    assert_int_equal(unit_count(self).own_id_elsewhere, 1);
    unit_close(self);
}

/// The clock steps back by two hours: everything is heard anew, and the vehicle does not jump.
static void a_clock_that_steps_back_does_not_move_the_vehicle(void** state)
{
    (void)state;
    rig* self = rig_open(15.0);
    follow(self, 0.0, 1.0);
    (void)cycle_at(self, -7200.0);
    expect(self, WIRE_STOPPING, WIRE_UNIT_NO_POSITION);
    CHECK_NEAR(self->said.points[0].x, self->own.x, 1.8); // where it was at the last cycle
    CHECK_NEAR((double)self->said.points[0].speed, self->own.speed, 0.3);
    assert_int_equal(unit_count(self->unit).clock_steps, 1);
    hear_states(self, -7199.9);
    (void)cycle_at(self, -7199.9);
    assert_int_equal(self->said.mode, WIRE_ALONE);
    rig_close(self);
}

static void the_same_messages_give_the_same_trajectories(void** state)
{
    (void)state;
    verge_vehicle_trajectory_t first[40];
    for (int run = 0; run < 2; ++run) {
        rig* self = rig_open(14.0);
        self->has_human = true;
        self->human.x = 140.0;
        self->human.speed = 9.0;
        for (int i = 0; i < 40; ++i) {
            const double t = 0.1 * i;
            hear_states(self, t);
            if (i % 5 == 0 && i < 20) {
                const verge_vehicle_plan_t plan = plan_at(self, t);
                (void)offer(self, &plan, t);
            }
            (void)cycle_at(self, t);
            if (run == 0) {
                first[i] = self->said;
            }
            assert_memory_equal(&first[i], &self->said, sizeof self->said);
            drive_to(self, t + 0.1);
        }
        rig_close(self);
    }
}

/// The nearest vehicles take part, as many as the planner holds.
static void of_many_neighbours_the_nearest_count(void** state)
{
    (void)state;
    rig* self = rig_open(10.0);
    test_rng rng = test_rng_seeded("neighbours");
    const int32_t others = VERGE_VEHICLES_MAX > 30 ? 30 : VERGE_VEHICLES_MAX - 1;
    for (int32_t i = 0; i < others; ++i) {
        verge_vehicle other = verge_vehicle_default();
        other.id = 20 + i;
        other.x = i < 3 ? 130.0 + 10.0 * i : test_rng_between(&rng, 300.0, 800.0);
        other.y = 3.75;
        other.speed = 10.0;
        assert_true(hear(self, &other, 0.0));
    }
    hear_states(self, 0.0);
    (void)cycle_at(self, 0.0);
    const unit_view view = unit_look(self->unit);
    assert_int_equal(view.neighbours, 3); // of vehicles_max 4
    for (int32_t id = 20; id < 23; ++id) {
        assert_true(verge_scene_find(view.scene, id) >= 0);
    }
    assert_int_equal(unit_count(self->unit).left_out, others - 3);
    rig_close(self);
}

// ---- edges --------------------------------------------------------------------------------

/// A target lane that the road does not have costs the vehicle its wish, and not its stop.
static void with_an_unknown_target_a_vehicle_without_a_position_stops_too(void** state)
{
    (void)state;
    rig* self = rig_open(12.0);
    self->own.target_lane = 77;
    for (int i = 0; i < 20; ++i) {
        if (i < 10) {
            hear_states(self, 0.1 * i);
        }
        (void)cycle_at(self, 0.1 * i);
        assert_true(self->spoke);
        drive_to(self, 0.1 * (i + 1));
    }
    expect(self, WIRE_STOPPING, WIRE_UNIT_NO_POSITION);
    rig_close(self);
}

/// Plans of another vehicle go on, those of the own one do not: the old plan is not driven to its
/// end, and each trajectory looks ahead for a second and a half at least.
static void a_plan_is_not_followed_to_its_end(void** state)
{
    (void)state;
    rig* self = rig_open(15.0);
    follow(self, 0.0, 1.0); // the last plan came at 0.5 s
    for (int i = 10; i < 40; ++i) {
        const double t = 0.1 * i;
        hear_states(self, t);
        if (i % 5 == 0) {
            verge_vehicle_plan_t other = plan_at(self, t);
            other.vehicle_id = 30;
            assert_true(offer(self, &other, t));
        }
        const verge_vehicle_trajectory_t* said = cycle_at(self, t);
        assert_true(said->utime + (int64_t)(said->point_count - 1) * said->dt_ms * 1000
                    >= instant(t + 1.4));
        drive_to(self, t + 0.1);
    }
    assert_int_equal(self->said.mode, WIRE_ALONE);
    rig_close(self);
}

/// In a full inbox the own vehicle and a near one take the places of far ones.
static void among_more_vehicles_than_there_is_room_for_the_near_ones_are_known(void** state)
{
    (void)state;
    rig* self = rig_open(12.0);
    verge_vehicle other = verge_vehicle_default();
    other.y = 3.75;
    for (int32_t i = 0; i < VERGE_VEHICLES_MAX; ++i) {
        other.id = 200 + i;
        other.x = 850.0 - 0.5 * i;
        assert_true(hear(self, &other, 0.0));
    }
    assert_true(hear(self, &self->own, 0.0)); // the own one comes last
    other.id = 199;
    other.x = self->own.x + 30.0;
    other.y = 0.0;
    assert_true(hear(self, &other, 0.0));
    (void)cycle_at(self, 0.0);
    assert_true(self->spoke && verge_scene_find(unit_look(self->unit).scene, 199) >= 0);
    rig_close(self);
}

/// A queue on the other lane is nearer than the body ahead in the own one.
static void a_body_ahead_counts_before_nearer_ones_beside(void** state)
{
    (void)state;
    if (VERGE_VEHICLES_MAX < 10) {
        skip();
    }
    rig* self = rig_open(12.0);
    verge_vehicle other = verge_vehicle_default();
    for (int32_t i = 0; i < 8; ++i) {
        other.id = 20 + i;
        other.x = self->own.x - 20.0 + 6.0 * i;
        other.y = 3.75;
        assert_true(hear(self, &other, 0.0));
    }
    other.id = 19;
    other.x = self->own.x + 50.0;
    other.y = 0.0;
    assert_true(hear(self, &other, 0.0));
    hear_states(self, 0.0);
    (void)cycle_at(self, 0.0);
    assert_true(verge_scene_find(unit_look(self->unit).scene, 19) >= 0); // of 3 neighbours
    rig_close(self);
}

/// A unit with a lower id that plans others does not take the vehicle from the one that plans it.
static void a_roadside_unit_that_plans_others_only_is_not_followed(void** state)
{
    (void)state;
    rig* self = rig_open(15.0);
    for (int i = 0; i < 30; ++i) {
        const double t = 0.1 * i;
        hear_states(self, t);
        if (i % 5 == 0) {
            const verge_vehicle_plan_t plan = plan_at(self, t);
            verge_vehicle_plan_t low = plan;
            low.rsu_id = RSU - 1;
            low.vehicle_id = 30;
            assert_true(offer(self, &plan, t));
            assert_false(offer(self, &low, t));
        }
        (void)cycle_at(self, t);
        expect(self, WIRE_FOLLOWING, WIRE_UNIT_NONE);
        drive_to(self, t + 0.1);
    }
    rig_close(self);
}

/// One cycle is late: its time is bridged by the rest of the plan before, and the late plan begins at
/// the same instant. The period stays what it was.
static void a_late_cycle_does_not_make_a_roadside_unit_silent(void** state)
{
    (void)state;
    rig* self = rig_open(15.0);
    follow(self, 0.0, 1.5);
    const verge_vehicle_plan_t before = plan_at(self, 1.0);
    verge_vehicle_plan_t rest;
    (void)offer(self, &before, 1.41);
    assert_true(wire_plan_rest(&before, instant(1.5), &rest));
    rest.reason = VERGE_REASON_OVERRUN;
    assert_true(offer(self, &rest, 1.5));
    verge_vehicle_plan_t late = plan_at(self, 1.5);
    late.utime = rest.utime;
    assert_true(offer(self, &late, 1.52));
    assert_int_equal(unit_leader(self->unit)->cycle_us, 500000);
    rig_close(self);
}

/// The bus returns own states, also several at a time.
static void returned_own_states_are_no_strangers(void** state)
{
    (void)state;
    const unit_def made = { .planner = def_small(), .vehicle_id = OWN, .rsu_id = -1,
                            .map_crc32 = MAP, .limits = inbox_default_limits(), .own_bus = 1 };
    char error[256] = "";
    unit* self = unit_open(&made, error, sizeof error);
    assert_non_null(self);
    verge_vehicle own = verge_vehicle_default();
    own.id = OWN;
    for (int pass = 0; pass < 2; ++pass) { // first from the own bus, then back from the other one
        for (int i = 0; i < 5; ++i) {
            own.x = 50.0 + i;
            transport_message* message = message_of_kind(TRANSPORT_STATE, 0.01 * i, 1);
            message->bus = pass == 0 ? 1 : 0;
            message->as.state =
                wire_state_from_vehicle(&own, VERGE_NORMAL, instant(0.01 * i), i, -1);
            assert_int_equal(unit_offer(self, message), pass == 0);
        }
    }
    assert_int_equal(unit_count(self).own_id_elsewhere, 0);
    unit_close(self);
}

/// A clock that leaps ahead makes the vehicle no jump, either.
static void a_clock_that_leaps_ahead_does_not_move_the_vehicle(void** state)
{
    (void)state;
    rig* self = rig_open(15.0);
    follow(self, 0.0, 1.0);
    (void)cycle_at(self, 6.0);
    expect(self, WIRE_STOPPING, WIRE_UNIT_NO_POSITION);
    CHECK_NEAR(self->said.points[0].x, self->own.x, 1.8);
    CHECK_NEAR((double)self->said.points[0].speed, self->own.speed, 0.3);
    rig_close(self);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(the_points_of_a_fresh_plan_are_driven),
        cmocka_unit_test(beside_the_plan_new_points_begin_where_the_vehicle_is),
        cmocka_unit_test(a_plan_that_meets_a_body_is_departed_from_in_the_same_cycle),
        cmocka_unit_test(a_human_that_brakes_hard_is_expected_to_go_on_braking),
        cmocka_unit_test(the_plan_departed_from_is_not_followed_again_but_a_newer_one_is),
        cmocka_unit_test(a_plan_that_begins_far_from_the_vehicle_is_departed_from),
        cmocka_unit_test(a_plan_past_a_red_signal_is_departed_from_and_the_vehicle_stops),
        cmocka_unit_test(a_plan_that_passes_after_the_known_end_of_the_red_is_followed),
        cmocka_unit_test(without_a_roadside_unit_the_vehicle_drives_alone),
        cmocka_unit_test(after_three_silent_cycles_the_vehicle_is_alone),
        cmocka_unit_test(a_withdrawn_plan_is_not_followed),
        cmocka_unit_test(a_plan_of_another_road_or_version_is_not_followed),
        cmocka_unit_test(a_vehicle_that_asks_for_no_plan_is_alone),
        cmocka_unit_test(without_a_position_the_vehicle_stops_in_its_lane),
        cmocka_unit_test(before_the_first_position_nothing_is_said),
        cmocka_unit_test(a_body_in_contact_stops_the_vehicle),
        cmocka_unit_test(off_the_road_the_vehicle_brakes_straight_ahead),
        cmocka_unit_test(a_bad_plan_moves_nothing),
        cmocka_unit_test(another_sender_of_the_same_id_is_not_followed_until_the_first_is_silent),
        cmocka_unit_test(of_two_roadside_units_the_one_with_the_lower_id_is_followed),
        cmocka_unit_test(a_babbling_roadside_unit_does_no_harm),
        cmocka_unit_test(a_state_with_the_own_id_from_another_bus_is_counted_only),
        cmocka_unit_test(a_clock_that_steps_back_does_not_move_the_vehicle),
        cmocka_unit_test(the_same_messages_give_the_same_trajectories),
        cmocka_unit_test(of_many_neighbours_the_nearest_count),
        cmocka_unit_test(with_an_unknown_target_a_vehicle_without_a_position_stops_too),
        cmocka_unit_test(a_plan_is_not_followed_to_its_end),
        cmocka_unit_test(among_more_vehicles_than_there_is_room_for_the_near_ones_are_known),
        cmocka_unit_test(a_body_ahead_counts_before_nearer_ones_beside),
        cmocka_unit_test(a_roadside_unit_that_plans_others_only_is_not_followed),
        cmocka_unit_test(a_late_cycle_does_not_make_a_roadside_unit_silent),
        cmocka_unit_test(returned_own_states_are_no_strangers),
        cmocka_unit_test(a_clock_that_leaps_ahead_does_not_move_the_vehicle),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
