/// Select, expand, simulate, back up; then polish. See mcts.h.

#include "decide/mcts.h"

#include "decide/bound.h"
#include "base/contract.h"
#include "base/scalar.h"
#include "traffic/advance.h"
#include "traffic/conflict.h"
#include "traffic/reward.h"

#include <string.h>

enum {
    none = -1,
    joint_tries_max = 32,  // joint actions looked at for one expansion
    repair_tries_max = 4,  // new draws for vehicles in conflict, in a simulation
    // Of the budget of BEST, one part in this many is the tree's, the rest polishes: measured on
    // random freeway scenes (README, figures) with 3,000 iterations, from 1/2 to none.
    tree_part = 5,
    table_size = 4096,     // visits with tabulated logarithm and root
    trail_count = 2,       // states along the best plan, and along the one under way
    trail_length = VERGE_STEPS_MAX + 1,
};

// 64 bytes and the product's walk; the state stands beside it, packed for this scene's counts.
typedef struct vg_metanode {
    int32_t  parent, first_child, next_sibling;
    uint32_t visits;
    double   mean; // of the rewards backed up: X-bar of Eq. 1
    uint64_t joint_left;   // joint actions not yet looked at
    uint64_t joint_at;     // number of the next one
    uint32_t joint_stride; // coprime to the product of the legal sets' sizes
    uint8_t  depth, opened, terminal;
    uint8_t  actions[VERGE_CONTROLLED_MAX];
} vg_metanode;

struct vg_tree {
    uint32_t     nodes_max, count, stride;
    vg_metanode* nodes;
    uint8_t*     states;
    double*      log_of;       // [table_size]
    double*      inverse_root; // [table_size] 1 / sqrt(n)
};

// One search: everything that changes while it runs.
typedef struct search {
    vg_tree*        tree;
    const vg_model* scene;
    vg_random*      random;
    vg_flow         buffer[2];
    vg_flow*        flow; // the simulation's state
    vg_flow*        next; // and where it goes
    vg_moves        moves;
    vg_joint_actions         line;    // actions of the simulation under way
    vg_joint_actions         best;
    double          best_reward;
    uint32_t        missing; // planned ones (bits) that the best plan does not bring to their target
    uint32_t        trail;   // 0 or 1: which trail is the best plan's
    int8_t          way[VERGE_CONTROLLED_MAX]; // at the root: +1 the target lies left, -1 right
    verge_search_report* report;
} search;

static void   search_tree(search* self, uint32_t budget);
static void   iterate(search* self, int32_t root);
static void   polish(search* self, uint32_t budget);
static double simulate_line(search* self, uint32_t from, const vg_joint_actions* wish);
static void   replay(search* self, const vg_joint_actions* line);
static double switched(const search* self, const vg_joint_actions* kept);
static uint8_t wish_of(const vg_joint_actions* wish, uint32_t step_index, uint32_t slot);

// ---------------------------------------------------------------------------- the pool

uint32_t vg_node_size(uint32_t vehicle_count, uint32_t controlled_count)
{
    const uint32_t state = 13u * vehicle_count + 9u * controlled_count;
    return (uint32_t)sizeof(vg_metanode) + (state + 7u) / 8u * 8u;
}

static uint32_t state_size(uint32_t vehicle_count, uint32_t controlled_count)
{
    return vg_node_size(vehicle_count, controlled_count) - (uint32_t)sizeof(vg_metanode);
}

vg_tree* vg_tree_take(vg_arena* arena, const verge_planner_def* def)
{
    const size_t nodes = def->nodes_max;
    vg_tree* tree = vg_arena_take(arena, sizeof *tree);
    vg_metanode* pool = vg_arena_take(arena, nodes * sizeof *pool);
    const size_t slots = nodes + trail_count * trail_length;
    uint8_t* states = vg_arena_take(arena, slots * state_size(def->vehicles_max, def->controlled_max));
    double* log_of = vg_arena_take(arena, table_size * sizeof *log_of);
    double* inverse_root = vg_arena_take(arena, table_size * sizeof *inverse_root);
    if (tree == NULL || pool == NULL || states == NULL || log_of == NULL || inverse_root == NULL) {
        return NULL;
    }
    *tree = (vg_tree){ def->nodes_max, 0, 0, pool, states, log_of, inverse_root };
    for (uint32_t n = 1; n < table_size; ++n) {
        log_of[n] = vg_log((double)n);
        inverse_root[n] = 1.0 / vg_sqrt((double)n);
    }
    return tree;
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

// Behind the nodes' states stand those of the two trails.
static uint32_t trail_slot(const search* self, uint32_t trail, uint32_t step_index)
{
    return self->tree->nodes_max + trail * trail_length + step_index;
}

static void save(const search* self, uint32_t slot, const vg_flow* flow)
{
    const size_t count = self->scene->count, planned = self->scene->controlled_count;
    uint8_t* to = self->tree->states + (size_t)slot * self->tree->stride;
    to = put(to, flow->station, count * sizeof(float));
    to = put(to, flow->d, count * sizeof(float));
    to = put(to, flow->v, count * sizeof(float));
    to = put(to, flow->credit, planned * sizeof(float));
    to = put(to, flow->driven, planned * sizeof(float));
    to = put(to, flow->previous, planned);
    for (size_t i = 0; i < count; ++i) {
        to[i] = (uint8_t)flow->lane[i];
    }
}

static void load_state(const search* self, uint32_t slot, vg_flow* flow)
{
    const size_t count = self->scene->count, planned = self->scene->controlled_count;
    const uint8_t* from = self->tree->states + (size_t)slot * self->tree->stride;
    from = get(from, flow->station, count * sizeof(float));
    from = get(from, flow->d, count * sizeof(float));
    from = get(from, flow->v, count * sizeof(float));
    from = get(from, flow->credit, planned * sizeof(float));
    from = get(from, flow->driven, planned * sizeof(float));
    from = get(from, flow->previous, planned);
    for (size_t i = 0; i < count; ++i) {
        flow->lane[i] = from[i];
    }
    vg_flow_derive(self->scene, flow);
}

static int32_t new_node(search* self, int32_t parent, const uint8_t* actions, const vg_flow* flow)
{
    vg_tree* tree = self->tree;
    VERGE_ASSERT(tree->count < tree->nodes_max);
    const int32_t at = (int32_t)tree->count++;
    vg_metanode* node = &tree->nodes[at];
    memset(node, 0, sizeof *node);
    node->parent = parent;
    node->first_child = node->next_sibling = none;
    if (parent != none) {
        vg_metanode* above = &tree->nodes[parent];
        memcpy(node->actions, actions, self->scene->controlled_count);
        node->depth = (uint8_t)(above->depth + 1u);
        node->next_sibling = above->first_child;
        above->first_child = at;
    }
    node->terminal = node->depth >= self->scene->def->steps || vg_flow_terminal(self->scene, flow);
    self->report->depth = node->depth > self->report->depth ? node->depth : self->report->depth;
    save(self, (uint32_t)at, flow);
    return at;
}

// ---------------------------------------------------------------------------- run

void vg_search_run(vg_tree* tree, const vg_model* scene, const vg_flow* root, vg_random* random,
                   const vg_joint_actions* warm, vg_joint_actions* line, verge_search_report* report)
{
    const verge_planner_def* def = scene->def;
    memset(report, 0, sizeof *report);
    tree->count = 0;
    tree->stride = state_size(scene->count, scene->controlled_count);
    search self = { .tree = tree, .scene = scene, .random = random, .best_reward = -1.0,
                    .report = report };
    self.flow = &self.buffer[0];
    self.next = &self.buffer[1];
    self.buffer[0] = self.buffer[1] = *root;
    memset(&self.moves, 0, sizeof self.moves);
    (void)new_node(&self, none, NULL, root);

    const bool best = def->search == VERGE_SEARCH_BEST;
    const uint32_t budget = def->iterations;
    double warm_reward = -1.0;
    vg_joint_actions kept = { .step_count = 0 };
    if (best && warm != NULL) {
        (void)simulate_line(&self, 0, warm);
        warm_reward = self.best_reward; // -1 where the line failed on the way: nothing to keep
        kept = self.best;
    }
    const uint32_t left = budget - (self.report->iterations < budget ? self.report->iterations : budget);
    search_tree(&self, best ? left / tree_part : left);
    if (best) {
        polish(&self, budget - self.report->iterations);
        if (warm_reward >= 0.0
            && self.best_reward < warm_reward + def->switch_margin * switched(&self, &kept)) {
            self.best = kept;
        }
    }
    replay(&self, &self.best);
    *line = self.line;
    report->nodes = tree->count;
    report->bound = vg_flow_bound(scene, root);
}

// Share of X_flow that belongs to those whose lane changes are others than in the line kept: to
// drive a little faster or slower than said is no change of mind. [1]
static double switched(const search* self, const vg_joint_actions* kept)
{
    double sum = 0.0;
    for (uint32_t i = 0; i < self->scene->controlled_count; ++i) {
        bool same = true;
        for (uint32_t t = 0; t < self->scene->def->steps; ++t) {
            same = same && vg_actions[wish_of(kept, t, i)].across
                               == vg_actions[wish_of(&self->best, t, i)].across;
        }
        sum += same ? 0.0 : (double)self->scene->weight[i];
    }
    return sum;
}

// The share of the budget of step t is 1/(t/2 + 1), as in the program of the paper's authors; the
// rest goes to step 0.
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
    int32_t best = none;
    double best_mean = -1.0;
    uint32_t best_visits = 0;
    for (int32_t c = tree->nodes[node].first_child; c != none; c = tree->nodes[c].next_sibling) {
        const vg_metanode* child = &tree->nodes[c];
        if (child->mean > best_mean || (child->mean == best_mean && child->visits > best_visits)) {
            best = c;
            best_mean = child->mean;
            best_visits = child->visits;
        }
    }
    return best;
}

// The root goes down with the decision: every step is searched from the child chosen before.
static void search_tree(search* self, uint32_t budget)
{
    const uint32_t steps = self->scene->def->steps;
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
        if (child != none) {
            memcpy(committed.actions[committed.step_count++], self->tree->nodes[child].actions,
                   self->scene->controlled_count);
            root = child;
        }
    }
    if (self->scene->def->search == VERGE_SEARCH_PAPER || self->best_reward < 0.0) {
        self->best = committed;
    }
}

// ---------------------------------------------------------------------------- one iteration

static double log_of(const vg_tree* tree, uint32_t n)
{
    return n < table_size ? tree->log_of[n] : vg_log((double)n);
}

// Eq. 1.
static int32_t uct_child(const search* self, const vg_metanode* node)
{
    const vg_tree* tree = self->tree;
    const double scale = 2.0 * self->scene->def->exploration
                         * vg_sqrt(2.0 * log_of(tree, node->visits > 0 ? node->visits : 1));
    int32_t best = none;
    double best_value = -1.0;
    for (int32_t c = node->first_child; c != none; c = tree->nodes[c].next_sibling) {
        const vg_metanode* child = &tree->nodes[c];
        const uint32_t n = child->visits;
        const double root = n < table_size ? tree->inverse_root[n] : 1.0 / vg_sqrt((double)n);
        const double value = child->mean + scale * root;
        if (value > best_value) {
            best = c;
            best_value = value;
        }
    }
    return best;
}

// A table for half of the actions: a population count is not an instruction of every machine.
static uint32_t size_of(uint8_t set)
{
    static const uint8_t sizes[16] = { 0, 1, 1, 2, 1, 2, 2, 3, 1, 2, 2, 3, 2, 3, 3, 4 };
    return (uint32_t)sizes[set & 15u] + sizes[set >> 4];
}
static_assert(VERGE_ACTION_COUNT <= 8, "sets of actions are bytes");

static uint8_t member_of(uint8_t set, uint32_t index)
{
    for (; index > 0; --index) {
        set = (uint8_t)(set & (set - 1u));
    }
    return (uint8_t)__builtin_ctz(set);
}

// Starts the walk over a node's joint actions: any stride without the factors 2, 3 and 5 is
// coprime to a product of set sizes up to 5, so the walk meets each joint action once.
static void open_node(search* self, vg_metanode* node)
{
    uint64_t product = 1;
    for (uint32_t i = 0; i < self->scene->controlled_count; ++i) {
        product *= size_of(self->moves.legal[i]);
    }
    uint32_t stride = vg_random_next(self->random); // large: every vehicle's digit changes soon
    while (stride % 2u == 0 || stride % 3u == 0 || stride % 5u == 0) {
        ++stride;
    }
    node->opened = 1;
    node->joint_left = product;
    node->joint_at = vg_random_next(self->random) % product;
    node->joint_stride = stride;
}

static void decode(const search* self, uint64_t number, uint8_t* actions)
{
    for (uint32_t i = 0; i < self->scene->controlled_count; ++i) {
        const uint64_t size = size_of(self->moves.legal[i]);
        actions[i] = member_of(self->moves.legal[i], (uint32_t)(number % size));
        number /= size;
    }
}

// The next joint action of this node that has no conflict; false: none found this time.
static bool next_joint_action(search* self, vg_metanode* node, uint8_t* actions)
{
    uint64_t product = 1;
    for (uint32_t i = 0; i < self->scene->controlled_count; ++i) {
        product *= size_of(self->moves.legal[i]);
    }
    for (uint32_t tries = 0; tries < joint_tries_max && node->joint_left > 0; ++tries) {
        decode(self, node->joint_at, actions);
        node->joint_at = (node->joint_at + node->joint_stride) % product;
        node->joint_left--;
        if (vg_flow_conflicts(self->scene, self->flow, &self->moves, actions) == 0) {
            return true;
        }
        self->report->pruned++;
    }
    return false;
}

// Is the action legal? Looks into the other lane if that was left for later.
static bool legal(search* self, uint32_t slot, uint8_t action)
{
    return ((self->moves.legal[slot] >> action) & 1u) != 0
           || (((self->moves.unchecked[slot] >> action) & 1u) != 0
               && vg_flow_check_change(self->scene, self->flow, &self->moves, slot, action));
}

// Uniform over the legal set: what proves illegal is drawn again.
static void draw(search* self, uint8_t* actions, uint32_t which)
{
    for (uint32_t i = 0; i < self->scene->controlled_count; ++i) {
        for (uint32_t tries = 0; ((which >> i) & 1u) != 0 && tries <= VERGE_ACTION_COUNT; ++tries) {
            const uint8_t set = self->moves.legal[i] | self->moves.unchecked[i];
            actions[i] = member_of(set, vg_random_below(self->random, size_of(set)));
            if (legal(self, i, actions[i])) {
                break;
            }
        }
    }
}

// Draws again for the vehicles in conflict, a few times.
static bool repair(search* self, uint8_t* actions)
{
    for (uint32_t tries = 0; tries < repair_tries_max; ++tries) {
        const uint32_t conflicts =
            vg_flow_conflicts(self->scene, self->flow, &self->moves, actions);
        if (conflicts == 0) {
            return true;
        }
        draw(self, actions, conflicts);
    }
    return vg_flow_conflicts(self->scene, self->flow, &self->moves, actions) == 0;
}

// The flow moves on by these actions, which are noted in the line.
static void step(search* self, const uint8_t* actions)
{
    memcpy(self->line.actions[self->line.step_count++], actions, self->scene->controlled_count);
    vg_flow_advance(self->scene, self->flow, &self->moves, actions, self->next);
    vg_flow* after = self->next;
    self->next = self->flow;
    self->flow = after;
}

static bool over(const search* self)
{
    return self->line.step_count >= self->scene->def->steps
           || vg_flow_terminal(self->scene, self->flow);
}

static uint32_t missing(const search* self)
{
    uint32_t set = 0;
    for (uint32_t i = 0; i < self->scene->controlled_count; ++i) {
        const bool there = self->scene->target[i] < 0 || vg_flow_in_target(self->scene, self->flow, i);
        set |= there ? 0u : 1u << i;
    }
    return set;
}

// The simulation's end: its reward, and the plan to keep if none was better.
static double finish(search* self, bool whole)
{
    const double reward =
        vg_flow_reward(self->scene, self->flow, self->line.step_count, whole);
    self->report->iterations++;
    if (whole && reward > self->best_reward) {
        self->best = self->line;
        self->best_reward = reward;
        self->missing = missing(self);
        self->report->nodes_first = self->tree->count;
    }
    return reward;
}

// Default policy: uniform over each vehicle's legal actions, until the horizon or all is done.
static double simulate(search* self)
{
    while (!over(self)) {
        uint8_t actions[VERGE_CONTROLLED_MAX];
        vg_flow_moves_unchecked(self->scene, self->flow, &self->moves);
        draw(self, actions, ~0u);
        if (!repair(self, actions)) {
            return finish(self, false);
        }
        step(self, actions);
    }
    return finish(self, true);
}

static int32_t descend(search* self, int32_t root)
{
    const vg_tree* tree = self->tree;
    int32_t at = root;
    for (uint32_t layer = 0; layer <= VERGE_STEPS_MAX; ++layer) {
        const vg_metanode* node = &tree->nodes[at];
        if (node->terminal || !node->opened || node->joint_left > 0 || node->first_child == none) {
            break;
        }
        at = uct_child(self, node);
    }
    return at;
}

// Actions on the way from the very first root to a node.
static void trace(search* self, int32_t node)
{
    const vg_tree* tree = self->tree;
    self->line.step_count = tree->nodes[node].depth;
    for (int32_t at = node; tree->nodes[at].parent != none; at = tree->nodes[at].parent) {
        memcpy(self->line.actions[tree->nodes[at].depth - 1u], tree->nodes[at].actions,
               self->scene->controlled_count);
    }
}

static void iterate(search* self, int32_t root)
{
    int32_t at = descend(self, root);
    vg_metanode* node = &self->tree->nodes[at];
    load_state(self, (uint32_t)at, self->flow);
    trace(self, at);
    if (!node->terminal) {
        uint8_t actions[VERGE_CONTROLLED_MAX];
        vg_flow_moves(self->scene, self->flow, &self->moves);
        if (!node->opened) {
            open_node(self, node);
        }
        if (self->tree->count == self->tree->nodes_max) {
            self->report->unexpanded += node->joint_left > 0 ? 1u : 0u;
        } else if (next_joint_action(self, node, actions)) {
            step(self, actions);
            at = new_node(self, at, actions, self->flow);
        }
    }
    const double reward = simulate(self);
    for (; at != none; at = self->tree->nodes[at].parent) {
        vg_metanode* node = &self->tree->nodes[at];
        node->visits++;
        node->mean += (reward - node->mean) / (double)node->visits;
    }
}

// ---------------------------------------------------------------------------- polish

// What is legal and nearest to the wish: the wish, else KS, DC, AC.
static uint8_t nearest_legal(search* self, uint32_t slot, uint8_t wish)
{
    const uint8_t order[] = { wish, VERGE_KEEP_SPEED, VERGE_DECELERATE, VERGE_ACCELERATE };
    for (uint32_t k = 0; k < sizeof order; ++k) {
        if (legal(self, slot, order[k])) {
            return order[k];
        }
    }
    return VERGE_KEEP_SPEED; // not reached: something in the lane is always legal
}

static uint8_t wish_of(const vg_joint_actions* wish, uint32_t step_index, uint32_t slot)
{
    return step_index < wish->step_count ? wish->actions[step_index][slot]
                                         : (uint8_t)VERGE_KEEP_SPEED;
}

// One step of a plan, as near to the wish as the rules allow. False: it cannot go on.
static bool follow(search* self, const vg_joint_actions* wish)
{
    uint8_t actions[VERGE_CONTROLLED_MAX];
    vg_flow_moves_unchecked(self->scene, self->flow, &self->moves);
    for (uint32_t i = 0; i < self->scene->controlled_count; ++i) {
        actions[i] = nearest_legal(self, i, wish_of(wish, self->line.step_count, i));
    }
    if (!repair(self, actions)) {
        return false;
    }
    step(self, actions);
    return true;
}

// A whole plan: up to step `from` the best one's, whose states are at hand, then the wish's.
static double simulate_line(search* self, uint32_t from, const vg_joint_actions* wish)
{
    const uint32_t own = 1u - self->trail;
    const double before = self->best_reward;
    load_state(self, from == 0 ? 0u : trail_slot(self, self->trail, from), self->flow);
    self->line = self->best;
    self->line.step_count = from;
    while (!over(self)) {
        if (!follow(self, wish)) {
            return finish(self, false);
        }
        save(self, trail_slot(self, own, self->line.step_count), self->flow);
    }
    const double reward = finish(self, true);
    if (self->best_reward > before) { // the new best: its trail begins as the old one's did
        const size_t stride = self->tree->stride;
        memcpy(self->tree->states + trail_slot(self, own, 0) * stride,
               self->tree->states + trail_slot(self, self->trail, 0) * stride,
               (size_t)(from + 1u) * stride);
        self->trail = own;
    }
    return reward;
}

// Puts the states along the best plan, found in the tree, on its trail.
static void retrace(search* self)
{
    load_state(self, 0, self->flow);
    self->line.step_count = 0;
    while (self->line.step_count < self->best.step_count && follow(self, &self->best)) {
        save(self, trail_slot(self, self->trail, self->line.step_count), self->flow);
    }
    self->best.step_count = self->line.step_count;
}

// One vehicle does one thing over one stretch of steps. Returns the first step.
static uint32_t vary_run(search* self, vg_joint_actions* line, uint32_t slot)
{
    const uint32_t steps = self->scene->def->steps;
    const uint32_t from = vg_random_below(self->random, steps);
    const uint32_t length = 1u + vg_random_below(self->random, steps - from);
    const uint8_t action = (uint8_t)vg_random_below(self->random, VERGE_ACTION_COUNT);
    for (uint32_t t = from; t < from + length; ++t) {
        line->actions[t][slot] = action;
    }
    return from;
}

// One vehicle changes lane at some step, after a run of one thing and before another.
static uint32_t vary_change(search* self, vg_joint_actions* line, uint32_t slot)
{
    const uint32_t steps = self->scene->def->steps;
    const uint32_t at = vg_random_below(self->random, steps - 1u);
    const uint32_t from = at > 0 ? vg_random_below(self->random, at) : 0u;
    const uint8_t before = (uint8_t)vg_random_below(self->random, VERGE_CHANGE_LEFT);
    const uint8_t after = (uint8_t)vg_random_below(self->random, VERGE_CHANGE_LEFT);
    const uint8_t change = self->way[slot] > 0 ? VERGE_CHANGE_LEFT : VERGE_CHANGE_RIGHT;
    for (uint32_t t = from; t < steps; ++t) {
        line->actions[t][slot] = t < at ? before : t < at + 2u ? change : after;
    }
    return from;
}

static uint32_t fewer(uint32_t a, uint32_t b)
{
    return a < b ? a : b;
}

static uint32_t count_of(uint32_t set)
{
    uint32_t count = 0;
    for (; set != 0; set &= set - 1u) {
        ++count;
    }
    return count;
}

// Half of the time one of those that do not arrive yet, else anyone.
static uint32_t whom(search* self)
{
    if (self->missing == 0 || vg_random_below(self->random, 2) == 0) {
        return vg_random_below(self->random, self->scene->controlled_count);
    }
    uint32_t set = self->missing;
    for (uint32_t k = vg_random_below(self->random, (uint32_t)count_of(set)); k > 0; --k) {
        set &= set - 1u;
    }
    return (uint32_t)__builtin_ctz(set);
}

// A random variation; a quarter of them let a second vehicle make way. Returns the first step.
static uint32_t mutate(search* self, vg_joint_actions* line)
{
    const uint32_t count = self->scene->controlled_count;
    const uint32_t slot = whom(self);
    const uint32_t kind = vg_random_below(self->random, 8);
    if (kind < 4u || self->way[slot] == 0) {
        return vary_run(self, line, slot);
    }
    uint32_t from = vary_change(self, line, slot);
    if (kind >= 6u && count > 1u) {
        const uint32_t other = (slot + 1u + vg_random_below(self->random, count - 1u)) % count;
        from = fewer(from, vary_run(self, line, other));
    }
    return from;
}

// The k-th of the plain variations: one vehicle does one thing from a step on to the end.
static uint32_t vary(const search* self, uint32_t k, vg_joint_actions* line)
{
    const uint32_t steps = self->scene->def->steps;
    const uint32_t action = k % VERGE_ACTION_COUNT;
    const uint32_t from = k / VERGE_ACTION_COUNT % steps;
    const uint32_t slot = k / VERGE_ACTION_COUNT / steps;
    for (uint32_t t = from; t < steps; ++t) {
        line->actions[t][slot] = (uint8_t)action;
    }
    return from;
}

static void find_ways(search* self)
{
    const verge_road* road = self->scene->road;
    load_state(self, 0, self->flow);
    for (uint32_t i = 0; i < self->scene->controlled_count; ++i) {
        const int32_t target = self->scene->target[i];
        const uint32_t lane = (uint32_t)self->flow->lane[i];
        self->way[i] = target < 0 ? 0 : (int8_t)vg_road_turn(road, lane, (uint32_t)target);
    }
}

// First all plain variations, as far as a third of the budget reaches, then random ones.
static void polish(search* self, uint32_t budget)
{
    const uint32_t steps = self->scene->def->steps;
    const uint32_t plain =
        fewer(budget / 3u, self->scene->controlled_count * steps * VERGE_ACTION_COUNT);
    find_ways(self);
    retrace(self);
    for (uint32_t k = 0; k < budget; ++k) {
        vg_joint_actions line = self->best;
        for (uint32_t t = line.step_count; t < steps; ++t) {
            memset(line.actions[t], VERGE_KEEP_SPEED, sizeof line.actions[t]);
        }
        line.step_count = steps;
        uint32_t from = k < plain ? vary(self, k, &line) : mutate(self, &line);
        if (k >= plain && k % 4u == 3u) {
            from = fewer(from, mutate(self, &line));
        }
        (void)simulate_line(self, fewer(from, self->best.step_count), &line);
    }
}

// ---------------------------------------------------------------------------- the answer

// The plan step by step, to the horizon: a line that ended early is driven on as it is.
static void replay(search* self, const vg_joint_actions* line)
{
    const vg_model* scene = self->scene;
    load_state(self, 0, self->flow);
    self->line.step_count = 0;
    bool ended_early = false;
    for (uint32_t t = 0; t < scene->def->steps; ++t) {
        uint8_t actions[VERGE_CONTROLLED_MAX];
        vg_flow_moves(scene, self->flow, &self->moves);
        for (uint32_t i = 0; i < scene->controlled_count; ++i) {
            actions[i] = nearest_legal(self, i, wish_of(line, t, i));
        }
        if (!ended_early && vg_flow_terminal(scene, self->flow)) {
            ended_early = true;
            self->report->reward = vg_flow_reward(scene, self->flow, t, true);
        }
        step(self, actions);
    }
    // Where no simulation went without a conflict, what is returned ends as badly as they did.
    const bool whole = self->best_reward >= 0.0;
    if (!ended_early) {
        self->report->reward = vg_flow_reward(scene, self->flow, self->line.step_count, whole);
    }
    self->report->complete = whole;
    for (uint32_t i = 0; i < scene->controlled_count; ++i) {
        self->report->complete = self->report->complete
                                 && (scene->target[i] < 0
                                     || vg_flow_in_target(scene, self->flow, i));
    }
}
