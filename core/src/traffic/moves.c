/// See moves.h.
#include "traffic/moves.h"

#include "base/contract.h"
#include "traffic/humans.h"
#include "traffic/pairs.h"

// Paper, section 4: lane changes are planned for steps of 1.5 s, half a lane each. [s]
static const float change_step_s = 1.5f;
// A lane change is not steeper than one in two (d per s), and none begins nearly standing.
static const float change_slope = 0.5f;
static const float change_speed_min = 0.5f; // [m/s]
// A leader nearer than this, and slower than this share of the speed one could drive, is
// worth a lane change away from the target. [m], [1]
static const float overtake_sight = 60.0f;
static const float overtake_pace = 0.6f;
// Kept free before a lane's end, to merge from standstill. A vehicle slower than `merge_speed` may
// use it as soon as there is a gap beside. [m], [m/s]
static const float merge_reserve = 8.0f;
static const float merge_speed = 2.0f;

static_assert(VG_ALONG_COUNT == 3, "longitudinal_moves() gives the state after each motion along the lane");
static_assert(VERGE_ACTION_COUNT == 5, "keep_lane_moves() and changes_allowed() say which actions are legal");

static void longitudinal_moves(const vg_model* model, const vg_flow* flow, vg_moves* moves);
static void lateral_moves(const vg_model* model, const vg_flow* flow, vg_moves* moves);
static void keep_lane_moves(const vg_model* model, const vg_flow* flow, vg_moves* moves, uint32_t slot);

void vg_flow_moves(const vg_model* model, const vg_flow* flow, vg_moves* moves)
{
    vg_flow_moves_unchecked(model, flow, moves);
    for (uint32_t i = 0; i < model->controlled_count; ++i) {
        (void)vg_flow_check_change(model, flow, moves, i, VERGE_CHANGE_LEFT);
        (void)vg_flow_check_change(model, flow, moves, i, VERGE_CHANGE_RIGHT);
    }
}

void vg_flow_moves_unchecked(const vg_model* model, const vg_flow* flow, vg_moves* moves)
{
    if (!model->single_axis) {
        vg_pairs_update(model, flow);
    }
    longitudinal_moves(model, flow, moves);
    lateral_moves(model, flow, moves);
    vg_flow_human_moves(model, flow, (float)model->def->step_s, moves->station[0], moves->v[0], moves->y[0]);
    for (uint32_t i = 0; i < model->controlled_count; ++i) {
        keep_lane_moves(model, flow, moves, i);
    }
}

// Table 1, as far as each body can. A deceleration that reaches standstill stops there.
static void longitudinal_moves(const vg_model* model, const vg_flow* flow, vg_moves* moves)
{
    const float dt = (float)model->def->step_s;
    for (uint32_t i = 0; i < model->controlled_count; ++i) {
        const float v = flow->v[i], station = flow->station[i];
        const float gain = model->gain[i], loss = model->loss[i];
        const float per_metre = 1.0f / flow->rate[i];
        const float v_dc = vg_maxf(v - loss, 0.0f);
        const float stopping = v * v * model->stop[i];
        const float way_dc = v < loss ? stopping : (v + v_dc) * (0.5f * dt);
        moves->station[0][i] = station + v * dt * per_metre;
        moves->station[1][i] = station + (v + 0.5f * gain) * dt * per_metre;
        moves->station[2][i] = station + way_dc * per_metre;
        moves->v[0][i] = v;
        moves->v[1][i] = v + gain;
        moves->v[2][i] = v_dc;
    }
}

// How far a change goes in one step where speed does not limit it: half the distance between two
// centrelines, and never past the next centre. d beyond `VG_CENTRED` on the far side: completing a
// change comes first. [m] to the side in question
VG_INLINE float change_distance(const vg_flow* flow, uint32_t i, bool to_left, float room)
{
    const float d = to_left ? flow->d[i] : -flow->d[i];
    const float gap = to_left ? flow->left_gap[i] : flow->right_gap[i];
    return vg_minf(d < -VG_CENTRED ? -d : gap - d, room);
}

VG_INLINE float change_reach(const vg_model* model, const vg_flow* flow, uint32_t i)
{
    const float part = 0.5f * (float)model->def->step_s / change_step_s;
    return vg_maxf(vg_maxf(flow->left_gap[i], flow->right_gap[i]), 3.0f) * part;
}

// Keeping: back to the lane's centre. Nobody gets across steeper than change_slope.
static void lateral_moves(const vg_model* model, const vg_flow* flow, vg_moves* moves)
{
    for (uint32_t i = 0; i < model->controlled_count; ++i) {
        const float d = flow->d[i], y = flow->y[i];
        const float slope = change_slope * flow->v[i] * (float)model->def->step_s;
        const float room = vg_minf(change_reach(model, flow, i), slope);
        moves->y[0][i] = y + vg_maxf(vg_minf(-d, room), -room);
        moves->y[1][i] = y + change_distance(flow, i, true, room);
        moves->y[2][i] = y - change_distance(flow, i, false, room);
    }
}

// Eq. 3: how far a new speed lies inside the window, >= 0 if it holds. Two margins: to the
// leader (upper bounds) and to the follower (lower bound).
typedef struct margins {
    float upper, lower;
} margins;

// distance: driven beyond what KS drives. [m]
static margins margins_of(const vg_model* model, const vg_neighbours* w, float half, float v, float way)
{
    const float tau = model->reaction, mth = model->headway;
    const float gap_ahead = w->gap_ahead - half - way;
    const float gap_behind = w->gap_behind - half + way;
    const float upper =
        vg_minf((mth * w->v_ahead + gap_ahead) * model->per_both, gap_ahead * model->per_reaction);
    const float lower = w->v_behind - (gap_behind - tau * w->v_behind) * model->per_headway;
    return (margins){ upper - v, v - lower };
}

static bool fits(margins m)
{
    return m.upper >= 0.0f && m.lower >= 0.0f;
}

// The end of a lane that leads VG_FAR_AWAY is a standing leader, a little before the end: whoever has
// to wait there needs way to get going and across.
static float dead_end_ahead(const vg_model* model, const vg_flow* flow, uint32_t slot, float station)
{
    const vg_lane* lane = &model->road->lanes[flow->lane[slot]];
    return lane->dead_end ? (float)lane->station_end - merge_reserve - station : VG_FAR_AWAY;
}

// Where nothing in the lane fits the vg_neighbours, the least harmful stays: brake for a leader, else
// make way for a follower. A vehicle always has a move.
static uint32_t least_harm(margins ks, margins ac, margins dc)
{
    if (ks.upper < 0.0f || dc.lower >= 0.0f) {
        return 1u << VERGE_DECELERATE;
    }
    return ac.upper >= 0.0f ? 1u << VERGE_ACCELERATE : 1u << VERGE_KEEP_SPEED;
}

// Borders, stretches and direction: changes lead towards the target, or around a slower leader.
static uint32_t changes_allowed(const vg_model* model, const vg_flow* flow, const vg_neighbours* keep, uint32_t slot)
{
    const verge_road* road = model->road;
    const uint32_t lane = (uint32_t)flow->lane[slot];
    const float d = flow->d[slot];
    const float left_gap = flow->left_gap[slot], right_gap = flow->right_gap[slot];
    if (flow->v[slot] < change_speed_min) {
        return 0;
    }
    const bool finish_left = d < -VG_CENTRED;
    const bool finish_right = d > VG_CENTRED;
    bool left = finish_left || left_gap > 0.0f;
    bool right = finish_right || right_gap > 0.0f;
    const int32_t target = model->target[slot];
    const int8_t way = target < 0 ? 0 : (int8_t)vg_road_turn(road, lane, (uint32_t)target);
    const bool overtake = keep->gap_ahead < overtake_sight
                          && keep->v_ahead < overtake_pace * flow->limit[slot];
    if (!overtake) {
        left = left && (way > 0 || finish_left);
        right = right && (way < 0 || finish_right);
    }
    return (left ? 1u << VERGE_CHANGE_LEFT : 0u) | (right ? 1u << VERGE_CHANGE_RIGHT : 0u);
}

// Does a change that comes to y fit the vg_neighbours among those in both lanes it touches? room: the
// free way that it leaves, ahead or behind. [m]
static bool change_fits(const vg_model* model, const vg_flow* flow, const vg_moves* moves, uint32_t slot,
                        float y, float* room)
{
    const vg_neighbours w = vg_nearest(model, flow, slot, moves->station[0][slot], y, moves->station[0],
                          moves->v[0], VG_FAR_AWAY);
    const float half = model->half_length[slot];
    // Eq. 3 lets one cut in a hair ahead of a slower one: room on both sides is asked for too,
    // less of it where everyone crawls.
    *room = vg_minf(w.gap_ahead, w.gap_behind) - half;
    return fits(margins_of(model, &w, half, flow->v[slot], 0.0f))
           && *room >= vg_minf(model->change_gap, vg_crawling_gap(model, flow->v[slot]));
}

bool vg_flow_check_change(const vg_model* model, const vg_flow* flow, vg_moves* moves, uint32_t slot,
                        uint8_t action)
{
    const uint8_t bit = (uint8_t)(1u << action);
    if ((moves->unchecked[slot] & bit) != 0) {
        // Who is slow gets across in more steps, but looks as far as the others do.
        const bool to_left = action == VERGE_CHANGE_LEFT;
        const float way = change_distance(flow, slot, to_left, change_reach(model, flow, slot));
        const float y = flow->y[slot] + (to_left ? way : -way);
        const bool legal = change_fits(model, flow, moves, slot, y, &moves->change_gap[to_left ? 0 : 1][slot]);
        moves->unchecked[slot] = (uint8_t)(moves->unchecked[slot] & ~bit);
        moves->legal[slot] = (uint8_t)(moves->legal[slot] | (legal ? bit : 0u));
    }
    return (moves->legal[slot] & bit) != 0;
}

// Who waits at a lane's end sets off once there is room beside and way enough to get across.
static bool may_set_off(const vg_model* model, const vg_flow* flow, const vg_moves* moves, uint32_t slot)
{
    const verge_road* road = model->road;
    const uint32_t lane = (uint32_t)flow->lane[slot];
    const int32_t target = model->target[slot];
    if (!road->lanes[lane].dead_end || flow->v[slot] >= merge_speed) {
        return false;
    }
    const float rate = flow->rate[slot];
    const float left = ((float)road->lanes[lane].station_end - moves->station[1][slot]) * rate;
    const int8_t way = target < 0 ? 0 : (int8_t)vg_road_turn(road, lane, (uint32_t)target);
    const bool to_left = way > 0 || (way == 0 && flow->left_gap[slot] > 0.0f);
    const float across = to_left ? flow->left_gap[slot] : -flow->right_gap[slot];
    float room;
    return across != 0.0f && left - model->half_length[slot] > moves->v[1][slot]
           && change_fits(model, flow, moves, slot, flow->y[slot] + 0.5f * across, &room);
}

// The single pruning of section 3.1.3. Everyone's neighbours are taken at the same instant as
// the new state, t + 1, planned ones at their present speed.
static void keep_lane_moves(const vg_model* model, const vg_flow* flow, vg_moves* moves, uint32_t slot)
{
    const float station = moves->station[0][slot], rate = flow->rate[slot];
    const float half = model->half_length[slot];
    const vg_neighbours keep = vg_nearest(model, flow, slot, station, moves->y[0][slot], moves->station[0],
                             moves->v[0], dead_end_ahead(model, flow, slot, station));
    const margins ks = margins_of(model, &keep, half, moves->v[0][slot], 0.0f);
    const margins ac = margins_of(model, &keep, half, moves->v[1][slot],
                                  (moves->station[1][slot] - station) * rate);
    const margins dc = margins_of(model, &keep, half, moves->v[2][slot],
                                  (moves->station[2][slot] - station) * rate);
    uint32_t legal = fits(ks) ? 1u << VERGE_KEEP_SPEED : 0u;
    if (fits(ac) && moves->v[1][slot] <= vg_minf(flow->limit[slot], model->speed_max[slot])) {
        legal |= 1u << VERGE_ACCELERATE;
    }
    if (fits(dc) && flow->v[slot] > 0.0f) {
        legal |= 1u << VERGE_DECELERATE;
    }
    if (legal == 0) {
        legal = least_harm(ks, ac, dc);
    }
    if (may_set_off(model, flow, moves, slot)) {
        legal |= 1u << VERGE_ACCELERATE;
    }
    moves->legal[slot] = (uint8_t)legal;
    moves->unchecked[slot] = (uint8_t)changes_allowed(model, flow, &keep, slot);
}
