/// The progress monitor: finds vehicles that stand for long, says what each waits for, and puts one
/// of those first that wait for one another in a circle. See order.h.
#include "traffic/order.h"

#include "base/contract.h"
#include "base/scalar.h"
#include "traffic/pairs.h"

// A slower vehicle stands; one that stands for so long has a cause, or is helped. [m/s], [s]
static const float standing = 0.3f;
static const double patience = 3.0;
// A wall, or a vehicle ahead, holds a standing vehicle that is nearer than this. [m]
static const float wall_near = 3.0f, leader_near = 4.0f;
// The same of a red signal: who waits for it may stop early. [m]
static const float red_near = 30.0f;
// The end of a lane holds a vehicle whose front is nearer than this. [m]
static const float end_near = 15.0f;

enum { MOVES = -1, NAMED = -2, NOTHING = -3 };

// What holds a standing slot: another slot, NAMED: something else, NOTHING, or it MOVES.
static int32_t held_by(const vg_model* model, const vg_flow* flow, uint32_t slot)
{
    const float half = model->half_length[slot];
    if (vg_fabsf(flow->v[slot]) >= standing) {
        return MOVES;
    }
    if (slot >= model->controlled_count) {
        return NAMED; // what others do has no cause here
    }
    const vg_wall wall = vg_order_wall_why(model, flow, slot);
    if (wall.distance - half < (wall.why == VERGE_WHY_SIGNAL ? red_near : wall_near)) {
        return wall.slot >= 0 ? wall.slot : NAMED;
    }
    int32_t ahead = -1, behind = -1;
    vg_flow_neighbours(model, flow, slot, &ahead, &behind);
    if (ahead >= 0) {
        const float gap = vg_gap_along(model, slot, (uint32_t)ahead, flow->rate[slot],
                                       flow->station[slot], flow->station[ahead])
                          - half - model->half_length[ahead];
        if (gap < leader_near) {
            return ahead;
        }
    }
    const vg_lane* lane = &model->road->lanes[flow->lane[slot]];
    const float left = (float)lane->station_end - flow->station[slot] - half;
    return lane->successor_count == 0 && left < end_near ? NAMED : NOTHING;
}

// Follows what holds a slot, from slot to slot. Returns the slots of a circle (bits), 0: none.
static uint64_t circle_of(const vg_model* model, const vg_flow* flow, uint32_t slot)
{
    uint64_t seen = 0, circle = 0;
    int32_t at = (int32_t)slot;
    while (at >= 0 && (seen >> at & 1u) == 0) {
        seen |= (uint64_t)1 << at;
        at = held_by(model, flow, (uint32_t)at);
    }
    for (int32_t k = at; k >= 0 && (circle >> k & 1u) == 0;) {
        circle |= (uint64_t)1 << k;
        k = held_by(model, flow, (uint32_t)k);
    }
    return circle;
}

// The slot of a circle that has the shortest way out of its next area.
static uint32_t least_way(const vg_order* order, const vg_model* model, uint64_t circle)
{
    uint32_t best = (uint32_t)__builtin_ctzll(circle);
    float least = VG_FAR_AWAY;
    for (uint64_t set = circle; set != 0; set &= set - 1u) {
        const uint32_t slot = (uint32_t)__builtin_ctzll(set);
        const vg_share* first = &order->shares[slot * order->shares_max];
        const float way = order->courses[slot].share_count > 0
                              ? first->leave + model->half_length[slot] : VG_FAR_AWAY;
        if (way < least) {
            least = way;
            best = slot;
        }
    }
    return best;
}

void vg_order_watch(vg_order* order, const vg_model* model, const vg_flow* flow,
                    const verge_scene* scene, verge_turns* turns)
{
    VERGE_ASSERT(order->slots == model->count);
    uint64_t done = 0;
    for (uint32_t slot = 0; slot < model->controlled_count; ++slot) {
        const int32_t id = scene->vehicles[model->input_index[slot]].id;
        const verge_turn* turn = vg_turn_of(turns, id);
        if (turn == NULL || turn->still == 0 || (done >> slot & 1u) != 0
            || vg_seconds_between(turn->still, scene->utime) < patience) {
            continue;
        }
        const uint64_t circle = circle_of(model, flow, slot);
        if (circle == 0 && held_by(model, flow, slot) != NOTHING) {
            continue; // it waits for somebody that moves, or that is looked at itself
        }
        const uint32_t first = circle != 0 ? least_way(order, model, circle) : slot;
        verge_turn* helped =
            vg_turn_of(turns, scene->vehicles[model->input_index[first]].id);
        if (helped != NULL && helped->helped == 0) {
            helped->helped = scene->utime;
            order->reordered += circle != 0 ? 1u : 0u;
            order->unstuck += circle == 0 ? 1u : 0u;
        }
        order->blocked |= circle != 0 ? circle : (uint64_t)1 << slot;
        done |= circle;
    }
}
