/// The decision stage: from a scene to action steps. The search works on slots in single precision.
/// Here its result is converted to a verge_decision, and the last decision (verge_commitment) to
/// the warm start of the search.
#include "verge/decision.h"

#include "base/contract.h"
#include "base/scalar.h"
#include "base/stage.h"
#include "decide/decider.h"
#include "decide/playout.h"
#include "traffic/advance.h"
#include "traffic/pairs.h"
#include "traffic/reward.h"
#include "traffic/value.h"

#include <string.h>

struct verge_decider {
    verge_planner_def def;
    vg_tree*  tree;     // not POLICY
    vg_pairs* pairs;
    vg_model* model;
    vg_value* value;    // not PAPER
    vg_flow*  flows;    // [3] the root, and two states after it
    vg_order* order;    // who passes conflict areas first
    uint32_t  nodes_peak, bytes_per_node;
};

static void* take(vg_arena* arena, const verge_planner_def* def);
static uint32_t reached_before(const verge_decider* self, const verge_scene* scene,
                               verge_commitment* commitment);
static bool recall(const verge_decider* self, const verge_scene* scene,
                   const verge_commitment* commitment, vg_joint_actions* sequence);
static void commit(const verge_decider* self, const verge_scene* scene,
                   const vg_joint_actions* sequence, verge_commitment* commitment);
static bool confirms(const verge_decider* self, const verge_scene* scene,
                     const vg_joint_actions* sequence, const vg_joint_actions* warm,
                     const verge_commitment* commitment);
static void write_steps(verge_decider* self, const verge_scene* scene,
                        const vg_joint_actions* sequence, verge_decision* decision);

// ---------------------------------------------------------------------------- memory

size_t verge_decider_memory_size(const verge_planner_def* def)
{
    return vg_stage_size(def, take);
}

verge_status verge_decider_init(verge_decider** decider, const verge_planner_def* def, void* memory,
                                size_t size)
{
    if (decider == NULL) {
        return VERGE_ERR_ARGUMENT;
    }
    void* stage = NULL;
    const verge_status status = vg_stage_init(&stage, def, memory, size, take);
    *decider = stage;
    return status;
}

static void* take(vg_arena* arena, const verge_planner_def* def)
{
    verge_decider* self = vg_arena_take(arena, sizeof *self);
    vg_tree* tree = def->search != VERGE_SEARCH_POLICY ? vg_tree_take(arena, def) : NULL;
    const vg_traffic traffic = vg_traffic_take(arena, def);
    vg_value* value = NULL;
    if (def->search != VERGE_SEARCH_PAPER) {
        value = vg_value_take(arena, def->controlled_max, def->road.lane_count);
    }
    if (self != NULL) {
        *self = (verge_decider){ .def = *def, .tree = tree, .value = value,
                                 .pairs = traffic.pairs, .model = traffic.model,
                                 .flows = traffic.flows, .order = traffic.order };
        self->def.road = (verge_road_def){ NULL, 0 };
    }
    return self;
}

const verge_planner_def* vg_decider_def(const verge_decider* self)
{
    return &self->def;
}

vg_traffic vg_decider_traffic(const verge_decider* self)
{
    return (vg_traffic){ self->pairs, self->model, self->flows, self->order };
}

void verge_decider_nodes(const verge_decider* self, uint32_t* nodes_peak, uint32_t* bytes_per_node)
{
    if (nodes_peak != NULL) {
        *nodes_peak = self == NULL ? 0 : self->nodes_peak;
    }
    if (bytes_per_node != NULL) {
        *bytes_per_node = self == NULL ? 0 : self->bytes_per_node;
    }
}

// ---------------------------------------------------------------------------- one decision

verge_status verge_decide_for(uint64_t config, verge_decider* self, const verge_scene* scene,
                              verge_commitment* commitment, verge_decision* decision)
{
    if (config != VERGE_CONFIG) {
        return VERGE_ERR_CONFIG;
    }
    if (self == NULL || commitment == NULL || decision == NULL || !vg_scene_holds(scene)
        || (decision->vehicles == NULL && decision->vehicles_max > 0)) {
        return VERGE_ERR_ARGUMENT;
    }
    // Before any set of vehicles, which has 64 bits.
    if (scene->vehicle_count > self->def.vehicles_max || !vg_pairs_hold(self->pairs, scene->road)) {
        return VERGE_ERR_CAPACITY;
    }
    const uint64_t controlled = vg_scene_controlled(scene);
    const uint32_t most = self->def.controlled_max < decision->vehicles_max
                              ? self->def.controlled_max
                              : decision->vehicles_max;
    if (vg_bits(controlled) > most) {
        return VERGE_ERR_CAPACITY;
    }
    vg_model_from(self->model, &self->flows[0], &self->def, self->pairs, scene, controlled);
    decision->reordered = decision->unstuck = 0;
    if (self->model->best) {
        vg_order_from(self->order, self->model, &self->flows[0], scene, &commitment->turns,
                      &commitment->beliefs);
        decision->reordered = self->order->reordered;
        decision->unstuck = self->order->unstuck;
    }
    decision->utime = scene->utime;
    decision->vehicle_count = self->model->controlled_count;
    memset(&decision->search, 0, sizeof decision->search);
    if (decision->vehicle_count == 0) {
        commitment->vehicle_count = 0;
        return VERGE_OK;
    }
    if (self->value != NULL) {
        vg_value_fill(self->value, self->model, &self->flows[0]);
        vg_flow_begin(self->model, &self->flows[0], reached_before(self, scene, commitment));
    }
    vg_joint_actions warm, sequence;
    const bool is_warm = self->model->best && recall(self, scene, commitment, &warm);
    vg_random random = vg_random_from(self->def.seed, commitment->decisions++);
    vg_search_run(self->tree, self->model, self->flows, &random, is_warm ? &warm : NULL,
                  &sequence, &decision->search);
    if (!is_warm || !confirms(self, scene, &sequence, &warm, commitment)) {
        commit(self, scene, &sequence, commitment);
    }
    write_steps(self, scene, &sequence, decision);
    const uint32_t nodes = decision->search.nodes;
    self->nodes_peak = nodes > self->nodes_peak ? nodes : self->nodes_peak;
    self->bytes_per_node =
        self->tree == NULL ? 0 : vg_node_size(self->model->count, self->model->controlled_count);
    return VERGE_OK;
}

static int32_t id_of(const verge_decider* self, const verge_scene* scene, int32_t slot)
{
    return slot < 0 ? -1 : scene->vehicles[self->model->input_index[slot]].id;
}

// ---------------------------------------------------------------------------- commitment

static bool has_reached(const verge_commitment* commitment, int32_t id, int32_t target)
{
    const uint32_t count = commitment->reached_count;
    for (uint32_t i = 0; i < count && i < VERGE_CONTROLLED_MAX; ++i) {
        if (commitment->reached_ids[i] == id) {
            return commitment->reached_targets[i] == target;
        }
    }
    return false;
}

// The slots (bits) that are or have been in their target lane.
static uint32_t reached_before(const verge_decider* self, const verge_scene* scene,
                               verge_commitment* commitment)
{
    uint32_t reached = 0;
    for (uint32_t slot = 0; slot < self->model->controlled_count; ++slot) {
        const verge_vehicle* vehicle = &scene->vehicles[self->model->input_index[slot]];
        const bool now = vg_flow_in_target(self->model, &self->flows[0], slot);
        const bool before = has_reached(commitment, vehicle->id, vehicle->target_lane);
        reached |= (uint32_t)(now || before) << slot;
    }
    commitment->reached_count = 0;
    for (uint32_t slot = 0; slot < self->model->controlled_count; ++slot) {
        if ((reached >> slot & 1u) != 0) {
            const verge_vehicle* vehicle = &scene->vehicles[self->model->input_index[slot]];
            commitment->reached_ids[commitment->reached_count] = vehicle->id;
            commitment->reached_targets[commitment->reached_count++] = vehicle->target_lane;
        }
    }
    return reached;
}

// The action of a vehicle at a time [s] after the commitment; VERGE_ACTION_COUNT: none.
static uint8_t committed_action(const verge_commitment* commitment, int32_t id, double t,
                                double step_s)
{
    if (t < 0.0 || t >= (double)commitment->step_count * step_s) {
        return VERGE_ACTION_COUNT;
    }
    for (uint32_t i = 0; i < commitment->vehicle_count; ++i) {
        if (commitment->vehicle_ids[i] == id) {
            return commitment->actions[(uint32_t)(t / step_s)][i];
        }
    }
    return VERGE_ACTION_COUNT;
}

// Shifts the commitment to the present: each step gets the action decided for its middle. The age
// is counted from the first decision. If it were counted from the last confirmation, a lane change
// decided for the next step would be postponed for ever. Commitments older than 100 s are ignored.
static bool recall(const verge_decider* self, const verge_scene* scene,
                   const verge_commitment* commitment, vg_joint_actions* sequence)
{
    const double step_s = self->def.step_s;
    const double age = vg_seconds_between(commitment->utime, scene->utime);
    bool any = false;
    if (!(age >= 0.0 && age < 100.0) || commitment->step_count > VERGE_STEPS_MAX
        || commitment->vehicle_count > VERGE_CONTROLLED_MAX) {
        return false;
    }
    sequence->step_count = self->def.steps;
    for (uint32_t t = 0; t < sequence->step_count; ++t) {
        for (uint32_t slot = 0; slot < self->model->controlled_count; ++slot) {
            const double at = age + ((double)t + 0.5) * step_s;
            const uint8_t action =
                committed_action(commitment, id_of(self, scene, (int32_t)slot), at, step_s);
            any = any || action < VERGE_ACTION_COUNT;
            sequence->actions[t][slot] =
                action < VERGE_ACTION_COUNT ? action : (uint8_t)VG_POLICY;
        }
    }
    return any;
}

// Has the decision the same actions as the commitment, for the same vehicles?
static bool confirms(const verge_decider* self, const verge_scene* scene,
                     const vg_joint_actions* sequence, const vg_joint_actions* warm,
                     const verge_commitment* commitment)
{
    bool same = commitment->vehicle_count == self->model->controlled_count;
    for (uint32_t slot = 0; same && slot < self->model->controlled_count; ++slot) {
        same = commitment->vehicle_ids[slot] == id_of(self, scene, (int32_t)slot);
        for (uint32_t t = 0; t < sequence->step_count; ++t) {
            const uint8_t before = warm->actions[t][slot];
            same = same && (before == VG_POLICY || sequence->actions[t][slot] == before);
        }
    }
    return same;
}

static void commit(const verge_decider* self, const verge_scene* scene,
                   const vg_joint_actions* sequence, verge_commitment* commitment)
{
    commitment->utime = scene->utime;
    commitment->step_count = sequence->step_count;
    commitment->vehicle_count = self->model->controlled_count;
    for (uint32_t slot = 0; slot < commitment->vehicle_count; ++slot) {
        commitment->vehicle_ids[slot] = id_of(self, scene, (int32_t)slot);
        for (uint32_t t = 0; t < sequence->step_count; ++t) {
            commitment->actions[t][slot] = sequence->actions[t][slot];
        }
    }
}

// ---------------------------------------------------------------------------- action steps

static verge_action_step step_of(const verge_decider* self, const verge_scene* scene,
                                 const vg_flow* before, const vg_moves* moves, const vg_flow* after,
                                 uint32_t slot, uint8_t action, uint32_t t)
{
    const vg_lane* lane = &scene->road->lanes[after->lane[slot]];
    const vg_action_row* row = &vg_actions[action];
    int32_t ahead = -1, behind = -1;
    vg_flow_neighbours(self->model, after, slot, &ahead, &behind);
    return (verge_action_step){
        .action = (verge_action)action,
        .lane_id = lane->id,
        .t0 = (double)t * self->def.step_s,
        .t1 = (double)(t + 1u) * self->def.step_s,
        .s = vg_flow_s(self->model, after, slot),
        .d = (double)after->d[slot],
        .v = (double)after->v[slot],
        .distance = (double)((moves->station[row->along][slot] - before->station[slot])
                             * before->rate[slot]),
        .brake_light = row->brake_light,
        .turn_signal = row->turn_signal,
        .ahead_id = id_of(self, scene, ahead),
        .behind_id = id_of(self, scene, behind),
    };
}

// Simulates the decided actions and writes the state of each vehicle after each step. Not inlined:
// its moves and those of the search do not take up the stack at the same time.
static __attribute__((noinline)) void write_steps(verge_decider* self, const verge_scene* scene,
                                                  const vg_joint_actions* sequence,
                                                  verge_decision* decision)
{
    VERGE_ASSERT(sequence->step_count <= VERGE_STEPS_MAX);
    vg_moves moves;
    memset(&moves, 0, sizeof moves);
    for (uint32_t slot = 0; slot < decision->vehicle_count; ++slot) {
        decision->vehicles[slot].vehicle_id = id_of(self, scene, (int32_t)slot);
        decision->vehicles[slot].step_count = sequence->step_count;
        decision->vehicles[slot].pass_count =
            vg_order_passes(self->model, scene, slot, decision->vehicles[slot].passes);
        decision->vehicles[slot].why =
            vg_order_reason(self->model, &self->flows[0], scene, slot);
    }
    for (uint32_t t = 0; t < sequence->step_count; ++t) {
        const vg_flow* before = &self->flows[t % 2u];
        vg_flow* after = &self->flows[(t + 1u) % 2u];
        vg_flow_moves(self->model, before, &moves);
        vg_flow_advance(self->model, before, &moves, sequence->actions[t], after);
        for (uint32_t slot = 0; slot < decision->vehicle_count; ++slot) {
            decision->vehicles[slot].steps[t] =
                step_of(self, scene, before, &moves, after, slot, sequence->actions[t][slot], t);
        }
    }
}
