/// See guide.h.

#include "motion/segments.h"

#include "base/contract.h"
#include "base/scalar.h"
#include "motion/target.h"
#include "traffic/pairs.h"

#include <string.h>

// A change that has come this far beyond a centre goes on to the next one. [m]
static const double beyond_centre = 0.05;
// A change that ends this near to a centre is complete. [m]
static const double complete_within = 0.05;
// The last of a change takes at least this long: what is left of it then is a correction. [s]
static const double finish_min = 1.0;
// As in flow.c: farther than this from the centre a change is under way. [m]
static const double finishing_from = 0.3;

static int32_t id_of(const int32_t* ids, int32_t slot)
{
    return slot < 0 ? -1 : ids[slot];
}

void vg_guide_actions(const vg_model* scene, const vg_decision* decision, uint32_t slot,
                      const int32_t* ids, verge_vehicle_plan* plan)
{
    const verge_road* road = scene->road;
    plan->action_count = decision->line.step_count;
    for (uint32_t t = 0; t < plan->action_count; ++t) {
        const vg_flow* after = &decision->flows[t + 1u];
        const vg_lane* lane = &road->lanes[after->lane[slot]];
        const uint8_t action = decision->line.actions[t][slot];
        int32_t ahead = -1, behind = -1;
        vg_flow_neighbours(scene, after, slot, &ahead, &behind);
        plan->actions[t] = (verge_action_step){
            .action = (verge_action)action,
            .lane_id = lane->id,
            .t0 = (double)t * scene->def->step_s,
            .t1 = (double)(t + 1u) * scene->def->step_s,
            .s = vg_lane_s(lane, (double)after->station[slot]),
            .d = (double)after->d[slot],
            .v = (double)after->v[slot],
            .brake_light = vg_actions[action].brake_light,
            .turn_signal = vg_actions[action].turn_signal,
            .ahead_id = id_of(ids, ahead),
            .behind_id = id_of(ids, behind),
        };
    }
}

// The lane a change is towards, as seen from a lane and an offset on it.
static uint32_t changed_to(const verge_road* road, uint32_t lane, double d, uint8_t action)
{
    const vg_lane* here = &road->lanes[lane];
    if (action == VERGE_CHANGE_LEFT && d > beyond_centre && here->left >= 0) {
        return (uint32_t)here->left;
    }
    if (action == VERGE_CHANGE_RIGHT && d < -beyond_centre && here->right >= 0) {
        return (uint32_t)here->right;
    }
    return lane;
}

// A change during which the lane ends: it aims at the neighbour of the lane it began on, whose
// line goes on beyond the seam.
static void aim_over_seam(const vg_model* scene, const vg_flow* start, const vg_flow* end, uint32_t slot,
                          uint8_t action, vg_segment* segment)
{
    const verge_road* road = scene->road;
    const uint32_t lane = (uint32_t)start->lane[slot];
    const bool left = action == VERGE_CHANGE_LEFT;
    const uint32_t beside = changed_to(road, lane, left ? 1.0 : -1.0, action);
    const double d = (double)start->d[slot];
    const bool finishing = left ? d < -finishing_from : d > finishing_from;
    if (finishing || beside == lane) {
        return;
    }
    const double gap = (double)(left ? start->left_gap[slot] : -start->right_gap[slot]);
    segment->lane = beside;
    segment->d = vg_road_continues(road, lane, (uint32_t)end->lane[slot]) ? (double)end->d[slot] - gap
                                                       : (double)end->d[slot];
}

// Fills in where the run [from, to) is to end; `part` of its last step lies inside the horizon.
static void aim(const vg_model* scene, const vg_decision* decision, uint32_t slot, uint32_t from,
                uint32_t to, double part, vg_segment* segment)
{
    const verge_road* road = scene->road;
    const vg_flow* start = &decision->flows[from];
    const vg_flow* last = &decision->flows[to - 1u];
    const vg_flow* end = &decision->flows[to];
    const uint8_t action = decision->line.actions[from][slot];
    double way = 0.0;
    for (uint32_t t = from; t < to; ++t) {
        way += (double)decision->way[t][slot] * (t + 1u == to ? part : 1.0);
    }
    const vg_lane* lane = &road->lanes[start->lane[slot]];
    segment->action = (verge_action)action;
    segment->v = (double)last->v[slot] + part * (double)(end->v[slot] - last->v[slot]);
    segment->lane = (uint32_t)start->lane[slot];
    segment->d = 0.0;
    if (vg_action_changes_lane(action) && road->lanes[end->lane[slot]].bundle == lane->bundle) {
        // Where the change ends decides the lane; a cut change aims at its part of the way.
        const uint32_t end_lane = (uint32_t)end->lane[slot];
        const double y = (double)last->y[slot] + part * (double)(end->y[slot] - last->y[slot]);
        const float station = last->station[slot]
                              + (float)part * (end->station[slot] - last->station[slot]);
        segment->lane = changed_to(road, end_lane, (double)end->d[slot], action);
        segment->d = y - (double)vg_lane_lateral(&road->lanes[segment->lane], station);
    } else if (vg_action_changes_lane(action)) {
        aim_over_seam(scene, start, end, slot, action, segment);
    }
    const vg_lane* reference = &road->lanes[segment->lane];
    const double s0 = vg_lane_s(reference, (double)start->station[slot]);
    segment->s = s0 + way;
}

void vg_guide_segments(const vg_model* scene, const vg_decision* decision, uint32_t slot, vg_job* job)
{
    const verge_planner_def* def = scene->def;
    const double horizon = (double)(def->points - 1u) * def->point_s;
    const vg_joint_actions* line = &decision->line;
    job->segment_count = 0;
    for (uint32_t from = 0; from < line->step_count && (double)from * def->step_s < horizon - 1e-9;) {
        const uint8_t action = line->actions[from][slot];
        uint32_t to = from + 1u;
        while (to < line->step_count && line->actions[to][slot] == action
               && (double)to * def->step_s < horizon - 1e-9) {
            ++to;
        }
        const double last_start = (double)(to - 1u) * def->step_s;
        vg_segment* segment = &job->segments[job->segment_count++];
        segment->t0 = (double)from * def->step_s;
        segment->t1 = vg_min((double)to * def->step_s, horizon);
        aim(scene, decision, slot, from, to, (segment->t1 - last_start) / def->step_s, segment);
        from = to;
    }
    VERGE_ASSERT(job->segment_count > 0);
    const vg_segment* first = &job->segments[0];
    const bool complete = vg_action_changes_lane(first->action) && vg_abs(first->d) <= complete_within;
    job->change_lane = complete ? (int32_t)first->lane : -1;
}

// The decision's expectation between two steps. [m/s] and [m] driven until then
static double expected_at(const vg_model* scene, const vg_decision* decision, uint32_t slot, double t,
                          double* way)
{
    const double step_s = scene->def->step_s;
    uint32_t step = 0;
    *way = 0.0;
    for (; step + 1u < decision->line.step_count && (double)(step + 1u) * step_s < t; ++step) {
        *way += (double)decision->way[step][slot];
    }
    const double part = vg_min((t - (double)step * step_s) / step_s, 1.0);
    const double v0 = (double)decision->flows[step].v[slot];
    *way += part * (double)decision->way[step][slot];
    return v0 + part * ((double)decision->flows[step + 1u].v[slot] - v0);
}

void vg_guide_finish_change(const vg_model* scene, const vg_decision* decision, uint32_t slot, uint32_t lane,
                            double left, vg_job* job)
{
    const verge_planner_def* def = scene->def;
    const verge_road* road = scene->road;
    const double horizon = (double)(def->points - 1u) * def->point_s;
    const double end = vg_min(vg_max(left, finish_min), horizon);
    uint32_t step = 1;
    while (step < decision->line.step_count && (double)step * def->step_s < end - 1e-9) {
        ++step;
    }
    const vg_lane* here = &road->lanes[job->lane];
    const bool crossed = vg_road_continues(road, lane, job->lane);
    const bool arrives = vg_road_continues(road, lane, (uint32_t)decision->flows[step].lane[slot]);
    const bool to_left = here->left == (int32_t)lane, to_right = here->right == (int32_t)lane;
    // Where the next change follows at once the vehicle need not come to rest between them.
    const bool goes_on = step < decision->line.step_count
                         && vg_action_changes_lane(decision->line.actions[step][slot]);
    if (!arrives || goes_on || !(crossed || to_left || to_right)) {
        return;
    }
    const uint32_t reference = crossed ? job->lane : lane;
    uint32_t gone = 0; // segments that the rest of the change takes the place of
    while (gone < job->segment_count && job->segments[gone].t1 <= end + 1e-9) {
        ++gone;
    }
    const uint32_t kept = job->segment_count - gone;
    memmove(&job->segments[1], &job->segments[gone], kept * sizeof job->segments[0]);
    job->segment_count = kept + 1u;
    if (kept > 0) {
        job->segments[1].t0 = end;
    }
    double way = 0.0;
    const double v = expected_at(scene, decision, slot, end, &way);
    const double s0 = vg_lane_s(&road->lanes[reference], (double)decision->flows[0].station[slot]);
    job->segments[0] = (vg_segment){
        .t1 = end,
        .action = crossed ? VERGE_KEEP_SPEED : to_left ? VERGE_CHANGE_LEFT : VERGE_CHANGE_RIGHT,
        .lane = reference,
        .s = s0 + way,
        .v = v,
    };
    job->change_lane = (int32_t)reference;
}

void vg_guide_off_road(const verge_planner_def* def, const verge_vehicle* vehicle,
                       verge_vehicle_plan* plan)
{
    double v = vehicle->speed;
    plan->action_count = def->steps;
    for (uint32_t t = 0; t < def->steps; ++t) {
        v = vg_max(v - def->deceleration * def->step_s, 0.0);
        plan->actions[t] = (verge_action_step){
            .action = VERGE_DECELERATE,
            .lane_id = VERGE_NO_LANE,
            .t0 = (double)t * def->step_s,
            .t1 = (double)(t + 1u) * def->step_s,
            .v = v,
            .brake_light = true,
            .ahead_id = -1,
            .behind_id = -1,
        };
    }
}
