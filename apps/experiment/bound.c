/// See bound.h.
#include "bound.h"

#include "traffic/advance.h"
#include "traffic/reward.h"
#include "must.h"

#include <math.h>

/// One vehicle alone.
typedef struct alone {
    vg_model scene;
    vg_pairs sight;
    vg_flow  flows[BOUND_STEPS_MAX + 1]; ///< along the sequence under way
} alone;

static double best_alone(alone* self, uint32_t step);
static uint32_t place_all(const world* world, verge_vehicle* vehicles, vg_placed* placed);

double bound_of(const world* world)
{
    const verge_planner_def* def = &world->scene->def;
    verge_vehicle vehicles[VERGE_VEHICLES_MAX];
    vg_placed     placed[VERGE_VEHICLES_MAX];
    const uint32_t count = place_all(world, vehicles, placed);
    if (def->steps > BOUND_STEPS_MAX) {
        return NAN;
    }
    alone* all = must_calloc(1, sizeof *all);
    alone* self = must_calloc(1, sizeof *self);
    vg_model_from(&all->scene, &all->flows[0], def, world->road, &all->sight, vehicles, placed,
                  count);
    double sum = 0.0;
    for (uint32_t slot = 0; slot < all->scene.controlled_count; slot++) {
        const uint32_t i = all->scene.input_index[slot];
        vg_model_from(&self->scene, &self->flows[0], def, world->road, &self->sight, &vehicles[i],
                      &placed[i], 1);
        sum += (double)all->scene.weight[slot] * best_alone(self, 0);
    }
    const bool any = all->scene.controlled_count > 0;
    free(self);
    free(all);
    return any ? fmin(sum, 1.0) : (double)NAN;
}

/// A simulation may end as soon as everybody is where they want to be, or go on.
static double best_alone(alone* self, uint32_t step)
{
    const uint32_t steps = self->scene.def->steps;
    const vg_flow* flow = &self->flows[step];
    double best = 0.0;
    if (step == steps || vg_flow_terminal(&self->scene, flow)) {
        best = vg_flow_reward(&self->scene, flow, step, true);
    }
    if (step == steps) {
        return best;
    }
    vg_moves moves;
    vg_flow_moves(&self->scene, flow, &moves);
    for (uint8_t action = 0; action < VERGE_ACTION_COUNT; action++) {
        if (((moves.legal[0] >> action) & 1u) != 0) {
            vg_flow_advance(&self->scene, flow, &moves, &action, &self->flows[step + 1]);
            best = fmax(best, best_alone(self, step + 1));
        }
    }
    return best;
}

static uint32_t place_all(const world* world, verge_vehicle* vehicles, vg_placed* placed)
{
    const verge_road_def* road = &world->scene->def.road;
    const uint32_t        count = world_states(world, vehicles);
    for (uint32_t i = 0; i < count; i++) {
        const verge_vehicle*      at = &vehicles[i];
        const verge_lane_position on =
            verge_road_project(world->road, at->x, at->y, at->heading, VERGE_NO_LANE);
        placed[i] = (vg_placed){ .on_road = on.lane_id != VERGE_NO_LANE, .s = on.s, .d = on.d };
        for (uint32_t lane = 0; lane < road->lane_count; lane++) {
            if (road->lanes[lane].id == on.lane_id) {
                placed[i].lane = lane;
            }
        }
    }
    return count;
}
