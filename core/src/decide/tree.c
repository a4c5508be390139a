/// The pool of metanodes, and the tree search over it: select (Eq. 1), expand, simulate, back up.
#include "decide/tree.h"

#include "base/contract.h"
#include "base/scalar.h"
#include "decide/playout.h"
#include "traffic/conflict.h"
#include "traffic/reward.h"

#include <string.h>

enum { joint_tries_max = 32 }; // joint actions visited in one expansion

static void iterate(vg_search* self, int32_t root);

// ---------------------------------------------------------------------------- the pool

uint32_t vg_node_size(uint32_t vehicle_count, uint32_t controlled_count)
{
    const uint32_t state = 14u * vehicle_count + 9u * controlled_count;
    return (uint32_t)sizeof(vg_metanode) + (state + 7u) / 8u * 8u;
}

// In a saved state a vehicle's lane says, too, whether it has stopped at its stop sign.
static const uint32_t stopped_bit = 0x8000u;
static_assert(VERGE_LANES_MAX <= 0x8000, "the highest bit of a saved lane is free");

static uint32_t state_size(uint32_t vehicle_count, uint32_t controlled_count)
{
    return vg_node_size(vehicle_count, controlled_count) - (uint32_t)sizeof(vg_metanode);
}

vg_tree* vg_tree_take(vg_arena* arena, const verge_planner_def* def)
{
    const size_t nodes = def->nodes_max;
    vg_tree* tree = vg_arena_take(arena, sizeof *tree);
    vg_metanode* pool = vg_arena_take(arena, nodes * sizeof *pool);
    const size_t slots = nodes + VG_TRAIL_COUNT * VG_TRAIL_LENGTH;
    uint8_t* states =
        vg_arena_take(arena, slots * state_size(def->vehicles_max, def->controlled_max));
    double* log_of = vg_arena_take(arena, VG_TABLE_SIZE * sizeof *log_of);
    double* inverse_root = vg_arena_take(arena, VG_TABLE_SIZE * sizeof *inverse_root);
    if (tree == NULL || pool == NULL || states == NULL || log_of == NULL || inverse_root == NULL) {
        return NULL;
    }
    *tree = (vg_tree){ def->nodes_max, 0, 0, pool, states, log_of, inverse_root };
    for (uint32_t n = 1; n < VG_TABLE_SIZE; ++n) {
        log_of[n] = vg_log((double)n);
        inverse_root[n] = 1.0 / vg_sqrt((double)n);
    }
    return tree;
}

void vg_tree_empty(vg_tree* tree, uint32_t vehicle_count, uint32_t controlled_count)
{
    tree->count = 0;
    tree->stride = state_size(vehicle_count, controlled_count);
}

static uint8_t* put(uint8_t* to, const void* from, size_t size)
{
    memcpy(to, from, size);
    return to + size;
}

static const uint8_t* get(const uint8_t* from, void* to, size_t size)
{
    memcpy(to, from, size);
    return from + size;
}

uint32_t vg_tree_trail(const vg_search* self, uint32_t trail, uint32_t step_index)
{
    VERGE_ASSERT(trail < VG_TRAIL_COUNT && step_index < VG_TRAIL_LENGTH);
    return self->tree->nodes_max + trail * VG_TRAIL_LENGTH + step_index;
}

void vg_tree_save(const vg_search* self, uint32_t slot, const vg_flow* flow)
{
    VERGE_ASSERT(slot < self->tree->nodes_max + VG_TRAIL_COUNT * VG_TRAIL_LENGTH);
    const size_t count = self->model->count, controlled = self->model->controlled_count;
    uint8_t* to = self->tree->states + (size_t)slot * self->tree->stride;
    to = put(to, flow->station, count * sizeof(float));
    to = put(to, flow->d, count * sizeof(float));
    to = put(to, flow->v, count * sizeof(float));
    to = put(to, flow->credit, controlled * sizeof(float));
    to = put(to, flow->driven, controlled * sizeof(float));
    to = put(to, flow->previous, controlled);
    for (size_t i = 0; i < count; ++i) {
        const bool stopped = (flow->stopped >> i & 1u) != 0;
        const uint16_t lane = (uint16_t)((uint32_t)flow->lane[i] | (stopped ? stopped_bit : 0u));
        memcpy(to + i * sizeof lane, &lane, sizeof lane);
    }
}

// Time from the root: the states of nodes and trails are those at the end of a step.
static float time_of(const vg_search* self, uint32_t slot)
{
    const uint32_t nodes = self->tree->nodes_max;
    const uint32_t steps =
        slot < nodes ? self->tree->nodes[slot].depth : (slot - nodes) % VG_TRAIL_LENGTH;
    float t = 0.0f;
    for (uint32_t k = 0; k < steps; ++k) { // summed up as in vg_flow_advance()
        t += (float)self->model->def->step_s;
    }
    return t;
}

void vg_tree_load(const vg_search* self, uint32_t slot, vg_flow* flow)
{
    VERGE_ASSERT(slot < self->tree->nodes_max + VG_TRAIL_COUNT * VG_TRAIL_LENGTH);
    const size_t count = self->model->count, controlled = self->model->controlled_count;
    const uint8_t* from = self->tree->states + (size_t)slot * self->tree->stride;
    from = get(from, flow->station, count * sizeof(float));
    from = get(from, flow->d, count * sizeof(float));
    from = get(from, flow->v, count * sizeof(float));
    from = get(from, flow->credit, controlled * sizeof(float));
    from = get(from, flow->driven, controlled * sizeof(float));
    from = get(from, flow->previous, controlled);
    flow->t = time_of(self, slot);
    flow->stopped = 0;
    for (size_t i = 0; i < count; ++i) {
        uint16_t lane;
        memcpy(&lane, from + i * sizeof lane, sizeof lane);
        flow->lane[i] = lane & (uint16_t)~stopped_bit;
        flow->stopped |= (lane & stopped_bit) != 0 ? (uint64_t)1 << i : 0;
    }
    vg_flow_derive(self->model, flow);
}

int32_t vg_tree_add(vg_search* self, int32_t parent, const uint8_t* actions, const vg_flow* flow)
{
    vg_tree* tree = self->tree;
    VERGE_ASSERT(tree->count < tree->nodes_max);
    const int32_t at = (int32_t)tree->count++;
    vg_metanode* node = &tree->nodes[at];
    memset(node, 0, sizeof *node);
    self->report->nodes = tree->count;
    node->parent = parent;
    node->first_child = node->next_sibling = VG_NO_NODE;
    if (parent != VG_NO_NODE) {
        vg_metanode* above = &tree->nodes[parent];
        memcpy(node->actions, actions, self->model->controlled_count);
        node->depth = (uint8_t)(above->depth + 1u);
        node->next_sibling = above->first_child;
        above->first_child = at;
    }
    node->terminal = node->depth >= self->model->def->steps || vg_flow_terminal(self->model, flow);
    self->report->depth = node->depth > self->report->depth ? node->depth : self->report->depth;
    vg_tree_save(self, (uint32_t)at, flow);
    return at;
}

// ---------------------------------------------------------------------------- the search

// Iterations for step t, in proportion to 1/(t/2 + 1) as in the program of the paper's authors. The
// remainder of the division goes to step 0.
static uint32_t share_of(uint32_t budget, uint32_t step, uint32_t steps)
{
    double sum = 0.0;
    for (uint32_t t = 0; t < steps; ++t) {
        sum += 2.0 / (double)(t + 2u);
    }
    return (uint32_t)((double)budget * (2.0 / (double)(step + 2u)) / sum);
}

static int32_t greedy_child(const vg_tree* tree, int32_t node)
{
    int32_t best = VG_NO_NODE;
    double best_mean = -1.0;
    uint32_t best_visits = 0;
    for (int32_t c = tree->nodes[node].first_child; c != VG_NO_NODE;
         c = tree->nodes[c].next_sibling) {
        const vg_metanode* child = &tree->nodes[c];
        if (child->mean > best_mean || (child->mean == best_mean && child->visits > best_visits)) {
            best = c;
            best_mean = child->mean;
            best_visits = child->visits;
        }
    }
    return best;
}

// Each step is searched from the child chosen in the step before.
void vg_search_tree(vg_search* self, uint32_t budget)
{
    const uint32_t steps = self->model->def->steps;
    uint32_t spare = budget;
    for (uint32_t t = 0; t < steps; ++t) {
        spare -= share_of(budget, t, steps);
    }
    vg_joint_actions committed = { .step_count = 0 };
    int32_t root = 0;
    for (uint32_t t = 0; t < steps; ++t) {
        const uint32_t share = share_of(budget, t, steps) + (t == 0 ? spare : 0u);
        for (uint32_t k = 0; k < share; ++k) {
            iterate(self, root);
        }
        const int32_t child = greedy_child(self->tree, root);
        if (child != VG_NO_NODE) {
            memcpy(committed.actions[committed.step_count++], self->tree->nodes[child].actions,
                   self->model->controlled_count);
            root = child;
        }
    }
    if (self->model->def->search == VERGE_SEARCH_PAPER || self->best_reward <= VG_NO_PLAN) {
        self->best = committed;
    }
}

// ---------------------------------------------------------------------------- one iteration

static double log_of(const vg_tree* tree, uint32_t n)
{
    return n < VG_TABLE_SIZE ? tree->log_of[n] : vg_log((double)n);
}

// The child with the largest upper confidence bound (Eq. 1).
static int32_t uct_child(const vg_search* self, const vg_metanode* node)
{
    const vg_tree* tree = self->tree;
    const double scale = 2.0 * self->model->def->exploration
                         * vg_sqrt(2.0 * log_of(tree, node->visits > 0 ? node->visits : 1));
    int32_t best = VG_NO_NODE;
    double best_value = -1.0;
    for (int32_t c = node->first_child; c != VG_NO_NODE; c = tree->nodes[c].next_sibling) {
        const vg_metanode* child = &tree->nodes[c];
        const uint32_t n = child->visits;
        const double root = n < VG_TABLE_SIZE ? tree->inverse_root[n] : 1.0 / vg_sqrt((double)n);
        const double value = child->mean + scale * root;
        if (value > best_value) {
            best = c;
            best_value = value;
        }
    }
    VERGE_ASSERT(best != VG_NO_NODE);
    return best;
}

static_assert(VERGE_ACTION_COUNT <= 6, "strides are coprime to products of set sizes up to 6");

// Prepares the enumeration of a node's joint actions. Any stride without the factors 2, 3 and 5 is
// coprime to a product of set sizes up to 6, so each joint action is visited exactly once.
static void open_node(vg_search* self, vg_metanode* node)
{
    uint64_t product = 1;
    for (uint32_t i = 0; i < self->model->controlled_count; ++i) {
        product *= vg_set_size(self->moves.legal[i]);
    }
    uint32_t stride = vg_random_next(self->random); // large: the actions of all vehicles change
    while (stride % 2u == 0 || stride % 3u == 0 || stride % 5u == 0) {
        ++stride;
    }
    node->opened = 1;
    node->joint_left = product;
    node->joint_at = vg_random_next(self->random) % product;
    node->joint_stride = stride;
}

static void decode(const vg_search* self, uint64_t number, uint8_t* actions)
{
    for (uint32_t i = 0; i < self->model->controlled_count; ++i) {
        const uint64_t size = vg_set_size(self->moves.legal[i]);
        actions[i] = vg_set_member(self->moves.legal[i], (uint32_t)(number % size));
        number /= size;
    }
}

// The next joint action of this node without conflict. False: none was found in joint_tries_max.
static bool next_joint_action(vg_search* self, vg_metanode* node, uint8_t* actions)
{
    uint64_t product = 1;
    for (uint32_t i = 0; i < self->model->controlled_count; ++i) {
        product *= vg_set_size(self->moves.legal[i]);
    }
    for (uint32_t tries = 0; tries < joint_tries_max && node->joint_left > 0; ++tries) {
        decode(self, node->joint_at, actions);
        node->joint_at = (node->joint_at + node->joint_stride) % product;
        node->joint_left--;
        if (vg_flow_conflicts(self->model, self->flow, &self->moves, actions) == 0) {
            return true;
        }
        self->report->pruned++;
    }
    return false;
}

// Default policy: actions uniform over the legal set of each vehicle, to the horizon or to a
// terminal flow.
static double simulate(vg_search* self)
{
    while (!vg_playout_over(self)) {
        uint8_t actions[VERGE_CONTROLLED_MAX];
        vg_flow_moves_unchecked(self->model, self->flow, &self->moves);
        vg_playout_draw(self, actions, ~0u);
        if (!vg_playout_repair(self, actions)) {
            return vg_playout_finish(self, false);
        }
        vg_playout_step(self, actions);
    }
    return vg_playout_finish(self, true);
}

static int32_t descend(vg_search* self, int32_t root)
{
    const vg_tree* tree = self->tree;
    int32_t at = root;
    for (uint32_t layer = 0; layer <= VERGE_STEPS_MAX; ++layer) {
        const vg_metanode* node = &tree->nodes[at];
        if (node->terminal || !node->opened || node->joint_left > 0
            || node->first_child == VG_NO_NODE) {
            break;
        }
        at = uct_child(self, node);
    }
    return at;
}

// Sets the sequence to the actions on the path from node 0 to this node.
static void trace(vg_search* self, int32_t node)
{
    const vg_tree* tree = self->tree;
    self->sequence.step_count = tree->nodes[node].depth;
    for (int32_t at = node; tree->nodes[at].parent != VG_NO_NODE; at = tree->nodes[at].parent) {
        memcpy(self->sequence.actions[tree->nodes[at].depth - 1u], tree->nodes[at].actions,
               self->model->controlled_count);
    }
}

static void iterate(vg_search* self, int32_t root)
{
    int32_t at = descend(self, root);
    vg_metanode* node = &self->tree->nodes[at];
    vg_tree_load(self, (uint32_t)at, self->flow);
    trace(self, at);
    if (!node->terminal) {
        uint8_t actions[VERGE_CONTROLLED_MAX];
        vg_flow_moves(self->model, self->flow, &self->moves);
        if (!node->opened) {
            open_node(self, node);
        }
        if (self->tree->count == self->tree->nodes_max) {
            self->report->unexpanded += node->joint_left > 0 ? 1u : 0u;
        } else if (next_joint_action(self, node, actions)) {
            vg_playout_step(self, actions);
            at = vg_tree_add(self, at, actions, self->flow);
        }
    }
    const double reward = vg_max(simulate(self), 0.0); // below 0 only for conflicts that remain
    for (; at != VG_NO_NODE; at = self->tree->nodes[at].parent) {
        vg_metanode* node = &self->tree->nodes[at];
        node->visits++;
        node->mean += (reward - node->mean) / (double)node->visits;
    }
}
