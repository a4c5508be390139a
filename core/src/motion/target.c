/// See target.h.
#include "motion/target.h"

#include "base/contract.h"
#include "motion/follow.h"

/// Region of end speeds. A speed below zero stands for a stop before the end of the segment. [m/s]
typedef struct region {
    double floor;             // hardest braking
    double low, centre, high;
} region;

/// Nearer to the centre of a bend than this share of its radius no vehicle drives. [1]
static const double frame_min = 0.3;

static region speed_region(const vg_job* job, const vg_segment* segment, uint32_t reference,
                           const vg_following* following, const vg_limits* limits,
                           const vg_state* start, bool emergency);
static double speed_gained(const vg_limits* limits, double v0, double T);
static double speed_allowed(const vg_job* job, uint32_t lane, double s);
static uint32_t spread(double* out, uint32_t count, double low, double centre, double high);

void vg_target_sample(vg_batch* batch, const vg_job* job, const vg_limits* limits,
                      const vg_segment* segment, const vg_path* path, uint32_t reference,
                      const vg_state* start, double T, const verge_tracks* tracks, bool emergency)
{
    VERGE_ASSERT(T > 0.0);
    const verge_planner_def* def = job->def;
    VERGE_ASSERT(def->sample_speeds >= 1 && def->sample_speeds <= VERGE_SAMPLE_SPEEDS_MAX);
    VERGE_ASSERT(def->sample_offsets <= VERGE_SAMPLE_OFFSETS_MAX);

    const bool changing = vg_action_changes_lane(segment->action);
    const bool beside = segment->d != 0.0; // a place in the lane that was decided
    const double half = changing ? def->region_offset : def->keep_region_offset;
    const double low = segment->d - half, high = segment->d + half;
    batch->offset_count = spread(batch->offsets, def->sample_offsets, low, segment->d, high);

    batch->lateral_s = vg_max(T - segment->rest, def->point_s);
    const double points = batch->last - batch->start;
    for (uint32_t i = 0; i < batch->offset_count; ++i) {
        batch->offset_penalties[i] = changing || beside ? VG_DECISION_PULL_OFFSET * points
                                                    * vg_square(batch->offsets[i] - segment->d)
                                              : 0.0;
    }

    // A third of the speeds samples braking below the region, if the region has a lower floor.
    const vg_following following = { path, tracks, job->track_index, limits->rear_axle,
                                     batch->start, batch->last, T, def->idm_gap, def->clearance,
                                     changing ? 0.0 : segment->d,
                                     0.5 * T * (start->s_t + segment->v) };
    const region v = speed_region(job, segment, reference, &following, limits, start, emergency);
    double speeds[VERGE_SAMPLE_SPEEDS_MAX];
    const uint32_t braking = v.floor < v.low ? def->sample_speeds / 3 : 0;
    for (uint32_t i = 0; i < braking; ++i) {
        speeds[i] = v.floor + (v.low - v.floor) * i / braking;
    }
    // Braking that was decided without the limits of normal driving is needed.
    const bool needed = emergency && segment->v < start->s_t - 1.0;
    const double pull = needed ? VG_DECISION_PULL_HARD : VG_DECISION_PULL;
    batch->leg_count = braking + spread(speeds + braking, def->sample_speeds - braking, v.low,
                                        v.centre, v.high);
    for (uint32_t i = 0; i < batch->leg_count; ++i) {
        vg_leg* leg = &batch->legs[i];
        const double v1 = speeds[i], v0 = start->s_t;
        const double stop = v1 < 0.0 ? T * v0 / vg_max(v0 - v1, 1e-6) : T;
        leg->path = path;
        leg->limits = limits;
        leg->profile = vg_profile_to_speed(start, vg_max(v1, 0.0), vg_max(stop, 1e-3));
        vg_leg_link(leg, start, batch->lateral_s, segment->d);
        batch->leg_penalties[i] = pull * points
                                * vg_square(vg_max(v1, vg_min(v.centre, 0.0)) - v.centre);
    }
}

/// Speed along the line over the speed of a vehicle that drives at an offset d beside it. [1]
static double line_share(const vg_path* path, double s, double d)
{
    const double frame = 1.0 - vg_path_at(path, s).curvature * d;
    return 1.0 / vg_max(frame, frame_min);
}

/// Decided speeds and limits are those of the vehicle, profiles and follow.h have speeds along the
/// line.
static region speed_region(const vg_job* job, const vg_segment* segment, uint32_t reference,
                           const vg_following* following, const vg_limits* limits,
                           const vg_state* start, bool emergency)
{
    const verge_planner_def* def = job->def;
    const bool changing = vg_action_changes_lane(segment->action);
    const double half = changing ? def->region_speed : def->keep_region_speed;
    const double v0 = start->s_t, a0 = start->s_tt, T = following->T;
    const double eased = vg_max(v0 - VG_LIMIT_BRAKING * T,
                                vg_profile_end_speed(v0, a0, T, -0.9 * def->comfort_jerk));
    const double distance = 0.5 * T * (v0 + vg_min(v0, segment->v));
    const double share = line_share(following->path, start->s + distance, segment->d);
    const double allowed =
        share * speed_allowed(job, reference, start->s + following->rear_axle + distance);
    const double top = vg_max(allowed, eased);
    const double decided = share * segment->v;
    region v;
    v.centre = vg_clamp(decided, 0.0, top);
    v.high = vg_clamp(decided + half, 0.0, top);

    // The hardest braking begins with the jerk limit. -v0 - 1 stops a fast vehicle after half of T
    // and one at walking speed sooner: such short stops are left to the sampler's exact limits.
    const double jerk = emergency ? VG_JERK_MAX : def->comfort_jerk;
    const double hardest = vg_max(vg_profile_end_speed(v0, a0, T, -0.98 * jerk), -v0 - 1.0);
    const double follow = vg_follow_speed(following, start, VG_FOLLOW_BRAKING);
    v.centre = vg_min(v.centre, vg_max(follow, hardest));
    const double follow_hard = vg_follow_speed(following, start, def->comfort_braking);
    v.high = vg_min(v.high, vg_max(follow_hard, vg_max(v.centre, 0.0)));
    // The strongest acceleration begins with the jerk limit, too. Lateral motion needs a share of
    // it, so less acceleration is sampled as well.
    const double fastest = vg_max(vg_min(vg_profile_end_speed(v0, a0, T, 0.98 * jerk),
                                         speed_gained(limits, v0, T)), 0.0);
    v.high = vg_min(v.high, fastest);
    v.centre = vg_min(v.centre, fastest);
    v.low = vg_min(vg_max(decided - half, 0.0), v.centre);
    v.low = decided > fastest ? vg_min(v.low, v0) : v.low;
    v.floor = changing ? v.low : vg_min(v.low, hardest);
    return v;
}

/// End speed with the largest acceleration of the body. The profile's peak is 1.5 times its mean.
static double speed_gained(const vg_limits* limits, double v0, double T)
{
    const double fade = vg_max(1.0, (v0 + 1.0) * limits->per_speed_switch);
    return v0 + 0.66 * T / (limits->per_acceleration * fade);
}

/// Highest speed at s of a lane or of its successors: the speed limit, or less in and before bends
/// and before lower limits (vg_bin).
static double speed_allowed(const vg_job* job, uint32_t lane, double s)
{
    const verge_road* road = job->road;
    lane = vg_road_follow(road, lane, job->target, &s);
    const vg_lane* at = &road->lanes[lane];
    const double bin = (vg_lane_station(at, s) - at->station_start) / VG_BIN;
    const uint32_t i = (uint32_t)vg_clamp(bin, 0.0, at->bin_count - 2.0);
    return vg_min((double)at->bins[i].speed, (double)at->bins[i + 1].speed);
}

/// Uniform samples; the one nearest to the centre is moved to the centre.
static uint32_t spread(double* out, uint32_t count, double low, double centre, double high)
{
    uint32_t nearest = 0;
    for (uint32_t i = 0; i < count; ++i) {
        out[i] = count > 1 ? low + (high - low) * i / (count - 1) : centre;
        if (vg_abs(out[i] - centre) < vg_abs(out[nearest] - centre)) {
            nearest = i;
        }
    }
    out[nearest] = centre;
    return count;
}
