/// See standing.h. A scene has no past: how long a vehicle has stood is not known, so that its
/// place and its pose have to tell.
#include "traffic/standing.h"

#include "base/contract.h"
#include "base/scalar.h"
#include "traffic/pairs.h"

// Further from the centre of its lane a body that stands does not queue. [m]
static const float off_centre = 1.0f;
// A vehicle behind one that is slower than this, and nearer, waits for it. [m/s], [m]
static const float queue_speed = 2.0f;
static const float queue_gap = 10.0f;
// Before a junction or the end of its lane a vehicle may wait for others. [m]
static const double place_ahead = 20.0;

static bool area_within(const verge_road* road, uint32_t lane, double from, double to)
{
    const vg_lane* on = &road->lanes[lane];
    for (uint32_t k = road->conflicts_from[lane]; k < road->conflicts_from[lane + 1u]; ++k) {
        const vg_conflict* area = &road->conflicts[k];
        if (vg_lane_s(on, (double)area->to) > from && vg_lane_s(on, (double)area->from) < to) {
            return true;
        }
    }
    return false;
}

// Is there a place ahead where vehicles wait: a stop line, an area shared with other lanes, a lane
// that ends, branches or joins another one?
static bool place_explains(const verge_road* road, uint32_t lane, double s)
{
    double from = s, to = s + place_ahead;
    for (uint32_t passed = 0; passed < VG_WALK_LANES; ++passed) {
        const vg_lane* on = &road->lanes[lane];
        const bool line = on->stop_line < on->length && on->stop_line > from && on->stop_line < to;
        if (line || area_within(road, lane, from, to)) {
            return true;
        }
        if (to <= on->length) {
            return false;
        }
        if (on->successor_count != 1
            || vg_lane_predecessor_count(road, (uint32_t)on->successors[0]) != 1) {
            return true;
        }
        lane = (uint32_t)on->successors[0];
        from -= on->length;
        to -= on->length;
    }
    return false;
}

static bool waits_behind(const vg_model* model, const vg_flow* flow, uint32_t slot)
{
    const vg_neighbours w = vg_nearest(model, flow, slot, flow->station[slot], flow->y[slot],
                                       flow->station, flow->v, VG_FAR_AWAY);
    return w.gap_ahead - model->half_length[slot] < queue_gap && vg_fabsf(w.v_ahead) < queue_speed;
}

static vg_standing class_of(const vg_model* model, const vg_flow* flow, uint32_t slot)
{
    const bool beside = flow->d[slot] >= off_centre || flow->d[slot] <= -off_centre;
    const double front = vg_flow_s(model, flow, slot) + (double)model->half_length[slot];
    if (vg_fabsf(flow->v[slot]) > VG_STANDING_SPEED) {
        return VG_MOVING;
    }
    if (slot < model->controlled_count || model->cruise[slot] > VG_STANDING_SPEED) {
        return VG_TEMPORARILY_STOPPED;
    }
    if (model->turned[slot] || beside) {
        return VG_STATIC;
    }
    return waits_behind(model, flow, slot)
                   || place_explains(model->road, (uint32_t)flow->lane[slot], front)
               ? VG_TEMPORARILY_STOPPED : VG_STATIC;
}

void vg_model_classify(vg_model* model, const vg_flow* flow)
{
    VERGE_ASSERT(vg_flow_holds(model, flow));
    if (!model->single_axis) {
        vg_pairs_update(model, flow);
    }
    for (uint32_t slot = 0; slot < model->count; ++slot) {
        model->standing[slot] = (uint8_t)class_of(model, flow, slot);
    }
}
