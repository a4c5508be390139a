/// See straighten.h.
#include "motion/straighten.h"

#include "base/contract.h"
#include "motion/follow.h"

/// A faster vehicle is not turned by that much, or slides. [m/s]
static const double speed_most = 3.0;
/// Turned by more than this against the lane: 20 degrees. [rad]
static const double turned_from = 0.35;
/// While the wheel is turned by more than this against the bend of the lane, it is brought back
/// until the vehicle is parallel to the lane. [1/m], [rad]
static const double wheel_from = 0.1;
static const double parallel_within = 0.05;
/// Beyond this angle there is no way forward into the lane: 85 degrees. [rad]
static const double turned_most = 1.48;
/// Walking speeds, the fastest first: the slower the vehicle, the sharper it turns. [m/s]
static const double speeds[] = { 2.0, 1.2, 0.7 };
/// [m/s^2], [m/s^3]
static const double acceleration = 0.8, jerk = 4.0;
/// Share of the largest curvature and of the steering rate that is used. [1]
static const double steer_share = 0.7;
/// The wheel follows what is wanted with this delay: it does not jerk. [s]
static const double steer_lag_s = 0.25;
/// Heading towards the centre of the lane, per metre beside it. [rad/m]
static const double approach = 0.25;
/// The driver looks this far ahead along the lane. [m]
static const double preview = 1.5;
/// Largest heading towards it, the smaller one first: a body close ahead needs the larger. [rad]
static const double approaches[] = { 0.5, 0.9 };
/// A change that begins later than this is not begun yet. [s]
static const double begins_within = 1.6;
/// How far an end of the body's axis may leave the lane, or come farther out than it is now. [m]
static const double swing_most = 0.3;
static const double step_s = 0.01; // [s] of the simulation, at most
/// A body ahead is close that allows no more than this in 3 s: up to 12 m from standstill. [m/s]
static const double close_speed = 4.0;
/// Time after the horizon for which the way is looked at, and what stands there. [s], [m/s]
static const double later_s = 6.0;
static const double standing = 0.5;
#define COUNT(array) (sizeof(array) / sizeof(array)[0])

/// The vehicle at one instant of the simulation, by its rear axle.
typedef struct driver {
    const vg_path*   path;
    const vg_limits* limits;
    double approach_most;            // [rad]
    double x, y, heading, s;         // s: coordinate on the path
    double speed, acceleration;
    double curvature, curvature_t;
    vg_rear rear;
} driver;

static double heading_off(const vg_reference* line, double heading);
static driver begin(vg_workspace* ws, const vg_job* job, uint32_t lane);
static void advance(driver* self, double speed_max, double h);
static void set_rear(driver* self);
static bool simulate(vg_workspace* ws, const vg_job* job, driver* now, double speed_max);
static bool swings_out(const vg_workspace* ws, const vg_job* job, const driver* from,
                       uint32_t lane);
static bool goes_on(driver* now, const vg_workspace* ws, const vg_job* job,
                    const verge_tracks* tracks, double speed_max);
static bool ends_outside(const vg_workspace* ws, const vg_job* job);
static bool runs_out(const vg_workspace* ws, const vg_job* job, uint32_t lane, bool changes);
static bool touches(const vg_workspace* ws, const vg_job* job, const verge_tracks* tracks);

uint32_t vg_straighten_lane(const vg_job* job)
{
    for (uint32_t i = 0; i < job->segment_count && job->segments[i].t0 < begins_within; ++i) {
        const vg_lane* here = &job->road->lanes[job->lane];
        const verge_action action = job->segments[i].action;
        const int32_t beside = action == VERGE_CHANGE_LEFT ? here->left : here->right;
        if (vg_action_changes_lane(action) && beside >= 0) {
            return (uint32_t)beside;
        }
    }
    return job->lane;
}

bool vg_straighten_can(const vg_workspace* ws, const vg_job* job)
{
    return job->on_road && ws->start.speed <= speed_most && vg_workspace_bodies(ws) == 1;
}

bool vg_straighten_applies(vg_workspace* ws, const vg_job* job)
{
    if (!vg_straighten_can(ws, job)) {
        return false;
    }
    const driver at = begin(ws, job, job->lane);
    const vg_reference line = vg_path_at(at.path, at.s);
    const double off = vg_abs(heading_off(&line, at.heading));
    return off <= turned_most
           && (off > turned_from
               || (off > parallel_within && vg_abs(at.curvature - line.curvature) > wheel_from));
}

/// Speed at the end that the bodies ahead allow. [m/s]
static double speed_behind(const driver* at, const vg_job* job, const verge_tracks* tracks)
{
    const vg_following ahead = vg_following_to_horizon(job->def, at->path, tracks, job->track_index,
                                                       at->limits->rear_axle);
    const vg_state state = { .s = at->s, .s_t = at->speed, .s_tt = at->acceleration };
    return vg_follow_speed(&ahead, &state, VG_FOLLOW_BRAKING);
}

bool vg_straighten_is_close(vg_workspace* ws, const vg_job* job, const verge_tracks* tracks)
{
    const driver at = begin(ws, job, job->lane);
    return speed_behind(&at, job, tracks) < close_speed;
}

bool vg_straighten(vg_workspace* ws, const vg_job* job, const verge_tracks* tracks, uint32_t lane)
{
    VERGE_ASSERT(job->segment_count > 0 && lane < job->road->lane_count);
    const driver from = begin(ws, job, lane);
    const double decided = job->segments[job->segment_count - 1].v;
    const double allowed = vg_max(vg_min(decided, speed_behind(&from, job, tracks)), 0.0);
    for (uint32_t i = 0; i < COUNT(approaches) * COUNT(speeds); ++i) {
        driver now = from;
        now.approach_most = approaches[i / COUNT(speeds)];
        const double speed = speeds[i % COUNT(speeds)];
        const double walking = i == 0 ? vg_max(speed, from.speed) : speed;
        const double speed_max = vg_min(walking, allowed);
        if (simulate(ws, job, &now, speed_max) && !swings_out(ws, job, &from, lane)
            && (lane != job->lane || !ends_outside(ws, job))
            && !runs_out(ws, job, job->lane, lane != job->lane) && !runs_out(ws, job, lane, false)
            && !touches(ws, job, tracks) && goes_on(&now, ws, job, tracks, speed_max)) {
            ws->lateral_end = job->def->point_s * (job->def->points - 1);
            ws->cost = vg_motion_cost(ws->motion, ws->limits.rear_axle, job->def,
                                      &job->vehicle->habit.weights, tracks, job->track_index);
            return true;
        }
    }
    return false;
}

/// Heading against the line, in (-pi, pi]. [rad]
static double heading_off(const vg_reference* line, double heading)
{
    double sine, cosine;
    vg_sincos(heading, &sine, &cosine);
    return vg_atan2(sine * line->cos_heading - cosine * line->sin_heading,
                    cosine * line->cos_heading + sine * line->sin_heading);
}

static driver begin(vg_workspace* ws, const vg_job* job, uint32_t lane)
{
    const vg_path* path = vg_workspace_path(ws, job, lane, NULL);
    const vg_motion* start = &ws->start;
    const double most = ws->limits.curvature_max;
    const vg_lane* of = &job->road->lanes[lane];
    const double near = lane == job->lane ? job->s : __builtin_nan("");
    const double s = vg_lane_project(of, start->x, start->y, near);
    return (driver){ .path = path, .limits = &ws->limits, .x = start->x, .y = start->y,
                     .heading = start->heading,
                     .s = vg_path_project(path, start->x, start->y, s),
                     .speed = start->speed, .acceleration = start->acceleration,
                     .curvature = vg_clamp(start->curvature, -most, most) };
}

/// Curvature that the driver wants: so far from the heading that leads to the lane's centre, that
/// the wheel is straight again when it is reached. After a turn of the wheel to the curvature c at
/// the rate r, turning it back takes the heading c^2 / 2 r.
static double wanted_curvature(const driver* self, double rate)
{
    const vg_reference line = vg_path_at(self->path, self->s);
    const double d = vg_left_of(&line, self->x, self->y);
    const double aim = vg_clamp(-approach * d, -self->approach_most, self->approach_most);
    const vg_reference ahead = vg_path_at(self->path, self->s + preview);
    const double off = heading_off(&ahead, self->heading) - aim;
    const double per_metre = rate / vg_max(self->speed, 0.3);
    const double turn = vg_sqrt(2.0 * per_metre * steer_share * vg_abs(off));
    const double most = steer_share * self->limits->curvature_max;
    return vg_clamp(ahead.curvature + (off > 0.0 ? -turn : turn), -most, most);
}

static void advance(driver* self, double speed_max, double h)
{
    const double bend = self->limits->wheelbase * self->curvature;
    const double rate = steer_share * self->limits->steer_rate_max * (1.0 + bend * bend)
                      / self->limits->wheelbase;
    const double change = (wanted_curvature(self, rate) - self->curvature) * h / steer_lag_s;
    const double c1 = self->curvature + vg_clamp(change, -rate * h, rate * h);
    // Not faster than that the wheel can be turned back within the preview.
    const double back = preview * rate / vg_max(vg_abs(self->curvature), 1e-3);
    const double room = vg_min(speed_max, vg_max(back, speeds[COUNT(speeds) - 1])) - self->speed;
    const double gain = vg_sqrt(2.0 * jerk * vg_abs(room));
    const double a = room > 0.0 ? vg_min(acceleration, gain) : -vg_min(acceleration, gain);
    const double a1 = vg_clamp(a, self->acceleration - jerk * h, self->acceleration + jerk * h);
    const double v1 = vg_max(self->speed + 0.5 * h * (self->acceleration + a1), 0.0);
    const double distance = 0.5 * h * (self->speed + v1);
    const double turn = 0.5 * (self->curvature + c1) * distance;
    double sine, cosine;
    vg_sincos(self->heading + 0.5 * turn, &sine, &cosine);
    self->x += distance * cosine;
    self->y += distance * sine;
    self->heading += turn;
    self->s = vg_path_project(self->path, self->x, self->y, self->s);
    self->curvature_t = (c1 - self->curvature) / h;
    self->curvature = c1;
    self->acceleration = v1 > 0.0 ? a1 : 0.0;
    self->speed = v1;
}

static void set_rear(driver* self)
{
    const vg_reference line = vg_path_at(self->path, self->s);
    vg_rear* rear = &self->rear;
    const double off = heading_off(&line, self->heading);
    rear->x = self->x;
    rear->y = self->y;
    vg_sincos(self->heading, &rear->sin_heading, &rear->cos_heading);
    vg_sincos(off, &rear->sin_off, &rear->cos_off);
    rear->d = vg_left_of(&line, self->x, self->y);
    rear->speed = self->speed;
    rear->acceleration = self->acceleration;
    rear->curvature = self->curvature;
    rear->curvature_t = self->curvature_t;
    rear->frame = 1.0;
}

/// Drives to the next instant of the trajectory. True: within the limits of the body.
static bool drive(driver* now, const verge_planner_def* def, double speed_max)
{
    const uint32_t parts = vg_parts_of_point(def, step_s);
    const double before = now->acceleration;
    bool holds = true;
    for (uint32_t i = 0; i < parts; ++i) {
        advance(now, speed_max, def->point_s / parts);
        set_rear(now);
        holds = holds && vg_hard_ratio(now->limits, &now->rear, now->speed) <= 1.0;
    }
    now->rear.jerk = (now->acceleration - before) / def->point_s;
    return holds;
}

/// Drives up to a speed to the end of the horizon. True: within the limits of the body.
static bool simulate(vg_workspace* ws, const vg_job* job, driver* now, double speed_max)
{
    bool holds = true;
    for (uint32_t k = 1; k < job->def->points; ++k) {
        holds = drive(now, job->def, speed_max) && holds;
        vg_workspace_place(ws, k, &now->rear);
    }
    return holds;
}

/// Does the way lead past the bodies that stand, also after the horizon? A vehicle that swings out
/// behind a body and meets it there would stand worse than before.
static bool goes_on(driver* now, const vg_workspace* ws, const vg_job* job,
                    const verge_tracks* tracks, double speed_max)
{
    const uint32_t last = job->def->points - 1;
    const double axle = ws->limits.rear_axle;
    for (double t = 0.0; t < later_s; t += job->def->point_s) {
        (void)drive(now, job->def, speed_max);
        const vg_rear* rear = &now->rear;
        const vg_rectangle body = { rear->x + axle * rear->cos_heading,
                                    rear->y + axle * rear->sin_heading, rear->cos_heading,
                                    rear->sin_heading, ws->body.half_length, ws->body.half_width };
        for (uint32_t j = 0; j < tracks->count; ++j) {
            const verge_track* other = &tracks->of[j];
            const vg_rectangle there = { other->x[last], other->y[last], other->cos_heading[last],
                                         other->sin_heading[last], other->half_length,
                                         other->half_width };
            if (j != job->track_index && vg_abs(other->speed[last]) < standing
                && (ws->ignored >> j & 1) == 0 && vg_rectangle_overlap(&body, &there)) {
                return false;
            }
        }
    }
    return true;
}

/// How far the axis of the body reaches to a side of the lane's centre at instant k. [m]
static double reach(const vg_workspace* ws, const vg_path* path, uint32_t k, double* s, double side)
{
    const verge_track* body = &ws->body;
    *s = vg_path_project(path, body->x[k], body->y[k], *s);
    const vg_reference line = vg_path_at(path, *s);
    const double across = body->sin_heading[k] * line.cos_heading
                        - body->cos_heading[k] * line.sin_heading;
    return side * vg_left_of(&line, body->x[k], body->y[k])
           + body->half_length * vg_abs(across);
}

/// Does an end leave the lane farther than at the start, on a side without a neighbouring lane?
static bool swings_out(const vg_workspace* ws, const vg_job* job, const driver* from,
                       uint32_t lane)
{
    const vg_lane* along = &job->road->lanes[lane];
    for (uint32_t side = 0; side < 2; ++side) {
        const double sign = side == 0 ? 1.0 : -1.0;
        const int32_t beside = side == 0 ? along->left : along->right;
        double s = from->s;
        const double now = reach(ws, from->path, 0, &s, sign);
        const double room = beside >= 0 ? 1.5 * along->width : 0.5 * along->width;
        const double most = vg_max(now, room) + swing_most;
        for (uint32_t k = 1; k < job->def->points; ++k) {
            if (reach(ws, from->path, k, &s, sign) > most) {
                return true;
            }
        }
    }
    return false;
}

/// Does the centre end beyond the boundary of the vehicle's own lane, and farther out than it is?
static bool ends_outside(const vg_workspace* ws, const vg_job* job)
{
    const uint32_t last = job->def->points - 1;
    const vg_lane* lane = &job->road->lanes[job->lane];
    const double s = vg_lane_project(lane, ws->body.x[last], ws->body.y[last], job->s);
    const vg_reference line = vg_lane_at(lane, s);
    const double d = vg_abs(vg_left_of(&line, ws->body.x[last], ws->body.y[last]));
    return s < lane->length && d > vg_max(0.5 * lane->width, vg_abs(job->d));
}

/// Does it drive over the end of a lane that it has to leave?
static bool runs_out(const vg_workspace* ws, const vg_job* job, uint32_t lane, bool changes)
{
    const vg_lane* of = &job->road->lanes[lane];
    return of->dead_end
           && vg_workspace_runs_out(ws, job, of, job->def->points - 1, job->def->comfort_braking,
                                    changes);
}

/// A vehicle that is nearer to another one than the clearance has to come away from it.
static bool touches(const vg_workspace* ws, const vg_job* job, const verge_tracks* tracks)
{
    const uint32_t last = job->def->points - 1;
    for (uint32_t j = 0; j < tracks->count; ++j) {
        const bool near = (ws->near_start[0] >> j & 1) != 0;
        const double clearance = near ? 0.0 : job->def->clearance;
        if (j != job->track_index && (ws->ignored >> j & 1) == 0
            && vg_contact_new(&ws->body, &tracks->of[j], clearance, last) <= last) {
            return true;
        }
    }
    return false;
}
