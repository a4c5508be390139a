/// See bound.h.
#include "bound.h"

#include "traffic/advance.h"
#include "traffic/reward.h"
#include "must.h"
#include "traffic/pairs.h"
#include "traffic/traffic.h"
#include "traffic/value.h"

#include <math.h>

/// One vehicle alone.
typedef struct alone {
    vg_model scene;
    vg_flow  flows[BOUND_STEPS_MAX + 1]; ///< along the sequence under way
} alone;

static double best_alone(alone* self, uint32_t step);
static void place_all(const world* world, verge_scene* scene);
static void* buffers_make(vg_pairs** pairs, vg_value** value);

double bound_of(const world* world)
{
    const verge_planner_def* def = &world->scene->def;
    verge_vehicle       vehicles[VERGE_VEHICLES_MAX];
    verge_lane_position positions[VERGE_VEHICLES_MAX];
    verge_scene scene = { .road = world->road, .vehicles_max = VERGE_VEHICLES_MAX,
                          .vehicles = vehicles, .positions = positions };
    place_all(world, &scene);
    if (def->steps > BOUND_STEPS_MAX) {
        return NAN;
    }
    alone* all = must_calloc(1, sizeof *all);
    alone* self = must_calloc(1, sizeof *self);
    vg_pairs* pairs = NULL;
    vg_value* value = NULL;
    void* memory = buffers_make(&pairs, &value);
    vg_model_from(&all->scene, &all->flows[0], def, pairs, &scene, vg_scene_controlled(&scene));
    double sum = 0.0;
    for (uint32_t slot = 0; slot < all->scene.controlled_count; ++slot) {
        const uint32_t i = all->scene.input_index[slot];
        const verge_scene one = { .road = world->road, .vehicle_count = 1, .vehicles_max = 1,
                                  .vehicles = &vehicles[i], .positions = &positions[i] };
        vg_model_from(&self->scene, &self->flows[0], def, pairs, &one, 1);
        if (self->scene.best) {
            vg_value_fill(value, &self->scene, &self->flows[0]);
            vg_flow_begin(&self->scene, &self->flows[0], 0);
        }
        sum += (double)all->scene.weight[slot] * best_alone(self, 0);
    }
    const bool any = all->scene.controlled_count > 0;
    free(memory);
    free(self);
    free(all);
    return any ? fmin(sum, 1.0) : (double)NAN;
}

/// A simulation may end when every vehicle has reached its target, or continue.
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
    for (uint8_t action = 0; action < VERGE_ACTION_COUNT; ++action) {
        if (((moves.legal[0] >> action) & 1u) != 0) {
            vg_flow_advance(&self->scene, flow, &moves, &action, &self->flows[step + 1]);
            best = fmax(best, best_alone(self, step + 1));
        }
    }
    return best;
}

static void place_all(const world* world, verge_scene* scene)
{
    scene->vehicle_count = world_states(world, scene->vehicles);
    for (uint32_t i = 0; i < scene->vehicle_count; ++i) {
        const verge_vehicle* at = &scene->vehicles[i];
        scene->positions[i] =
            verge_road_project(world->road, at->x, at->y, at->heading, VERGE_NO_LANE);
    }
}

static void buffers_take(vg_arena* arena, vg_pairs** pairs, vg_value** value)
{
    const verge_planner_def def = verge_planner_default_def(); // any road
    *pairs = vg_traffic_take(arena, &def).pairs;
    *value = vg_value_take(arena, VERGE_CONTROLLED_MAX, 0);
}

/// Returns the memory of both, to be freed.
static void* buffers_make(vg_pairs** pairs, vg_value** value)
{
    vg_arena arena;
    vg_arena_init(&arena, NULL, 0);
    buffers_take(&arena, pairs, value);
    const size_t size = arena.used;
    void* memory = aligned_alloc(VG_ARENA_ALIGN, size);
    if (memory == NULL) {
        abort();
    }
    vg_arena_init(&arena, memory, size);
    buffers_take(&arena, pairs, value);
    return memory;
}
