/// See expected.h.
#include "motion/expected.h"

#include "base/contract.h"
#include "base/scalar.h"
#include "traffic/flow.h"

// Upper limits of the numbers in a decision. [m], [m/s]
static const double distance_max = 1e5;
static const double speed_max = 100.0;
static const double time_max = 1e4; // [s]
// Largest difference between the end of a step and the start of the next. [s]
static const double step_gap_max = 1e-6;

static vg_expected_state state_at(const verge_road* road, uint32_t lane, double s, double d,
                                  double v);
static bool step_holds(const verge_road* road, const verge_action_step* step);

bool vg_expected_from(vg_expected* expected, const verge_scene* scene, uint32_t vehicle_index,
                      const verge_vehicle_decision* decision)
{
    const verge_road* road = scene->road;
    const verge_lane_position* at = &scene->positions[vehicle_index];
    const int32_t lane = vg_road_lane_index(road, at->lane_id);
    VERGE_ASSERT(lane >= 0);
    if (decision->step_count == 0 || decision->step_count > VERGE_STEPS_MAX
        || decision->pass_count > VERGE_PASSES_MAX
        || (unsigned)decision->why.code >= VERGE_WHY_COUNT) {
        return false;
    }
    expected->step_count = decision->step_count;
    expected->t[0] = 0.0;
    expected->states[0] =
        state_at(road, (uint32_t)lane, at->s, at->d, scene->vehicles[vehicle_index].speed);
    for (uint32_t t = 0; t < decision->step_count; ++t) {
        const verge_action_step* step = &decision->steps[t];
        if (!step_holds(road, step) || vg_abs(step->t0 - expected->t[t]) > step_gap_max) {
            return false;
        }
        expected->t[t + 1u] = step->t1;
        expected->actions[t] = (uint8_t)step->action;
        expected->distance[t] = (float)step->distance;
        expected->states[t + 1u] = state_at(road, (uint32_t)vg_road_lane_index(road, step->lane_id),
                                            step->s, step->d, step->v);
    }
    return true;
}

static bool step_holds(const verge_road* road, const verge_action_step* step)
{
    return (unsigned)step->action < VERGE_ACTION_COUNT
           && vg_road_lane_index(road, step->lane_id) >= 0 && vg_abs(step->s) <= distance_max
           && vg_abs(step->d) <= distance_max && step->t1 > step->t0 && step->t1 <= time_max
           && step->v >= 0.0 && step->v <= speed_max && step->distance >= 0.0
           && step->distance <= distance_max;
}

static vg_expected_state state_at(const verge_road* road, uint32_t lane, double s, double d,
                                  double v)
{
    const vg_lane* at_lane = &road->lanes[lane];
    const float station = (float)vg_lane_station(at_lane, s);
    const vg_bin_place place = vg_bin_at(at_lane, station);
    const vg_bin* nearest = place.t < 0.5f ? place.here : place.here + 1;
    return (vg_expected_state){
        .lane = lane,
        .station = station,
        .d = (float)d,
        .v = (float)v,
        .y = vg_bin_centre(place) + (float)d,
        .rate = vg_bin_rate(place),
        .left_gap = place.inside ? nearest->left_gap : 0.0f,
        .right_gap = place.inside ? nearest->right_gap : 0.0f,
    };
}
