/// See sequential.h.
#include "sequential.h"

#include "base/random.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

enum { none = -1, brake = 1 }; // brake: -1 m/s^2, straight on

/// Largest |d| of a vehicle that has reached its target, as in the joint search. [m]
static const double reached_offset = 0.5;

typedef struct node {
    sequential_state state;
    double   credit;     // of lane and consistency parts so far
    double   mean;
    uint32_t visits;
    uint32_t step;       // decided before this state
    int32_t  parent;
    int32_t  children[SEQUENTIAL_ACTIONS];
    uint16_t untried;    // set of actions
    uint8_t  previous;   // action that led here; SEQUENTIAL_ACTIONS: none
    bool     opened;
} node;

typedef struct search {
    const sequential_problem* problem;
    node*     nodes;
    uint32_t  count;
    vg_random random;
} search;

static void     advance(const sequential_problem* problem, node* at, uint8_t action);
static uint32_t share_of(const sequential_problem* problem, uint32_t step);
static void     iterate(search* self, int32_t root);
static double   simulate(search* self, node state);
static int32_t  greedy(const search* self, int32_t root);
static void     note(const search* self, int32_t root, sequential_plan* plan);

double sequential_acceleration(uint8_t action)
{
    return (double)(action / 3) - 1.0;
}

double sequential_lateral(uint8_t action)
{
    return 1.2 * ((double)(action % 3) - 1.0);
}

sequential_state sequential_move(const sequential_problem* problem, const sequential_state* from,
                                 uint8_t action, double t)
{
    const double a = sequential_acceleration(action);
    const double end = from->v + a * t;
    // Accelerate until the limit of the speed, then continue at that speed.
    const double bound = a < 0.0 ? 0.0 : fmax(problem->speed_limit, from->v);
    const bool   held = a < 0.0 ? end < bound : a > 0.0 && end > bound;
    const double until = held ? (bound - from->v) / a : t;
    const double v = held ? bound : end;
    return (sequential_state){ .s = from->s + 0.5 * (from->v + v) * until + v * (t - until),
                               .y = from->y + sequential_lateral(action) * t,
                               .v = v };
}

bool sequential_refused(const sequential_problem* problem, const sequential_state* from,
                        uint32_t step, uint8_t action)
{
    const uint32_t samples = (uint32_t)lround(problem->step_s / SEQUENTIAL_SAMPLE_S);
    for (uint32_t k = 1; k <= samples; ++k) {
        const sequential_state at =
            sequential_move(problem, from, action, (double)k * SEQUENTIAL_SAMPLE_S);
        if (at.y < problem->y_min || at.y > problem->y_max) {
            return true;
        }
        const uint32_t sample = step * samples + k;
        for (uint32_t i = 0; i < problem->obstacle_count; ++i) {
            const sequential_obstacle* other = &problem->obstacles[i];
            const double along =
                problem->half_length + other->half_length + SEQUENTIAL_AIR_ALONG;
            const double across =
                problem->half_width + other->half_width + SEQUENTIAL_AIR_ACROSS;
            if (fabs(other->s[sample] - at.s) < along && fabs(other->y[sample] - at.y) < across) {
                return true;
            }
        }
    }
    return false;
}

bool sequential_search(const sequential_problem* problem, sequential_plan* plan)
{
    search self = { .problem = problem,
                    .nodes = malloc(((size_t)problem->iterations + 1) * sizeof *self.nodes),
                    .count = 1,
                    .random = vg_random_from(problem->seed, 11) };
    if (self.nodes == NULL) {
        return false;
    }
    self.nodes[0] = (node){ .state = { problem->s, problem->y, problem->v }, .parent = none,
                            .previous = SEQUENTIAL_ACTIONS };
    uint32_t spent = 0;
    for (uint32_t t = 0; t < problem->steps; ++t) {
        spent += share_of(problem, t);
    }
    int32_t root = 0;
    for (uint32_t t = 0; t < problem->steps && root != none; ++t) {
        const uint32_t rest = t == 0 ? problem->iterations - spent : 0;
        for (uint32_t k = 0; k < share_of(problem, t) + rest; ++k) {
            iterate(&self, root);
        }
        const int32_t next = greedy(&self, root);
        if (next == none) {
            break;
        }
        root = next;
    }
    note(&self, root, plan);
    free(self.nodes);
    return true;
}

/// Simulates one step and adds its reward.
static void advance(const sequential_problem* problem, node* at, uint8_t action)
{
    const double share = 1.0 / (double)problem->steps;
    at->state = sequential_move(problem, &at->state, action, problem->step_s);
    if (fabs(at->state.y - problem->target_y) <= reached_offset) {
        at->credit += problem->reward_lane * share * fmin(at->state.v / problem->cruise, 1.0);
    }
    if (action == at->previous || at->previous == SEQUENTIAL_ACTIONS) {
        at->credit += problem->reward_consistency * share;
    }
    at->previous = action;
    ++at->step;
}

static uint32_t share_of(const sequential_problem* problem, uint32_t step)
{
    double sum = 0.0;
    for (uint32_t t = 0; t < problem->steps; ++t) {
        sum += 2.0 / (double)(t + 2);
    }
    return (uint32_t)((double)problem->iterations * (2.0 / (double)(step + 2)) / sum);
}

/// The actions that are not refused, determined once for each node.
static void open_node(const search* self, node* at)
{
    at->opened = true;
    for (uint8_t action = 0; action < SEQUENTIAL_ACTIONS; ++action) {
        at->children[action] = none;
        if (!sequential_refused(self->problem, &at->state, at->step, action)) {
            at->untried = (uint16_t)(at->untried | (1u << action));
        }
    }
}

static uint8_t draw(search* self, uint16_t set)
{
    uint32_t index = vg_random_below(&self->random, (uint32_t)__builtin_popcount(set));
    for (; index > 0; --index) {
        set = (uint16_t)(set & (set - 1u));
    }
    return (uint8_t)__builtin_ctz(set);
}

/// Eq. 1.
static int32_t uct_child(const search* self, const node* at)
{
    const double scale = 2.0 * self->problem->exploration * sqrt(2.0 * log((double)at->visits));
    int32_t best = none;
    double  best_value = -1.0;
    for (uint8_t action = 0; action < SEQUENTIAL_ACTIONS; ++action) {
        const int32_t c = at->children[action];
        if (c == none) {
            continue;
        }
        const node*  child = &self->nodes[c];
        const double value = child->mean + scale / sqrt((double)child->visits);
        if (value > best_value) {
            best = c;
            best_value = value;
        }
    }
    return best;
}

static void iterate(search* self, int32_t root)
{
    const uint32_t steps = self->problem->steps;
    int32_t at = root;
    for (;;) {
        node* here = &self->nodes[at];
        if (here->step == steps) {
            break;
        }
        if (!here->opened) {
            open_node(self, here);
        }
        if (here->untried != 0) {
            const uint8_t action = draw(self, here->untried);
            here->untried = (uint16_t)(here->untried & ~(1u << action));
            node child = *here;
            child.parent = at;
            child.visits = 0;
            child.mean = 0.0;
            child.untried = 0;
            child.opened = false;
            advance(self->problem, &child, action);
            at = here->children[action] = (int32_t)self->count;
            self->nodes[self->count++] = child;
            break;
        }
        const int32_t next = uct_child(self, here);
        if (next == none) {
            break; // every action is refused
        }
        at = next;
    }
    const double reward = simulate(self, self->nodes[at]);
    for (; at != none; at = self->nodes[at].parent) {
        node* here = &self->nodes[at];
        ++here->visits;
        here->mean += (reward - here->mean) / (double)here->visits;
    }
}

/// Default policy: uniform over the actions that are not refused.
static double simulate(search* self, node at)
{
    while (at.step < self->problem->steps) {
        uint16_t set = (1u << SEQUENTIAL_ACTIONS) - 1u;
        uint8_t  action = 0;
        do {
            action = draw(self, set);
            set = (uint16_t)(set & ~(1u << action));
        } while (sequential_refused(self->problem, &at.state, at.step, action) && set != 0);
        if (set == 0 && sequential_refused(self->problem, &at.state, at.step, action)) {
            return at.credit;
        }
        advance(self->problem, &at, action);
    }
    const bool reached = fabs(at.state.y - self->problem->target_y) <= reached_offset;
    return at.credit + (reached ? self->problem->reward_target : 0.0);
}

static int32_t greedy(const search* self, int32_t root)
{
    const node* at = &self->nodes[root];
    int32_t     best = none;
    for (uint8_t action = 0; at->opened && action < SEQUENTIAL_ACTIONS; ++action) {
        const int32_t c = at->children[action];
        if (c != none && (best == none || self->nodes[c].mean > self->nodes[best].mean)) {
            best = c;
        }
    }
    return best;
}

/// The plan from the last root back. Without a child the vehicle brakes in the remaining steps.
static void note(const search* self, int32_t root, sequential_plan* plan)
{
    const sequential_problem* problem = self->problem;
    *plan = (sequential_plan){ .nodes = self->count };
    node last = self->nodes[root];
    plan->blocked = last.step < problem->steps;
    for (int32_t at = root; at != none; at = self->nodes[at].parent) {
        const node* here = &self->nodes[at];
        plan->states[here->step] = here->state;
        if (here->step > 0) {
            plan->actions[here->step - 1] = here->previous;
        }
        if ((uint32_t)at + 1 > plan->nodes_first) {
            plan->nodes_first = (uint32_t)at + 1;
        }
    }
    while (last.step < problem->steps) {
        plan->actions[last.step] = brake;
        advance(problem, &last, brake);
        plan->states[last.step] = last.state;
    }
    const bool reached = fabs(last.state.y - problem->target_y) <= reached_offset;
    plan->reward = last.credit + (reached ? problem->reward_target : 0.0);
}
