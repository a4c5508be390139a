/// See target.h.
#include "target.h"

#include "contract.h"

/// Region of end speeds. Below zero means a stop before the segment ends: a braking that would
/// go on below zero is one that stops early. [m/s]
typedef struct region {
    double floor;             // hardest braking
    double low, centre, high;
} region;

static region speed_region(const vg_job* job, const vg_segment* segment, uint32_t reference,
                           const vg_state* start, double T, bool emergency);
static uint32_t spread(double* out, uint32_t count, double low, double centre, double high);

bool vg_action_changes_lane(verge_action action)
{
    return action == VERGE_CHANGE_LEFT || action == VERGE_CHANGE_RIGHT;
}

void vg_target_sample(vg_batch* batch, const vg_job* job, const vg_segment* segment,
                      const vg_path* path, uint32_t reference, const vg_state* start, double T,
                      bool emergency)
{
    const verge_planner_def* def = job->def;
    VERGE_ASSERT(def->sample_speeds >= 1 && def->sample_speeds <= VERGE_SAMPLE_SPEEDS_MAX);
    VERGE_ASSERT(def->sample_offsets <= VERGE_SAMPLE_OFFSETS_MAX);

    const bool changing = vg_action_changes_lane(segment->action);
    const double half = changing ? def->region_offset : def->keep_region_offset;
    const double low = segment->d - half, high = segment->d + half;
    batch->offset_count = spread(batch->offsets, def->sample_offsets, low, segment->d, high);

    const double points = batch->last - batch->start;
    for (uint32_t i = 0; i < batch->offset_count; i += 1) {
        batch->offset_penalties[i] = changing ? VG_DECISION_PULL_OFFSET * points
                                                    * vg_square(batch->offsets[i] - segment->d)
                                              : 0.0;
    }

    // A third of the speeds goes to braking below the region, where there is any.
    const region v = speed_region(job, segment, reference, start, T, emergency);
    double speeds[VERGE_SAMPLE_SPEEDS_MAX];
    const uint32_t braking = v.floor < v.low ? def->sample_speeds / 3 : 0;
    for (uint32_t i = 0; i < braking; i += 1) {
        speeds[i] = v.floor + (v.low - v.floor) * i / braking;
    }
    batch->leg_count = braking + spread(speeds + braking, def->sample_speeds - braking, v.low,
                                        v.centre, v.high);
    for (uint32_t i = 0; i < batch->leg_count; i += 1) {
        vg_leg* leg = &batch->legs[i];
        const double v1 = speeds[i], v0 = start->s_t;
        const double stop = v1 < 0.0 ? T * v0 / vg_max(v0 - v1, 1e-6) : T;
        leg->path = path;
        leg->profile = vg_profile_to_speed(start, vg_max(v1, 0.0), vg_max(stop, 1e-3));
        vg_leg_link(leg, start, T, low, high);
        batch->leg_penalties[i] = VG_DECISION_PULL * points
                                * vg_square(vg_max(v1, 0.0) - v.centre);
    }
}

static region speed_region(const vg_job* job, const vg_segment* segment, uint32_t reference,
                           const vg_state* start, double T, bool emergency)
{
    const verge_planner_def* def = job->def;
    const bool changing = vg_action_changes_lane(segment->action);
    const double half = changing ? def->region_speed : def->keep_region_speed;
    const double v0 = start->s_t;
    const double top = vg_max(job->road->lanes[reference].speed_limit, v0);
    region v;
    v.centre = vg_clamp(segment->v, 0.0, top);
    v.high = vg_clamp(segment->v + half, 0.0, top);
    v.low = vg_max(vg_min(segment->v - half, v.centre), 0.0);
    v.floor = v.low;
    if (!changing) {
        // The profile's first jerk is (6 (v1 - v0) - 4 a0 T) / T^2; the limit gives the floor.
        const double jerk = emergency ? VG_JERK_MAX : def->comfort_jerk;
        const double least = v0 + (4.0 * start->s_tt * T - 0.98 * jerk * T * T) / 6.0;
        v.floor = vg_min(v.low, vg_max(least, -v0 - 1.0)); // a stop after half of T at least
    }
    return v;
}

/// Uniform, and the sample nearest to the centre is the centre itself.
static uint32_t spread(double* out, uint32_t count, double low, double centre, double high)
{
    uint32_t nearest = 0;
    for (uint32_t i = 0; i < count; i += 1) {
        out[i] = count > 1 ? low + (high - low) * i / (count - 1) : centre;
        if (vg_abs(out[i] - centre) < vg_abs(out[nearest] - centre)) {
            nearest = i;
        }
    }
    out[nearest] = centre;
    return count;
}
