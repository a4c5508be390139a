/// See moves.h.
#include "traffic/moves.h"

#include "base/contract.h"
#include "traffic/drive.h"
#include "traffic/humans.h"
#include "traffic/pairs.h"

// Half a lane change takes this long (paper, section 4). [s]
static const float change_step_s = 1.5f;
static const float change_slope = 0.5f;     // [1] largest change of d per distance driven
static const float change_speed_min = 0.5f; // [m/s] lowest speed for a lane change
// Lane changes away from the target lane are allowed behind a leader that is nearer than this, and
// slower than this share of the speed limit. [m], [1]
static const float overtake_distance = 60.0f;
static const float overtake_speed_share = 0.6f;
// Distance kept free before the end of a lane, so that a vehicle can merge from standstill. A
// vehicle slower than `merge_speed` may use it when there is a gap in the neighbouring lane.
static const float merge_reserve = 8.0f; // [m]
static const float merge_speed = 2.0f;   // [m/s]

static_assert(VG_ALONG_COUNT == 5,
              "longitudinal_moves() gives the state after each motion along the lane");
static_assert(VERGE_ACTION_COUNT == 5,
              "keep_lane_moves() and changes_allowed() say which actions are legal");

static void longitudinal_moves(const vg_model* model, const vg_flow* flow, vg_moves* moves);
static void lateral_moves(const vg_model* model, const vg_flow* flow, vg_moves* moves);
static void keep_lane_moves(const vg_model* model, const vg_flow* flow, vg_moves* moves,
                            uint32_t slot);

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
    VERGE_ASSERT(model->controlled_count <= model->count);
    if (!model->single_axis) {
        vg_pairs_update(model, flow);
    }
    if (model->best) {
        vg_drive_moves(model, flow, moves);
        return;
    }
    longitudinal_moves(model, flow, moves);
    lateral_moves(model, flow, moves);
    vg_flow_human_moves(model, flow, (float)model->def->step_s, moves->station[0], moves->v[0],
                        moves->y[0]);
    for (uint32_t i = 0; i < model->controlled_count; ++i) {
        keep_lane_moves(model, flow, moves, i);
    }
}

// Table 1, within the limits of each body. A vehicle that decelerates to standstill stays there.
static void longitudinal_moves(const vg_model* model, const vg_flow* flow, vg_moves* moves)
{
    const float dt = (float)model->def->step_s;
    for (uint32_t i = 0; i < model->controlled_count; ++i) {
        const float v = flow->v[i], station = flow->station[i];
        const float gain = model->gain[i], loss = model->loss[i];
        const float per_metre = 1.0f / flow->rate[i];
        const float v_dc = vg_maxf(v - loss, 0.0f);
        const float stopping = v * v * model->stop[i];
        const float distance_dc = v < loss ? stopping : (v + v_dc) * (0.5f * dt);
        moves->station[0][i] = station + v * dt * per_metre;
        moves->station[1][i] = station + (v + 0.5f * gain) * dt * per_metre;
        moves->station[2][i] = station + distance_dc * per_metre;
        moves->station[VG_ALONG_LEFT][i] = moves->station[0][i];
        moves->station[VG_ALONG_RIGHT][i] = moves->station[0][i];
        moves->v[VG_ALONG_LEFT][i] = moves->v[VG_ALONG_RIGHT][i] = v;
        moves->v[0][i] = v;
        moves->v[1][i] = v + gain;
        moves->v[2][i] = v_dc;
    }
}

// Lateral distance of a lane change to one side in one step, at most `reach` and never past the
// next centreline. A vehicle with |d| beyond VG_CENTRED on the other side first returns to the
// centre of its lane, which completes the change that brought it here. [m]
VG_INLINE float change_distance(const vg_flow* flow, uint32_t i, bool to_left, float reach)
{
    const float d = to_left ? flow->d[i] : -flow->d[i];
    const float gap = to_left ? flow->left_gap[i] : flow->right_gap[i];
    return vg_minf(d < -VG_CENTRED ? -d : gap - d, reach);
}

// Lateral distance of one step where speed does not limit it: half a lane in change_step_s. [m]
VG_INLINE float change_reach(const vg_model* model, const vg_flow* flow, uint32_t i)
{
    const float part = 0.5f * (float)model->def->step_s / change_step_s;
    return vg_maxf(vg_maxf(flow->left_gap[i], flow->right_gap[i]), 3.0f) * part;
}

// Lane keeping returns to the centre of the lane. No lateral motion is steeper than change_slope.
static void lateral_moves(const vg_model* model, const vg_flow* flow, vg_moves* moves)
{
    for (uint32_t i = 0; i < model->controlled_count; ++i) {
        const float d = flow->d[i], y = flow->y[i];
        const float slope = change_slope * flow->v[i] * (float)model->def->step_s;
        const float reach = vg_minf(change_reach(model, flow, i), slope);
        moves->y[0][i] = y + vg_maxf(vg_minf(-d, reach), -reach);
        moves->y[1][i] = y + change_distance(flow, i, true, reach);
        moves->y[2][i] = y - change_distance(flow, i, false, reach);
    }
}

// Margins of a new speed in the window of Eq. 3: to the upper bounds, which the leader sets, and to
// the lower bound, which the follower sets. >= 0: within the window. [m/s]
typedef struct margins {
    float upper, lower;
} margins;

// distance: distance driven in this step minus the distance that KS drives. [m]
static margins margins_of(const vg_model* model, const vg_neighbours* w, float half, float v,
                          float distance)
{
    const float tau = model->reaction, mth = model->headway;
    const float gap_ahead = w->gap_ahead - half - distance;
    const float gap_behind = w->gap_behind - half + distance;
    const float upper =
        vg_minf((mth * w->v_ahead + gap_ahead) * model->per_both, gap_ahead * model->per_reaction);
    const float lower = w->v_behind - (gap_behind - tau * w->v_behind) * model->per_headway;
    return (margins){ upper - v, v - lower };
}

static bool fits(margins m)
{
    return m.upper >= 0.0f && m.lower >= 0.0f;
}

// The end of a lane without successor is a standing obstacle, merge_reserve before the end: a
// vehicle that waits there needs this distance to start and change lane. VG_FAR_AWAY: no obstacle.
// [m]
static float dead_end_ahead(const vg_model* model, const vg_flow* flow, uint32_t slot,
                            float station)
{
    const vg_lane* lane = &model->road->lanes[flow->lane[slot]];
    return lane->dead_end ? (float)lane->station_end - merge_reserve - station : VG_FAR_AWAY;
}

// The action where no action in the lane is legal, so that a vehicle always has one: it brakes for
// a leader, else it accelerates or keeps its speed for a follower.
static uint32_t emergency_action(margins ks, margins ac, margins dc)
{
    if (ks.upper < 0.0f || dc.lower >= 0.0f) {
        return 1u << VERGE_DECELERATE;
    }
    return ac.upper >= 0.0f ? 1u << VERGE_ACCELERATE : 1u << VERGE_KEEP_SPEED;
}

// Lane changes that road and target allow: where a neighbouring lane may be entered, towards the
// target lane, around a slower leader, or to complete a change.
static uint32_t changes_allowed(const vg_model* model, const vg_flow* flow,
                                const vg_neighbours* keep, uint32_t slot)
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
    const int8_t turn = target < 0 ? 0 : (int8_t)vg_road_turn(road, lane, (uint32_t)target);
    const bool overtake = keep->gap_ahead < overtake_distance
                          && keep->v_ahead < overtake_speed_share * flow->limit[slot];
    if (!overtake) {
        left = left && (turn > 0 || finish_left);
        right = right && (turn < 0 || finish_right);
    }
    return (left ? 1u << VERGE_CHANGE_LEFT : 0u) | (right ? 1u << VERGE_CHANGE_RIGHT : 0u);
}

// Is a lane change to y legal with respect to the vehicles in both lanes? gap: the smaller gap that
// it leaves, ahead or behind. [m]
static bool change_fits(const vg_model* model, const vg_flow* flow, const vg_moves* moves,
                        uint32_t slot, float y, float* gap)
{
    const vg_neighbours w = vg_nearest(model, flow, slot, moves->station[0][slot], y,
                                       moves->station[0], moves->v[0], VG_FAR_AWAY);
    const float half = model->half_length[slot];
    // Eq. 3 alone would allow a change directly ahead of a slower vehicle. Therefore a gap is also
    // required on both sides, a smaller one at low speed.
    *gap = vg_minf(w.gap_ahead, w.gap_behind) - half;
    return fits(margins_of(model, &w, half, flow->v[slot], 0.0f))
           && *gap >= vg_minf(model->change_gap, vg_low_speed_gap(model, flow->v[slot]));
}

bool vg_flow_check_change(const vg_model* model, const vg_flow* flow, vg_moves* moves,
                          uint32_t slot, uint8_t action)
{
    VERGE_ASSERT(slot < model->controlled_count);
    VERGE_ASSERT(vg_action_changes_lane(action));
    const uint8_t bit = (uint8_t)(1u << action);
    if (model->best) {
        vg_drive_check_change(model, flow, moves, slot, action);
    } else if ((moves->unchecked[slot] & bit) != 0) {
        // A slow vehicle needs more steps for the change. The lateral distance that is checked is
        // the same at all speeds.
        const bool to_left = action == VERGE_CHANGE_LEFT;
        const float distance =
            change_distance(flow, slot, to_left, change_reach(model, flow, slot));
        const float y = flow->y[slot] + (to_left ? distance : -distance);
        const bool legal =
            change_fits(model, flow, moves, slot, y, &moves->change_gap[to_left ? 0 : 1][slot]);
        moves->unchecked[slot] = (uint8_t)(moves->unchecked[slot] & ~bit);
        moves->legal[slot] = (uint8_t)(moves->legal[slot] | (legal ? bit : 0u));
    }
    return (moves->legal[slot] & bit) != 0;
}

// May a vehicle that waits at the end of its lane start? It may when there is a gap in the
// neighbouring lane and enough distance left for the change.
static bool may_start(const vg_model* model, const vg_flow* flow, const vg_moves* moves,
                      uint32_t slot)
{
    const verge_road* road = model->road;
    const uint32_t lane = (uint32_t)flow->lane[slot];
    const int32_t target = model->target[slot];
    if (!road->lanes[lane].dead_end || flow->v[slot] >= merge_speed) {
        return false;
    }
    const float rate = flow->rate[slot];
    const float left = ((float)road->lanes[lane].station_end - moves->station[1][slot]) * rate;
    const int8_t turn = target < 0 ? 0 : (int8_t)vg_road_turn(road, lane, (uint32_t)target);
    const bool to_left = turn > 0 || (turn == 0 && flow->left_gap[slot] > 0.0f);
    const float across = to_left ? flow->left_gap[slot] : -flow->right_gap[slot];
    float gap;
    return across != 0.0f && left - model->half_length[slot] > moves->v[1][slot]
           && change_fits(model, flow, moves, slot, flow->y[slot] + 0.5f * across, &gap);
}

// The pruning of single actions (section 3.1.3). The neighbours are taken at the instant of the new
// state, t + 1, where controlled vehicles have kept their present speed.
static void keep_lane_moves(const vg_model* model, const vg_flow* flow, vg_moves* moves,
                            uint32_t slot)
{
    const float station = moves->station[0][slot], rate = flow->rate[slot];
    const float half = model->half_length[slot];
    const vg_neighbours keep =
        vg_nearest(model, flow, slot, station, moves->y[0][slot], moves->station[0], moves->v[0],
                   dead_end_ahead(model, flow, slot, station));
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
        legal = emergency_action(ks, ac, dc);
    }
    if (may_start(model, flow, moves, slot)) {
        legal |= 1u << VERGE_ACCELERATE;
    }
    moves->legal[slot] = (uint8_t)legal;
    moves->unchecked[slot] = (uint8_t)changes_allowed(model, flow, &keep, slot);
}
