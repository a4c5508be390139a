// A decision of one's own, planned by verge's trajectory stage: one vehicle at a crossing without
// signs gives way to traffic from the right. No search is built or linked. The program drives until
// the crossing is behind the vehicle and exits with 1 if the two bodies ever touch.
#include <math.h>
#include <stdalign.h>
#include <stdio.h>
#include <verge/verge.h>

enum { VEHICLES = 9, OWN = 1, OTHER = 2, CYCLES = 160 };
#define CYCLE_S 0.1
#define STEP_S 1.5     // [s] length of one decision step
#define STOP_LINE -7.0 // [m] where the own vehicle's front waits
#define CLEAR 6.0      // [m] beyond which a vehicle from the right has left the crossing

// Everything that one vehicle with 8 neighbours needs, besides its road.
alignas(64) static unsigned char predictor_memory[29 << 10];
alignas(64) static unsigned char sampler_memory[44 << 10];
static verge_vehicle          vehicles[VEHICLES];
static verge_lane_position    positions[VEHICLES];
static verge_track            bodies[VEHICLES];
static verge_vehicle_decision decisions[1];
static verge_vehicle_plan     plans[2]; // this cycle's and the last one's, in turn

alignas(64) static unsigned char road_memory[256 << 10];
static const double centerlines[2][2][2] = {
    { { -120.0, 0.0 }, { 120.0, 0.0 } }, // lane 0, eastward
    { { 0.0, -120.0 }, { 0.0, 120.0 } }, // lane 1, northward
};

static verge_status make_road(const verge_road** road)
{
    static verge_lane_def lanes[2];
    verge_road_def        def = { lanes, 2 };
    for (int32_t i = 0; i < 2; ++i) {
        lanes[i].id = i;
        lanes[i].points = centerlines[i];
        lanes[i].point_count = 2;
        lanes[i].width = 3.5;
        lanes[i].speed_limit = 14.0;
        lanes[i].left = lanes[i].right = VERGE_NO_LANE;
    }
    return verge_road_init(road, &def, road_memory, sizeof road_memory);
}

// One step: from s and v of the step before on with this acceleration, never backwards.
static void add_step(verge_vehicle_decision* decision, double* s, double* v, double acceleration)
{
    verge_action_step* step = &decision->steps[decision->step_count];
    const double v1 = fmax(0.0, *v + acceleration * STEP_S);
    const double moving = acceleration < 0.0 ? fmin(STEP_S, *v / -acceleration) : STEP_S; // [s]
    step->action = v1 > *v + 0.01   ? VERGE_ACCELERATE
                   : v1 < *v - 0.01 ? VERGE_DECELERATE
                                    : VERGE_KEEP_SPEED;
    step->lane_id = 0;
    step->t0 = STEP_S * decision->step_count;
    step->t1 = step->t0 + STEP_S;
    step->distance = *v * moving + 0.5 * acceleration * moving * moving;
    step->d = 0.0;
    *s = step->s = *s + step->distance;
    *v = step->v = v1;
    step->brake_light = step->action == VERGE_DECELERATE;
    step->turn_signal = 0;
    step->ahead_id = step->behind_id = -1;
    ++decision->step_count;
}

// The rule: wait at the line while a vehicle from the right may still come through the crossing.
static void decide(const verge_vehicle* own, double own_s, const verge_vehicle* other,
                   verge_vehicle_decision* decision)
{
    const double front = own->x + 0.5 * own->length;
    const bool   before_line = front < STOP_LINE + 0.5;
    const bool   comes = other->y - 0.5 * other->length < CLEAR;
    const double gap = fmax(STOP_LINE - front, 0.1);
    double       s = own_s, v = own->speed;
    double       acceleration = v < 9.0 ? 1.0 : 0.0;
    if (before_line && comes) {
        const double stop = -v * v / (2.0 * gap); // [m/s^2] that just stops at the line
        acceleration = stop < -1.0 ? fmax(stop, -5.0) : v < 1.0 && gap > 2.0 ? 0.3 : 0.0;
    }
    decision->vehicle_id = own->id;
    decision->step_count = 0;
    add_step(decision, &s, &v, acceleration);
    add_step(decision, &s, &v, acceleration < 0.0 ? acceleration : 0.0);
    add_step(decision, &s, &v, acceleration < 0.0 ? acceleration : 0.0);
}

// Where the plan leads within one cycle: what a controller would have the vehicle do.
static void follow(verge_vehicle* vehicle, const verge_vehicle_plan* plan)
{
    const verge_point* at = &plan->points[1];
    vehicle->x = at->x;
    vehicle->y = at->y;
    vehicle->heading = at->heading;
    vehicle->speed = at->speed;
    vehicle->acceleration = at->acceleration;
    vehicle->yaw_rate = at->speed * at->curvature;
}

int main(void)
{
    verge_planner_def def = verge_planner_default_def();
    def.vehicles_max = VEHICLES;
    def.controlled_max = 1;
    def.road.lane_count = 2; // the stages need not keep room for more
    verge_predictor*  predictor = NULL;
    verge_sampler*    sampler = NULL;
    const verge_road* road = NULL;
    if (make_road(&road) != VERGE_OK
        || verge_predictor_init(&predictor, &def, predictor_memory, sizeof predictor_memory)
               != VERGE_OK
        || verge_sampler_init(&sampler, &def, sampler_memory, sizeof sampler_memory) != VERGE_OK) {
        fputs("the stages do not fit their memory\n", stderr);
        return 1;
    }
    const size_t size = sizeof predictor_memory + sizeof sampler_memory + sizeof vehicles
                        + sizeof positions + sizeof bodies + sizeof decisions + sizeof plans;
    printf("one vehicle and 8 neighbours: %.1f KiB besides the road\n", (double)size / 1024.0);

    verge_scene scene = verge_scene_make(road, vehicles, positions, VEHICLES);
    verge_tracks tracks = verge_tracks_make(bodies, VEHICLES);

    verge_vehicle heard[2] = { verge_vehicle_default(), verge_vehicle_default() };
    heard[0].id = OWN;
    heard[0].controlled = true;
    heard[0].x = -50.0;
    heard[0].speed = 9.0;
    heard[1].id = OTHER; // from the right
    heard[1].y = -55.0;
    heard[1].heading = 1.57079632679489662;
    heard[1].speed = 8.0;

    for (int cycle = 0; cycle < CYCLES && heard[0].x < 15.0; ++cycle) {
        verge_vehicle_plan* plan = &plans[cycle % 2];
        verge_status        status = verge_scene_place(&scene, cycle * 100000, heard, 2, NULL);
        decide(&scene.vehicles[0], positions[0].s, &scene.vehicles[1], &decisions[0]);
        verge_decision decision = verge_decision_make(decisions, 1);
        decision.vehicle_count = 1;
        if (status == VERGE_OK) {
            status = verge_predict(predictor, &scene, &decision, &tracks);
        }
        if (status == VERGE_OK) {
            status = verge_plan_vehicle(sampler, &scene, &decisions[0], &tracks,
                                        cycle > 0 ? &plans[(cycle + 1) % 2] : NULL, plan);
        }
        if (status != VERGE_OK || verge_vehicles_overlap(&heard[0], &heard[1])) {
            fprintf(stderr, "cycle %d: %s\n", cycle,
                    status == VERGE_OK ? "contact" : verge_status_text(status));
            return 1;
        }
        if (cycle % 10 == 0) {
            char words[96];
            verge_action_say(&plan->actions[0], words, sizeof words);
            printf("%4.1f s  x %6.1f m  %4.1f m/s  other y %6.1f m  %s\n", cycle * CYCLE_S,
                   heard[0].x, heard[0].speed, heard[1].y, words);
        }
        follow(&heard[0], plan);
        heard[1].y += heard[1].speed * CYCLE_S;
    }
    if (!(heard[0].x >= 15.0)) {
        fputs("the vehicle never came through\n", stderr);
        return 1;
    }
    return 0;
}
