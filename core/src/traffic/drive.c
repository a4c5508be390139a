/// See drive.h.
#include "traffic/drive.h"

#include "base/contract.h"
#include "base/scalar.h"
#include "traffic/advance.h"
#include "traffic/goal.h"
#include "traffic/humans.h"
#include "traffic/order.h"
#include "traffic/pairs.h"
#include "traffic/value.h"

// Comfortable braking for what is ahead, and braking of DC where nothing asks for it. [m/s^2]
static const float comfort_braking = 2.0f, chosen_braking = 1.0f;
// A vehicle nearer than this to the one ahead follows it: KS keeps its gap. [s], [m/s^2]
static const float following_s = 5.0f, keeping_acceleration = 0.4f;
// Above the limit where it is, a vehicle that leaves a slow place drives by at most this more.
// [m/s^2]
static const float limit_rise = 1.0f;
// Braking with which a vehicle can stop when a red signal opens, and for how long it waits to be
// sure of that. [m/s^2], [s]
static const float opening_braking = 3.0f, opening_reserve = 0.3f;
// Braking before the end of a lane: a vehicle that merges needs the lane to gain speed. [m/s^2]
static const float end_braking = 4.0f;
// Gap at standstill. [m]
static const float standstill_gap = 2.0f;
// Time gap to a vehicle ahead that verge plans as well: its braking is known. [s]
static const float planned_gap_s = 0.6f;
// Braking that remains safe if the one ahead brakes as hard as it can: reaction time [s], share of
// the body's braking. [1]
static const float reaction_s = 0.5f, hard_share = 0.8f;
// The front of a vehicle stops this far before the end of a lane that it has to leave: enough to
// swing out from standstill. [m]
static const float end_reserve = 4.0f;
// A change at the end of a lane may use the road this far beyond it. [m]
static const float beyond_end = 6.0f;
// Largest lateral motion per distance driven. Over short distances the turning circle limits it:
// twice its radius. [1], [m]
static const float slope_max = 0.5f, turning_circle = 14.0f;
// The same for the nose of a vehicle that turns out before a standing body, up to this speed. [1],
// [m/s]
static const float slope_of_nose = 0.7f, turning_speed = 6.0f;
// Half a lane change takes this long (paper, section 4). [s]
static const float half_change_s = 1.5f;
// A lane is at least this wide for the lateral speed of a change. [m]
static const float lane_width_min = 3.0f;
// Rules for gaps in the lane changed to: braking that a change may cost the vehicle itself and the
// one behind [m/s^2]; factor of the time gap [1].
static const float change_braking = 1.5f, change_braking_behind = 2.0f, change_gap_share = 0.4f;
// Largest difference of speed to vehicles within a distance in the lane changed to, where the own
// lane leaves this much room to adapt. [m/s], [m], [s] and [m]
static const float speed_difference = 4.5f, adapting_reach = 65.0f;
static const float adapting_s = 2.0f, adapting_distance = 20.0f;
// Rules for a change under way, looser so that it is finished: room, and room left after two
// seconds of closing. [m], [s]
static const float finish_room = 1.5f, finish_left = 1.0f, finish_s = 2.0f;
// Speed of a change that turns out close before a standing body [m/s]; how near [m]; below which
// speed it counts as standing [m/s].
static const float squeeze_speed = 2.5f, close_distance = 15.0f, standing_speed = 0.5f;
// Lateral speed of a change, and time to spare when the body ahead is cleared. [m/s], [s]
static const float clearing_speed = 1.1f, clearing_reserve = 0.2f;
// A change out from behind a body has begun from this offset on. [m], below this speed [m/s]
static const float begun_offset = 0.1f, walking_speed = 3.0f;
// Beside a body within its lane a vehicle is at most this far from the centre. [m]
static const float passing_offset = 1.2f;
// Lateral clearance when passing a body. [m]
static const float pass_clearance = 0.3f;
// Lanes whose time to go is longer by this much are not entered. [s]
static const float worse_lane = 10.0f;
// A lane change has to gain this much; one under way goes on unless it loses that much. [s]
static const float change_gain = 0.7f;
// A lane that does not lead to the target counts for this long. [s]
static const float wrong_lane_s = 10.0f;
// Slower vehicles ahead count as far as is driven in this time. [s]
static const float look_ahead_s = 20.0f;
static const float delay_max = 30.0f;    // [s]
// A vehicle opens a gap beside by driving slower by this; a human behind leaves this time gap; time
// that counts at most. [m/s], [s], [s]
static const float adapting_speed = 2.5f, let_in_s = 0.6f, blocked_most = 8.0f;
static const float queue_delay = 4.0f;   // [s] behind a vehicle that stands for a while

static float longitudinal(const vg_model* model, const vg_flow* flow, vg_moves* moves,
                          uint32_t slot);
static void set_state(const vg_flow* flow, vg_moves* moves, uint32_t slot, uint32_t along, float v1,
                      float distance);
static void lateral(const vg_model* model, const vg_flow* flow, vg_moves* moves, uint32_t slot);
static uint8_t changes_allowed(const vg_model* model, const vg_flow* flow, uint32_t slot);

void vg_drive_moves(const vg_model* model, const vg_flow* flow, vg_moves* moves)
{
    const float dt = (float)model->def->step_s;
    for (uint32_t i = 0; i < model->controlled_count; ++i) {
        moves->station[VG_KEEP_SPEED][i] = flow->station[i] + flow->v[i] * dt / flow->rate[i];
        moves->v[VG_KEEP_SPEED][i] = flow->v[i];
        lateral(model, flow, moves, i);
    }
    vg_flow_human_moves(model, flow, dt, moves->station[0], moves->v[0], moves->y[0]);
    float kept[VERGE_CONTROLLED_MAX];
    for (uint32_t i = 0; i < model->controlled_count; ++i) {
        kept[i] = longitudinal(model, flow, moves, i);
        moves->unchecked[i] = changes_allowed(model, flow, i);
    }
    for (uint32_t i = 0; i < model->controlled_count; ++i) { // seen by the others as KS until here
        set_state(flow, moves, i, VG_KEEP_SPEED, kept[i], 0.5f * (flow->v[i] + kept[i]) * dt);
    }
}

// ---------------------------------------------------------------------------- along the lane

// Largest speed at the end of a step from which a vehicle can still follow: after the time tau it
// brakes by b, as the one ahead does from v_ahead, and does not use up the gap (Gipps). gap: free
// distance after the step if the vehicle keeps its speed v. [m/s]
static float safe_speed(float gap, float v_ahead, float v, float dt, float tau, float b)
{
    const float c = b * (tau + 0.5f * dt);
    // A vehicle that comes towards this one uses up the gap while this one brakes.
    const float oncoming = v_ahead < 0.0f ? v_ahead * (v / b + dt) : 0.0f;
    const float ahead = v_ahead > 0.0f ? v_ahead * v_ahead : 0.0f;
    const float square = c * c + ahead + 2.0f * b * (gap + oncoming + 0.5f * v * dt);
    return square > c * c ? (float)vg_sqrt((double)square) - c : 0.0f;
}

static float time_gap(const vg_model* model, uint32_t slot, int32_t ahead)
{
    return ahead >= 0 && ahead < (int32_t)model->controlled_count ? planned_gap_s
                                                                  : model->time_gap[slot];
}

// Safe speed behind the vehicle ahead: comfortable, and safe if that one brakes hard.
static float following_speed(const vg_model* model, const vg_flow* flow, const vg_neighbours* w,
                             uint32_t slot, float share)
{
    if (w->ahead < 0) {
        return VG_FAR_AWAY;
    }
    const float dt = (float)model->def->step_s, v = flow->v[slot];
    const float gap = w->gap_ahead - model->half_length[slot];
    const float comfort = safe_speed(gap - standstill_gap, w->v_ahead, v, dt,
                                     share * time_gap(model, slot, w->ahead), comfort_braking);
    const float own = hard_share * model->braking_hard[slot];
    const float other = model->braking_hard[w->ahead];
    if (own >= other) {
        return comfort;
    }
    const float v_ahead = w->v_ahead * (float)vg_sqrt((double)(own / other));
    return vg_minf(comfort, safe_speed(gap, v_ahead, v, dt, reaction_s, own));
}

// Speed limit at a station that may lie on a lane that continues this one. [m/s]
static float limit_at(const vg_model* model, const vg_flow* flow, uint32_t slot, float station)
{
    int32_t lane = flow->lane[slot];
    vg_flow_pass_ends(model, slot, flow->rate[slot], &lane, &station);
    const vg_bin_place place = vg_bin_at(&model->road->lanes[lane], station);
    return vg_minf(vg_minf(place.here[0].speed, place.here[1].speed), model->speed_max[slot]);
}

// Safe speed before a line at which the front has to stop. distance: from the centre. [m]
static float stopping_speed(const vg_model* model, const vg_flow* flow, uint32_t slot,
                            float distance, float braking)
{
    if (distance >= 0.5f * VG_FAR_AWAY) {
        return VG_FAR_AWAY;
    }
    const float dt = (float)model->def->step_s, v = flow->v[slot];
    const float gap = distance - model->half_length[slot] - v * dt;
    return safe_speed(gap, 0.0f, v, dt, 0.0f, braking);
}

// Safe speed before a wall. At the instant when a red signal opens within the step, the vehicle can
// still stop at its line, but need not have braked for it. [m/s]
static float wall_speed(const vg_model* model, const vg_flow* flow, uint32_t slot)
{
    const float dt = (float)model->def->step_s, v = flow->v[slot];
    const vg_wall wall = vg_order_wall_why(model, flow, slot);
    const float opens = wall.opens + opening_reserve;
    if (opens >= dt) {
        return stopping_speed(model, flow, slot, wall.distance, comfort_braking);
    }
    const float gap = wall.distance - model->half_length[slot] - v * opens;
    const float then = safe_speed(gap, 0.0f, v, opens, 0.0f, opening_braking);
    return vg_minf(vg_maxf(v + (then - v) * dt / opens, 0.0f),
                   stopping_speed(model, flow, slot, vg_order_wall_beyond(model, flow, slot),
                                  comfort_braking));
}

// The end of a lane that has to be left. [m] from the centre to the place where the front stops
static float dead_end_ahead(const vg_model* model, const vg_flow* flow, uint32_t slot)
{
    const vg_lane* lane = &model->road->lanes[flow->lane[slot]];
    if (!lane->dead_end) {
        return VG_FAR_AWAY;
    }
    return ((float)lane->station_end - flow->station[slot]) * flow->rate[slot] - end_reserve;
}

static void set_state(const vg_flow* flow, vg_moves* moves, uint32_t slot, uint32_t along, float v1,
                      float distance)
{
    moves->v[along][slot] = v1;
    moves->station[along][slot] = flow->station[slot] + distance / flow->rate[slot];
}

// Behind a vehicle, KS keeps the gap and not the speed alone, with small accelerations.
static float kept_speed(const vg_model* model, const vg_flow* flow, const vg_neighbours* keep,
                        uint32_t slot, float most)
{
    const float dt = (float)model->def->step_s, v = flow->v[slot];
    const bool follows = keep->ahead >= 0
                         && keep->gap_ahead - model->half_length[slot] < following_s * v;
    const float change = keeping_acceleration * dt;
    return follows || most < v ? vg_maxf(v + vg_minf(vg_maxf(most - v, -change), change), 0.0f) : v;
}

// Computes the states of AC and DC and which actions are legal. Returns the speed after KS.
static float longitudinal(const vg_model* model, const vg_flow* flow, vg_moves* moves,
                          uint32_t slot)
{
    const float dt = (float)model->def->step_s, v = flow->v[slot];
    const float station = moves->station[VG_KEEP_SPEED][slot];
    vg_neighbours* keep = &moves->keep[slot];
    *keep = vg_nearest(model, flow, slot, station, moves->y[VG_KEEP_LANE][slot], moves->station[0],
                       moves->v[0], VG_FAR_AWAY);
    const float limit = vg_minf(limit_at(model, flow, slot, station),
                                vg_minf(flow->limit[slot], model->speed_max[slot])
                                    + limit_rise * dt);
    moves->wall[slot] = wall_speed(model, flow, slot);
    const float free =
        vg_minf(following_speed(model, flow, keep, slot, 1.0f),
                vg_minf(stopping_speed(model, flow, slot, dead_end_ahead(model, flow, slot),
                                       end_braking), moves->wall[slot]));
    const float most = vg_minf(limit, free);

    const float v_ac = vg_minf(v + model->gain[slot], most);
    set_state(flow, moves, slot, VG_SPEED_UP, v_ac, 0.5f * (v + v_ac) * dt);

    const float hardest = model->braking_hard[slot];
    const float for_limit = vg_minf((v - limit) / dt, comfort_braking);
    const float needed = vg_minf(vg_maxf(for_limit, (v - free) / dt), hardest);
    const float braking = needed > 0.0f ? needed : vg_minf(chosen_braking, hardest);
    const float v_dc = vg_maxf(v - braking * dt, 0.0f);
    const float way = v < braking * dt ? 0.5f * v * v / braking : 0.5f * (v + v_dc) * dt;
    set_state(flow, moves, slot, VG_SLOW_DOWN, v_dc, way);

    // No slack before a place where the vehicle has to stop: it would creep past it.
    const float slack = most > 1.0f ? 0.1f : 0.0f; // [m/s]
    const float kept = kept_speed(model, flow, keep, slot, most);
    uint32_t legal = kept <= most + slack ? 1u << VERGE_KEEP_SPEED : 0u;
    legal |= v_ac > v + 0.05f ? 1u << VERGE_ACCELERATE : 0u;
    legal |= v > 0.0f || legal == 0 ? 1u << VERGE_DECELERATE : 0u;
    // A vehicle that stood without a cause, or in a circle, drives on wherever it can.
    if (vg_order_helps(model->order, slot) && (legal & 1u << VERGE_ACCELERATE) != 0) {
        legal = 1u << VERGE_ACCELERATE;
    }
    moves->legal[slot] = (uint8_t)legal;
    return kept;
}

// ---------------------------------------------------------------------------- across the lane

static float lateral_within(float distance)
{
    return distance * vg_minf(slope_max, distance / turning_circle);
}

// Lateral distance of one step where speed does not limit it. [m]
static float reach_of(const vg_model* model, float across)
{
    return vg_maxf(across, lane_width_min) * 0.5f * (float)model->def->step_s / half_change_s;
}

// Lane keeping returns to the centre of the lane, or to where there is room beside a body.
static void lateral(const vg_model* model, const vg_flow* flow, vg_moves* moves, uint32_t slot)
{
    const float d = flow->d[slot], v = flow->v[slot];
    const float most = vg_maxf(flow->left_gap[slot], flow->right_gap[slot]);
    const float reach =
        vg_minf(reach_of(model, most), lateral_within(v * (float)model->def->step_s));
    const float goal = vg_lane_goal(model, flow, slot, moves->station[VG_KEEP_SPEED][slot]);
    moves->y[VG_KEEP_LANE][slot] = flow->y[slot] + vg_maxf(vg_minf(goal - d, reach), -reach);
}

// Distance to the centre of the lane beside; 0: no change there. Where a lane ends beside one that
// continues, a change may still begin a little beyond the end. [m]
static float across_gap(const vg_model* model, const vg_flow* flow, uint32_t slot, bool left)
{
    const float gap = left ? flow->left_gap[slot] : flow->right_gap[slot];
    const vg_lane* lane = &model->road->lanes[flow->lane[slot]];
    if (gap > 0.0f || !lane->dead_end) {
        return gap;
    }
    const float beyond = flow->station[slot] - (float)lane->station_end;
    const vg_bin* last = &lane->bins[lane->bin_count - 1u];
    const vg_bin* before = last - 1;
    if (beyond < (float)-VG_BIN || beyond > beyond_end) {
        return 0.0f;
    }
    return left ? vg_maxf(last->left_gap, before->left_gap)
                : vg_maxf(last->right_gap, before->right_gap);
}

static int32_t lane_beside(const vg_model* model, const vg_flow* flow, uint32_t slot, bool left)
{
    const vg_lane* lane = &model->road->lanes[flow->lane[slot]];
    return left ? lane->left : lane->right;
}

// Time to go by a lane, with what it costs to be in it for a while if it is not a target lane. [s]
static float time_to_go(const vg_model* model, uint32_t slot, int32_t lane, float station)
{
    if (model->value == NULL || lane < 0) {
        return 0.0f;
    }
    const vg_way* ways = model->ways[slot];
    const bool wrong = ways != NULL && (ways[lane] & VG_WAY_CHANGES) != 0;
    return vg_value_at(model->value, slot, (uint32_t)lane, station)
           + (wrong ? model->wrong_lane[slot] * wrong_lane_s : 0.0f);
}

// Offset of a vehicle from where it is to drive in its lane. [m]
static float off_goal(const vg_model* model, const vg_flow* flow, uint32_t slot)
{
    return flow->d[slot] - vg_lane_goal(model, flow, slot, flow->station[slot]);
}

// Is the vehicle on its way from the lane beside, on the right (sign 1) or left (-1)? Where it
// passes a body within its lane, or has passed it, it is not. It is not either where it left the
// centre of the only lane in a bend. Lane keeping leads back to the centre.
static bool came_from(const vg_model* model, const vg_flow* flow, uint32_t slot, float sign)
{
    const bool alone = lane_beside(model, flow, slot, true) < 0
                       && lane_beside(model, flow, slot, false) < 0;
    const float from = model->body_count > 0 || alone ? passing_offset : VG_CENTRED;
    return sign * flow->d[slot] < -from && sign * off_goal(model, flow, slot) < -from;
}

// The changes that the road allows, without those to lanes that lead nowhere.
static uint8_t changes_allowed(const vg_model* model, const vg_flow* flow, uint32_t slot)
{
    const float own = time_to_go(model, slot, flow->lane[slot], flow->station[slot]);
    uint32_t allowed = 0;
    for (uint32_t side = 0; side < 2; ++side) {
        const bool left = side == 0;
        const uint32_t bit = 1u << (left ? VERGE_CHANGE_LEFT : VERGE_CHANGE_RIGHT);
        if (came_from(model, flow, slot, left ? 1.0f : -1.0f)) {
            allowed |= bit; // completes the change that led here
        } else if (across_gap(model, flow, slot, left) > 0.0f) {
            const int32_t beside = lane_beside(model, flow, slot, left);
            const float there = time_to_go(model, slot, beside, flow->station[slot]);
            allowed |= there < own + worse_lane ? bit : 0u;
        }
    }
    return (uint8_t)allowed;
}

// What a lane change has to fit between.
typedef struct gaps {
    vg_neighbours w;       // in the lane changed to
    float ahead, behind;   // [m] free there
    bool  under_way;       // the change has begun, or completes an earlier one
} gaps;

static bool closing_fits(float gap, float opening)
{
    return gap >= finish_room && gap + finish_s * opening > finish_left;
}

static bool fits_behind_leader(const vg_model* model, const vg_flow* flow, uint32_t slot,
                               const gaps* g)
{
    const float v = flow->v[slot], dt = (float)model->def->step_s;
    if (g->w.ahead < 0) {
        return true;
    }
    if (g->under_way) {
        return closing_fits(g->ahead, g->w.v_ahead - v);
    }
    const float room = vg_minf(model->change_gap, vg_low_speed_gap(model, v));
    const float tau = change_gap_share * time_gap(model, slot, g->w.ahead);
    return g->ahead >= room
           && safe_speed(g->ahead - 0.5f * standstill_gap, g->w.v_ahead, v, dt, tau,
                         comfort_braking + 1.0f) >= v - change_braking * dt;
}

// The one behind may have to brake a little. Planned ones follow closer than others.
static bool fits_before_follower(const vg_model* model, const vg_flow* flow, uint32_t slot,
                                 const gaps* g)
{
    const float v = flow->v[slot], dt = (float)model->def->step_s;
    const int32_t behind = g->w.behind;
    if (behind < 0) {
        return true;
    }
    const float v_behind = g->w.v_behind;
    if (g->under_way) {
        return closing_fits(g->behind, v - v_behind);
    }
    if (g->behind < vg_minf(model->change_gap, vg_low_speed_gap(model, v_behind))) {
        return false;
    }
    if (behind < (int32_t)model->controlled_count) {
        return safe_speed(g->behind - 0.5f * standstill_gap, v, v_behind, dt,
                          0.5f * planned_gap_s, comfort_braking + 1.0f)
               >= v_behind - change_braking_behind * dt;
    }
    return vg_human_acceleration(model, (uint32_t)behind, v_behind, g->behind, v)
           >= -change_braking_behind;
}

// A vehicle takes the speed of the other lane's traffic before it changes, where its own lane
// leaves room for that.
static bool speed_fits(const vg_model* model, const vg_flow* flow, const vg_neighbours* keep,
                       uint32_t slot, const gaps* g)
{
    const float v = flow->v[slot];
    const float end = dead_end_ahead(model, flow, slot) - model->half_length[slot];
    const float room = vg_minf(end, keep->gap_ahead - model->half_length[slot]);
    if (g->under_way || room < adapting_s * v + adapting_distance) {
        return true;
    }
    const bool behind = g->w.behind >= 0 && g->behind < adapting_reach
                        && g->w.v_behind - v > speed_difference;
    const bool ahead = g->w.ahead >= 0 && g->ahead < adapting_reach
                       && vg_fabsf(g->w.v_ahead - v) > speed_difference;
    return !behind && !ahead;
}

// Speed of a change with regard to the vehicle ahead in the own lane.
typedef struct passing {
    float most;     // [m/s] below 0: it would be hit
    bool  turns_out; // close before a standing body, with as much steering as it takes
} passing;

static passing pass_leader(const vg_model* model, const vg_flow* flow, const vg_neighbours* keep,
                           uint32_t slot, float across, bool under_way)
{
    if (keep->ahead < 0) {
        return (passing){ VG_FAR_AWAY, false };
    }
    const float v = flow->v[slot], dt = (float)model->def->step_s;
    const float gap = keep->gap_ahead - model->half_length[slot];
    const float safe = safe_speed(gap - 0.5f, keep->v_ahead, v, dt, 0.0f, comfort_braking + 1.0f);
    const float now = gap + v * dt; // before the step
    const bool close = keep->v_ahead < standing_speed && now < close_distance;
    if (!close && safe >= v - change_braking * dt) {
        return (passing){ safe, false };
    }
    // Is there distance enough to turn out before it, or time enough to clear it?
    const float widths = model->half_width[slot] + model->half_width[keep->ahead] + pass_clearance;
    const float dy = vg_gap_left(model, slot, (uint32_t)keep->ahead, flow->y[slot],
                                 flow->y[keep->ahead]);
    const float needed = across > 0.0f ? widths + dy : widths - dy;
    // One that has begun to turn goes on: only the trajectory knows the way of its nose.
    const bool begun = across * off_goal(model, flow, slot) > begun_offset && v <= walking_speed;
    if (close && v <= turning_speed
        && (begun || needed / slope_of_nose <= now - pass_clearance)) {
        return (passing){ vg_maxf(v, squeeze_speed), true };
    }
    const float closing = vg_maxf(v - keep->v_ahead, 0.1f);
    if (under_way && needed / clearing_speed + clearing_reserve <= now / closing) {
        return (passing){ v, false };
    }
    return (passing){ -1.0f, false };
}

// Where in the lane changed to a change ends: aside where a body reaches into that lane. [m] to the
// left
static float goal_after(const vg_model* model, const vg_flow* flow, uint32_t slot, bool left,
                        bool finishes)
{
    const int32_t lane = finishes ? flow->lane[slot] : lane_beside(model, flow, slot, left);
    const float station = flow->station[slot]
                          + flow->v[slot] * (float)model->def->step_s / flow->rate[slot];
    return lane < 0 ? 0.0f : vg_goal_in(model, flow, slot, lane, station);
}

void vg_drive_check_change(const vg_model* model, const vg_flow* flow, vg_moves* moves,
                           uint32_t slot, uint8_t action)
{
    const uint8_t bit = (uint8_t)(1u << action);
    if ((moves->unchecked[slot] & bit) == 0) {
        return;
    }
    moves->unchecked[slot] = (uint8_t)(moves->unchecked[slot] & ~bit);
    const bool left = action == VERGE_CHANGE_LEFT;
    const float sign = left ? 1.0f : -1.0f;
    const float d = sign * flow->d[slot], v = flow->v[slot], dt = (float)model->def->step_s;
    const bool finishes = came_from(model, flow, slot, sign);
    const float goal = sign * goal_after(model, flow, slot, left, finishes);
    const float whole = goal - d + (finishes ? 0.0f : across_gap(model, flow, slot, left));
    const float y = flow->y[slot] + sign * whole;
    gaps g = { .w = vg_nearest(model, flow, slot, moves->station[0][slot], y, moves->station[0],
                               moves->v[0], VG_FAR_AWAY),
               .under_way = finishes || came_from(model, flow, slot, -sign) };
    g.ahead = g.w.gap_ahead - model->half_length[slot];
    g.behind = g.w.gap_behind - model->half_length[slot];
    if (!speed_fits(model, flow, &moves->keep[slot], slot, &g)
        || !fits_behind_leader(model, flow, slot, &g)
        || !fits_before_follower(model, flow, slot, &g)) {
        return;
    }
    const passing own = finishes ? (passing){ VG_FAR_AWAY, false }
                                 : pass_leader(model, flow, &moves->keep[slot], slot, sign,
                                               g.under_way);
    const float limit = vg_minf(vg_minf(flow->limit[slot], model->speed_max[slot]), own.most);
    const float wanted = vg_minf(vg_minf(v + model->gain[slot], vg_minf(limit, moves->wall[slot])),
                                 following_speed(model, flow, &g.w, slot, change_gap_share));
    const float v1 = vg_maxf(wanted, vg_maxf(v - change_braking * dt, 0.0f));
    const float distance = 0.5f * (v + v1) * dt;
    const float most = vg_minf(moves->wall[slot], own.most);
    if (own.most < 0.0f || v1 > most + 0.1f || distance < 0.1f) {
        return;
    }
    const uint32_t along = vg_actions[action].along, across = vg_actions[action].across;
    const float within = own.turns_out ? slope_of_nose * distance : lateral_within(distance);
    const float reach = vg_minf(reach_of(model, whole + vg_maxf(d, 0.0f)), within);
    set_state(flow, moves, slot, along, v1, distance);
    moves->y[across][slot] = flow->y[slot] + sign * vg_minf(whole, reach);
    moves->change_gap[left ? 0 : 1][slot] = vg_minf(g.ahead, g.behind);
    moves->legal[slot] = (uint8_t)(moves->legal[slot] | bit);
}

// ---------------------------------------------------------------------------- the policy

float vg_drive_delay(const vg_model* model, const vg_flow* flow, uint32_t slot,
                     const vg_neighbours* w)
{
    if (w->ahead < 0) {
        return 0.0f;
    }
    const float gap = w->gap_ahead - model->half_length[slot], v_ahead = w->v_ahead;
    const float wanted = vg_drive_desired(model, flow, slot);
    const float reach = look_ahead_s * wanted;
    if (gap >= reach || v_ahead >= wanted) {
        return 0.0f;
    }
    // The whole reach is driven at the speed of the one ahead; less if it is far away.
    const float far = vg_maxf(gap, 0.0f) / reach;
    const float way = reach * (1.0f - far * far);
    const float delay = vg_minf(way / vg_maxf(v_ahead, 0.5f) - way / wanted, delay_max);
    // A queue moves on soon.
    const bool planned = w->ahead < (int32_t)model->controlled_count;
    return v_ahead < 1.0f && (planned || model->standing[w->ahead] == VG_TEMPORARILY_STOPPED)
               ? vg_minf(delay, queue_delay) : delay;
}

// Time to go by the lane beside, with its traffic. [s]
static float beside_time(const vg_model* model, const vg_flow* flow, const vg_moves* moves,
                         uint32_t slot, bool left)
{
    const int32_t beside = lane_beside(model, flow, slot, left);
    const float across = across_gap(model, flow, slot, left);
    const float y = flow->y[slot] - flow->d[slot] + (left ? across : -across);
    const vg_neighbours w = vg_nearest(model, flow, slot, moves->station[0][slot], y,
                                       moves->station[0], moves->v[0], VG_FAR_AWAY);
    return time_to_go(model, slot, beside, flow->station[slot])
           + vg_drive_delay(model, flow, slot, &w);
}

// Time until a gap has grown by this much at a rate. [m], [m/s] -> [s]
static float opening_time(float missing, float rate)
{
    return missing <= 0.0f ? 0.0f : vg_minf(missing / vg_maxf(rate, 0.3f), blocked_most);
}

// The vehicle beside is passed, or passes. A human will drive at the speed that it desires.
float vg_drive_blocked(const vg_model* model, const vg_flow* flow, uint32_t slot, bool left)
{
    const float across = across_gap(model, flow, slot, left);
    const float y = flow->y[slot] - flow->d[slot] + (left ? across : -across);
    const vg_neighbours w = vg_nearest(model, flow, slot, flow->station[slot], y, flow->station,
                                       flow->v, VG_FAR_AWAY);
    const float v = flow->v[slot], half = model->half_length[slot];
    const float ahead = w.gap_ahead - half, behind = w.gap_behind - half;
    const float room = standstill_gap + change_gap_share * time_gap(model, slot, w.ahead) * v;
    const float dropping = opening_time(room - ahead, w.v_ahead - v + adapting_speed);
    if (w.behind < 0) {
        return w.ahead < 0 ? 0.0f : dropping;
    }
    const float desired = vg_drive_desired(model, flow, slot);
    const bool planned = w.behind < (int32_t)model->controlled_count;
    const float theirs = planned ? w.v_behind : vg_maxf(model->cruise[w.behind], w.v_behind);
    const float tau = planned ? 0.5f * planned_gap_s : let_in_s;
    const float missing = standstill_gap + tau * w.v_behind - behind;
    if (missing <= 0.0f) {
        return w.ahead < 0 ? 0.0f : dropping;
    }
    const float lengths = 2.0f * (half + model->half_length[w.behind]);
    const float passing = opening_time(missing, desired - theirs);
    const float passed = opening_time(vg_maxf(behind, 0.0f) + lengths + room,
                                      theirs - v + adapting_speed);
    return vg_minf(w.ahead < 0 ? passing : vg_maxf(passing, dropping), passed);
}

uint8_t vg_drive_policy(const vg_model* model, const vg_flow* flow, vg_moves* moves, uint32_t slot)
{
    const uint8_t keeping = moves->legal[slot];
    const uint8_t along = keeping & 1u << VERGE_ACCELERATE  ? VERGE_ACCELERATE
                          : keeping & 1u << VERGE_KEEP_SPEED ? VERGE_KEEP_SPEED
                                                             : VERGE_DECELERATE;
    const uint8_t changes = moves->unchecked[slot] | moves->legal[slot];
    float best = time_to_go(model, slot, flow->lane[slot], flow->station[slot])
                 + vg_drive_delay(model, flow, slot, &moves->keep[slot]);
    uint8_t choice = along;
    for (uint32_t side = 0; side < 2; ++side) {
        const bool left = side == 0;
        const uint8_t action = left ? VERGE_CHANGE_LEFT : VERGE_CHANGE_RIGHT;
        const float d = left ? flow->d[slot] : -flow->d[slot];
        const float cost = d > VG_CENTRED ? -change_gain : VG_VALUE_CHANGE + change_gain;
        const int32_t beside = lane_beside(model, flow, slot, left);
        if ((changes >> action & 1u) == 0 || d < -VG_CENTRED
            || time_to_go(model, slot, beside, flow->station[slot]) + cost >= best) {
            continue;
        }
        const float time = cost + beside_time(model, flow, moves, slot, left);
        if (time < best && vg_flow_check_change(model, flow, moves, slot, action)) {
            best = time;
            choice = action;
        }
    }
    return choice;
}
