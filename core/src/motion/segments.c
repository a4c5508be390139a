/// See segments.h.

#include "motion/segments.h"

#include "base/contract.h"
#include "base/scalar.h"
#include "traffic/flow.h"

#include <string.h>

// A lane change whose end is beyond a centre by this much continues to the next centre. [m]
static const double beyond_centre = 0.05;
// A change that ends this near to a centre is complete. [m]
static const double complete_within = 0.05;
// An offset in the lane that is meant, and one that has not changed. [m]
static const double offset_min = 0.05;
static const double offset_slack = 1e-3;
// Lateral motion of a decision step: largest change of d per distance driven, and per second, as in
// moves.c. [1], [m/s]
static const double lateral_slope = 0.5;
static const double lateral_speed = 1.0;
// Shortest duration of the rest of a lane change. [s]
static const double finish_min = 1.0;
// No segment after it is shorter than this: what moves in less time, moves with a jolt. [s]
static const double rest_min = 1.0;
// Farther than this from the centre a lane change is in progress, as VG_CENTRED. [m]
static const double finishing_from = 0.3;

// The lane to which a change leads, from a lane and an offset on it.
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

// End of a change during which the lane ends: it is stated on the neighbour of the first lane,
// whose line continues on its successors.
static void set_end_beyond_lane(const verge_road* road, const vg_expected_state* start,
                                const vg_expected_state* end, uint8_t action, vg_segment* segment)
{
    const uint32_t lane = start->lane;
    const bool left = action == VERGE_CHANGE_LEFT;
    const uint32_t beside = changed_to(road, lane, left ? 1.0 : -1.0, action);
    const double d = (double)start->d;
    const bool finishing = left ? d < -finishing_from : d > finishing_from;
    if (finishing || beside == lane) {
        return;
    }
    const double gap = (double)(left ? start->left_gap : -start->right_gap);
    segment->lane = beside;
    segment->d = vg_road_continues(road, lane, end->lane) ? (double)end->d - gap
                                                       : (double)end->d;
}

// The d to which a step that keeps the lane moves. One that comes closer to the centre, and by as
// much as a vehicle can in a step, is on its way to the centre. [m]
static double kept_offset(const vg_expected* expected, uint32_t step)
{
    const vg_expected_state *start = &expected->states[step], *end = &expected->states[step + 1u];
    const double from = vg_abs((double)start->d), to = vg_abs((double)end->d);
    const double dt = expected->t[step + 1u] - expected->t[step];
    const double reach = dt * vg_min(lateral_slope * (double)start->v, lateral_speed);
    const bool returns = to < from - offset_slack && from - to > reach - offset_slack;
    return returns || to < offset_min ? 0.0 : (double)end->d;
}

// Is step t a part of the same motion as the step before it?
static bool continues_step(const vg_expected* expected, uint32_t t)
{
    const uint8_t action = expected->actions[t];
    if (action != expected->actions[t - 1u]) {
        return false;
    }
    const double before = kept_offset(expected, t - 1u), now = kept_offset(expected, t);
    return vg_action_changes_lane(action) || vg_abs(now - before) < offset_min
           || (now * before > 0.0 && vg_abs(now) > vg_abs(before));
}

// Sets the end of a segment that covers the steps [from, to). Of the last step only `part` lies
// within the horizon. whole: a change is aimed at its end, where the horizon cuts it.
static void set_end(const verge_road* road, const vg_expected* expected, uint32_t from, uint32_t to,
                    double part, bool whole, vg_segment* segment)
{
    const vg_expected_state* start = &expected->states[from];
    const vg_expected_state* last = &expected->states[to - 1u];
    const vg_expected_state* end = &expected->states[to];
    const uint8_t action = expected->actions[from];
    double distance = 0.0;
    for (uint32_t t = from; t < to; ++t) {
        distance += (double)expected->distance[t] * (t + 1u == to ? part : 1.0);
    }
    const vg_lane* lane = &road->lanes[start->lane];
    segment->action = (verge_action)action;
    segment->rest = 0.0;
    segment->v = (double)last->v + part * (double)(end->v - last->v);
    segment->lane = start->lane;
    segment->d = kept_offset(expected, to - 1u);
    if (vg_action_changes_lane(action) && road->lanes[end->lane].bundle == lane->bundle) {
        // The end of the change determines the lane. A change cut by the horizon covers a part of
        // it.
        const uint32_t end_lane = end->lane;
        const double y = (double)last->y + part * (double)(end->y - last->y);
        const float station = last->station + (float)part * (end->station - last->station);
        segment->lane = changed_to(road, end_lane, (double)end->d, action);
        segment->d = y - (double)vg_lane_lateral(&road->lanes[segment->lane], station);
        segment->d = whole ? 0.0 : segment->d;
    } else if (vg_action_changes_lane(action)) {
        set_end_beyond_lane(road, start, end, action, segment);
    }
    const vg_lane* reference = &road->lanes[segment->lane];
    const double s0 = vg_lane_s(reference, (double)start->station);
    segment->s = s0 + distance;
}

void vg_segments_from(const vg_expected* expected, vg_job* job)
{
    VERGE_ASSERT(expected->step_count >= 1 && expected->step_count <= VERGE_STEPS_MAX);
    const verge_planner_def* def = job->def;
    const double horizon = (double)(def->points - 1u) * def->point_s;
    const double* t = expected->t;
    job->segment_count = 0;
    for (uint32_t from = 0; from < expected->step_count && t[from] < horizon - 1e-9;) {
        uint32_t to = from + 1u;
        while (to < expected->step_count && continues_step(expected, to)
               && t[to] < horizon - 1e-9) {
            ++to;
        }
        vg_segment* segment = &job->segments[job->segment_count++];
        segment->t0 = t[from];
        segment->t1 = vg_min(t[to], horizon);
        const double part = (segment->t1 - t[to - 1u]) / (t[to] - t[to - 1u]);
        // The lateral motion does not end with the horizon, so a change up to there is aimed whole.
        const bool whole = def->search != VERGE_SEARCH_PAPER && segment->t1 >= horizon - 1e-9;
        set_end(job->road, expected, from, to, part, whole, segment);
        from = to;
    }
    VERGE_ASSERT(job->segment_count > 0);
    const vg_segment* first = &job->segments[0];
    const bool complete =
        vg_action_changes_lane(first->action) && vg_abs(first->d) <= complete_within;
    job->change_lane = complete ? (int32_t)first->lane : -1;
}

// Expected speed at time t [m/s], and distance driven until then [m].
static double expected_at(const vg_expected* expected, double t, double* distance)
{
    uint32_t step = 0;
    *distance = 0.0;
    for (; step + 1u < expected->step_count && expected->t[step + 1u] < t; ++step) {
        *distance += (double)expected->distance[step];
    }
    const double step_s = expected->t[step + 1u] - expected->t[step];
    const double part = vg_min((t - expected->t[step]) / step_s, 1.0);
    const double v0 = (double)expected->states[step].v;
    *distance += part * (double)expected->distance[step];
    return v0 + part * ((double)expected->states[step + 1u].v - v0);
}

void vg_segments_finish_change(const vg_expected* expected, uint32_t lane, double left, vg_job* job)
{
    VERGE_ASSERT(lane < job->road->lane_count);
    VERGE_ASSERT(job->segment_count >= 1);
    const verge_planner_def* def = job->def;
    const verge_road* road = job->road;
    const double horizon = (double)(def->points - 1u) * def->point_s;
    const double least = vg_min(vg_max(left, finish_min), horizon);
    uint32_t step = 1;
    while (step < expected->step_count && expected->t[step] < least - 1e-9) {
        ++step;
    }
    const vg_lane* here = &road->lanes[job->lane];
    const bool crossed = vg_road_continues(road, lane, job->lane);
    const bool arrives = vg_road_continues(road, lane, expected->states[step].lane);
    const bool to_left = here->left == (int32_t)lane, to_right = here->right == (int32_t)lane;
    // If another change follows directly, the vehicle does not stop its lateral motion between
    // them.
    const bool goes_on = step < expected->step_count
                         && vg_action_changes_lane(expected->actions[step]);
    if (!arrives || goes_on || !(crossed || to_left || to_right)) {
        return;
    }
    const uint32_t reference = crossed ? job->lane : lane;
    // Segments that the rest of the change replaces, or of which too little is left after it.
    uint32_t gone = 0;
    while (gone < job->segment_count && job->segments[gone].t1 < least + rest_min - 1e-9) {
        ++gone;
    }
    const uint32_t kept = job->segment_count - gone;
    const double end = kept > 0 ? least : horizon;
    memmove(&job->segments[1], &job->segments[gone], kept * sizeof job->segments[0]);
    job->segment_count = kept + 1u;
    if (kept > 0) {
        job->segments[1].t0 = end;
    }
    double distance = 0.0;
    const double v = expected_at(expected, end, &distance);
    const double s0 = vg_lane_s(&road->lanes[reference], (double)expected->states[0].station);
    job->segments[0] = (vg_segment){
        .t1 = end,
        .action = crossed ? VERGE_KEEP_SPEED : to_left ? VERGE_CHANGE_LEFT : VERGE_CHANGE_RIGHT,
        .lane = reference,
        .s = s0 + distance,
        .v = v,
        .rest = end - least,
    };
    job->change_lane = (int32_t)reference;
}
