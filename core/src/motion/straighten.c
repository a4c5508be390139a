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
static const double steer_share = 0.8;
/// The wheel follows what is wanted with this delay: it does not jerk. [s]
static const double steer_lag_s = 0.15;
/// Heading towards the centre of the lane, per metre beside it. [rad/m]
static const double approach = 0.25;
static const double approach_most = 0.5; // [rad]
/// Free space that a corner may take beyond the lane, and beyond where it is now. [m]
static const double swing_most = 0.3;
static const double step_s = 0.01; // [s] of the simulation, at most

/// The vehicle at one instant of the simulation, by its rear axle.
typedef struct driver {
    const vg_path*   path;
    const vg_limits* limits;
    double x, y, heading, s;         // s: coordinate on the path
    double speed, acceleration;
    double curvature, curvature_t;
    vg_rear rear;
} driver;

static double heading_off(const vg_reference* line, double heading);
static driver begin(vg_workspace* ws, const vg_job* job);
static void advance(driver* self, double speed_max, double h);
static void set_rear(driver* self);
static bool simulate(vg_workspace* ws, const vg_job* job, double speed_max);
static bool swings_out(const vg_workspace* ws, const vg_job* job);
static bool touches(const vg_workspace* ws, const vg_job* job, const verge_tracks* tracks);

bool vg_straighten_applies(vg_workspace* ws, const vg_job* job)
{
    if (!job->on_road || ws->start.speed > speed_most || vg_workspace_bodies(ws) > 1
        || vg_action_changes_lane(job->segments[0].action)) {
        return false;
    }
    const driver at = begin(ws, job);
    const vg_reference line = vg_path_at(at.path, at.s);
    const double off = vg_abs(heading_off(&line, at.heading));
    return off <= turned_most
           && (off > turned_from
               || (off > parallel_within && vg_abs(at.curvature - line.curvature) > wheel_from));
}

/// Speed at the end that the decision and the bodies ahead allow. [m/s]
static double speed_allowed(vg_workspace* ws, const vg_job* job, const verge_tracks* tracks)
{
    const verge_planner_def* def = job->def;
    const driver at = begin(ws, job);
    const uint32_t last = def->points - 1;
    const vg_following ahead = { at.path, tracks, job->track_index, ws->limits.rear_axle, 0, last,
                                 def->point_s * last, def->idm_gap, def->clearance, 0.0 };
    const vg_state state = { .s = at.s, .s_t = at.speed, .s_tt = at.acceleration };
    const double follow = vg_follow_speed(&ahead, &state, VG_FOLLOW_BRAKING);
    return vg_max(vg_min(job->segments[job->segment_count - 1].v, follow), 0.0);
}

bool vg_straighten(vg_workspace* ws, const vg_job* job, const verge_tracks* tracks)
{
    VERGE_ASSERT(job->segment_count > 0);
    const double allowed = speed_allowed(ws, job, tracks);
    for (uint32_t i = 0; i < sizeof speeds / sizeof speeds[0]; ++i) {
        const double walking = i == 0 ? vg_max(speeds[i], ws->start.speed) : speeds[i];
        if (simulate(ws, job, vg_min(walking, allowed)) && !swings_out(ws, job)
            && !touches(ws, job, tracks)) {
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

static driver begin(vg_workspace* ws, const vg_job* job)
{
    const vg_path* path = vg_workspace_path(ws, job, job->lane, NULL);
    const vg_motion* start = &ws->start;
    const double most = ws->limits.curvature_max;
    return (driver){ .path = path, .limits = &ws->limits, .x = start->x, .y = start->y,
                     .heading = start->heading,
                     .s = vg_path_project(path, start->x, start->y, job->s),
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
    const double aim = vg_clamp(-approach * d, -approach_most, approach_most);
    const double off = heading_off(&line, self->heading) - aim;
    const double per_metre = rate / vg_max(self->speed, 0.3);
    const double turn = vg_sqrt(2.0 * per_metre * steer_share * vg_abs(off));
    const double most = steer_share * self->limits->curvature_max;
    return vg_clamp(line.curvature + (off > 0.0 ? -turn : turn), -most, most);
}

static void advance(driver* self, double speed_max, double h)
{
    const double bend = self->limits->wheelbase * self->curvature;
    const double rate = steer_share * self->limits->steer_rate_max * (1.0 + bend * bend)
                      / self->limits->wheelbase;
    const double change = (wanted_curvature(self, rate) - self->curvature) * h / steer_lag_s;
    const double c1 = self->curvature + vg_clamp(change, -rate * h, rate * h);
    const double room = speed_max - self->speed;
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

/// Drives up to a speed to the end of the horizon. True: within the limits of the body.
static bool simulate(vg_workspace* ws, const vg_job* job, double speed_max)
{
    const verge_planner_def* def = job->def;
    const uint32_t parts = (uint32_t)(def->point_s / step_s + 1.0 - 1e-9);
    driver now = begin(ws, job);
    bool holds = true;
    for (uint32_t k = 1; k < def->points; ++k) {
        const double before = now.acceleration;
        for (uint32_t i = 0; i < parts; ++i) {
            advance(&now, speed_max, def->point_s / parts);
            set_rear(&now);
            holds = holds && vg_hard_ratio(now.limits, &now.rear, now.speed) <= 1.0;
        }
        now.rear.jerk = (now.acceleration - before) / def->point_s;
        vg_workspace_place(ws, k, &now.rear);
    }
    return holds;
}

/// How far the body reaches to a side of the lane's centre at instant k. [m]
static double reach(const vg_workspace* ws, const vg_path* path, uint32_t k, double* s, double side)
{
    const verge_track* body = &ws->body;
    *s = vg_path_project(path, body->x[k], body->y[k], *s);
    const vg_reference line = vg_path_at(path, *s);
    const double along = body->cos_heading[k] * line.cos_heading
                       + body->sin_heading[k] * line.sin_heading;
    const double across = body->sin_heading[k] * line.cos_heading
                        - body->cos_heading[k] * line.sin_heading;
    return side * vg_left_of(&line, body->x[k], body->y[k])
           + body->half_length * vg_abs(across) + body->half_width * vg_abs(along);
}

/// Does a corner leave the lane farther than at the start, on a side without a neighbouring lane?
static bool swings_out(const vg_workspace* ws, const vg_job* job)
{
    const vg_lane* lane = &job->road->lanes[job->lane];
    const vg_path* path = ws->path_lanes[0] == (int32_t)job->lane ? &ws->paths[0] : &ws->paths[1];
    for (uint32_t side = 0; side < 2; ++side) {
        const double sign = side == 0 ? 1.0 : -1.0;
        const int32_t beside = side == 0 ? lane->left : lane->right;
        double s = job->s;
        const double now = reach(ws, path, 0, &s, sign);
        const double room = beside >= 0 ? 1.5 * lane->width : 0.5 * lane->width;
        const double most = vg_max(now, room) + swing_most;
        for (uint32_t k = 1; k < job->def->points; ++k) {
            if (reach(ws, path, k, &s, sign) > most) {
                return true;
            }
        }
    }
    return false;
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
