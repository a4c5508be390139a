// verge's joint decision, driven by a trajectory planner of one's own: constant acceleration within
// each decision step and a cosine across the lane. Two vehicles exchange their lanes. The program
// exits with 1 if the bodies of any two trajectories touch.
#include <math.h>
#include <stdalign.h>
#include <stdio.h>
#include <verge/verge.h>

enum { VEHICLES = 3, CONTROLLED = 2, POINTS = 31 };
#define POINT_S 0.1
#define PI 3.14159265358979323846

alignas(64) static unsigned char decider_memory[2 << 20];
alignas(64) static unsigned char predictor_memory[64 << 10];
alignas(64) static unsigned char road_memory[512 << 10];
static const double centerlines[2][2][2] = { { { 0.0, 0.0 }, { 500.0, 0.0 } },
                                             { { 0.0, 3.5 }, { 500.0, 3.5 } } };

static verge_status make_road(const verge_road** road)
{
    static verge_lane_def lanes[2];
    verge_road_def        def = { lanes, 2 };
    for (int32_t i = 0; i < 2; ++i) {
        lanes[i].id = i;
        lanes[i].points = centerlines[i];
        lanes[i].point_count = 2;
        lanes[i].width = 3.5;
        lanes[i].speed_limit = 15.0;
        lanes[i].left = i == 0 ? 1 : VERGE_NO_LANE;
        lanes[i].right = i == 1 ? 0 : VERGE_NO_LANE;
    }
    return verge_road_init(road, &def, road_memory, sizeof road_memory);
}

// The vehicle at time t of its decision. Speed rises evenly within a step; y goes from one step's
// lateral position to the next as half a cosine.
static void drive(const verge_vehicle* from, const verge_vehicle_decision* decision, double t,
                  verge_vehicle* at)
{
    double x = from->x, y = from->y, v = from->speed;
    *at = *from;
    for (uint32_t i = 0; i < decision->step_count; ++i) {
        const verge_action_step* step = &decision->steps[i];
        const double step_s = step->t1 - step->t0;
        const double into = fmin(fmax(t - step->t0, 0.0), step_s);
        const double a = (step->v - v) / step_s;
        const double y1 = 3.5 * step->lane_id + step->d; // lane i of this road lies at y = 3.5 i
        if (t <= step->t1 || i + 1 == decision->step_count) {
            const double phase = PI * into / step_s;
            const double rate = 0.5 * PI * (y1 - y) / step_s * sin(phase);
            at->x = x + (v + 0.5 * a * into) * into;
            at->y = y + 0.5 * (y1 - y) * (1.0 - cos(phase));
            at->speed = v + a * into;
            at->acceleration = a;
            at->heading = atan2(rate, fmax(at->speed, 0.1));
            return;
        }
        x += step->distance;
        y = y1;
        v = step->v;
    }
}

int main(void)
{
    verge_planner_def def = verge_planner_default_def();
    def.vehicles_max = VEHICLES;
    def.controlled_max = CONTROLLED;
    const verge_road* road = NULL;
    verge_decider*    decider = NULL;
    verge_predictor*  predictor = NULL;
    if (make_road(&road) != VERGE_OK
        || verge_decider_init(&decider, &def, decider_memory, sizeof decider_memory) != VERGE_OK
        || verge_predictor_init(&predictor, &def, predictor_memory, sizeof predictor_memory)
               != VERGE_OK) {
        fputs("the stages do not fit their memory\n", stderr);
        return 1;
    }
    verge_vehicle heard[VEHICLES];
    for (int32_t i = 0; i < VEHICLES; ++i) {
        heard[i] = verge_vehicle_default();
        heard[i].id = i;
        heard[i].speed = 10.0;
        heard[i].controlled = i < CONTROLLED;
    }
    heard[0].x = 50.0; // in lane 0, wants lane 1
    heard[0].target_lane = 1;
    heard[1].x = 62.0; // in lane 1, wants lane 0
    heard[1].y = 3.5;
    heard[1].target_lane = 0;
    heard[2].x = 20.0; // an uncontrolled vehicle behind both

    verge_vehicle       vehicles[VEHICLES];
    verge_lane_position positions[VEHICLES];
    verge_scene scene = verge_scene_make(road, vehicles, positions, VEHICLES);

    verge_vehicle_decision decisions[CONTROLLED];
    verge_decision         decision = verge_decision_make(decisions, CONTROLLED);
    static verge_commitment commitment; // all zero: nothing was decided before
    static verge_track      bodies[VEHICLES];
    verge_tracks            tracks = verge_tracks_make(bodies, VEHICLES);
    verge_status            status = verge_scene_place(&scene, 0, heard, VEHICLES, NULL);
    if (status == VERGE_OK) {
        status = verge_decide(decider, &scene, &commitment, &decision);
    }
    if (status == VERGE_OK) {
        // Of the uncontrolled vehicle.
        status = verge_predict(predictor, &scene, &decision, &tracks);
    }
    if (status != VERGE_OK) {
        fprintf(stderr, "%s\n", verge_status_text(status));
        return 1;
    }
    for (uint32_t k = 0; k < POINTS; ++k) { // our trajectories take the place of the predictions
        verge_vehicle now[VEHICLES];
        for (uint32_t i = 0; i < VEHICLES; ++i) {
            now[i] = vehicles[i];
            if (i < decision.vehicle_count) {
                drive(&vehicles[i], &decisions[i], POINT_S * k, &now[i]);
                verge_track_set(&bodies[i], k, now[i].x, now[i].y, now[i].heading, now[i].speed);
            } else {
                now[i].x = bodies[i].x[k];
                now[i].y = bodies[i].y[k];
                now[i].heading = atan2(bodies[i].sin_heading[k], bodies[i].cos_heading[k]);
            }
        }
        for (uint32_t i = 0; i < VEHICLES; ++i) {
            for (uint32_t j = 0; j < i; ++j) {
                if (verge_vehicles_overlap(&now[i], &now[j])) {
                    fprintf(stderr, "%.1f s: vehicles %u and %u touch\n", POINT_S * k, j, i);
                    return 1;
                }
            }
        }
        if (k % 10 == 0) {
            printf("%4.1f s ", POINT_S * k);
            for (uint32_t i = 0; i < VEHICLES; ++i) {
                printf("  vehicle %u: x %5.1f m, y %4.1f m", i, now[i].x, now[i].y);
            }
            printf("\n");
        }
    }
    printf("decided in %u iterations, reward %.3f\n", decision.search.iterations,
           decision.search.reward);
    return 0;
}
