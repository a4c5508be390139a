/// The baseline "Sequential MCTS" of the paper's section 4.1, for one vehicle: its own UCT, with
/// the vehicles decided before it and the humans as moving obstacles.
///
/// Model       A straight frame: s [m] along the road, y [m] to the left. Acceleration is one of
///             {-1, 0, 1} m/s^2, lateral velocity one of {-1.2, 0, 1.2} m/s, for a whole step.
///             Acceleration stops at standstill and at the speed limit.
/// Search      UCT (Eq. 1) over single actions. The root moves down with the decision, and the
///             budget is split over the steps as 1/(t/2 + 1), as in the joint search. The two
///             searches differ only in the vehicles that are decided together. The plan is the
///             child of greatest mean at each layer.
/// Reward      R_i with the three parts of the joint search: the end near the target's centre, the
///             share of steps near it (times the pace), the share of steps that repeat the action
///             before. A simulation that meets an obstacle ends; its remaining steps have reward 0.
/// Contact     Bodies with a clearance of SEQUENTIAL_AIR, tested every SEQUENTIAL_SAMPLE_S.
/// Source      Written from the text of the paper; choices that it leaves open are stated here.
#ifndef VERGE_EXPERIMENT_SEQUENTIAL_H
#define VERGE_EXPERIMENT_SEQUENTIAL_H

#include <stdbool.h>
#include <stdint.h>

#define SEQUENTIAL_SAMPLE_S 0.5    ///< [s] steps are multiples of it
#define SEQUENTIAL_AIR_ALONG 1.0   ///< [m] as the joint search keeps between planned vehicles
#define SEQUENTIAL_AIR_ACROSS 0.3  ///< [m]
enum {
    SEQUENTIAL_STEPS_MAX = 16,
    SEQUENTIAL_SAMPLES_MAX = 64,
    SEQUENTIAL_ACTIONS = 9, ///< 3 * (longitudinal + 1) + lateral + 1
};

/// An obstacle: its positions at multiples of SEQUENTIAL_SAMPLE_S.
typedef struct sequential_obstacle {
    double half_length, half_width;    ///< [m]
    double s[SEQUENTIAL_SAMPLES_MAX];  ///< [m]
    double y[SEQUENTIAL_SAMPLES_MAX];  ///< [m]
} sequential_obstacle;

typedef struct sequential_problem {
    double   s, y, v;                  ///< [m], [m], [m/s] of the vehicle now
    double   half_length, half_width;  ///< [m]
    double   target_y;                 ///< [m] centre of its target lane
    double   y_min, y_max;             ///< [m] where its centre may be
    double   speed_limit;              ///< [m/s]
    double   cruise;                   ///< [m/s] below it a step earns in proportion
    double   step_s;                   ///< [s]
    uint32_t steps;                    ///< at most SEQUENTIAL_STEPS_MAX
    double   exploration;              ///< [1] C_p of Eq. 1
    double   reward_target, reward_lane, reward_consistency; ///< [1]
    uint32_t iterations;
    uint64_t seed;
    const sequential_obstacle* obstacles;
    uint32_t obstacle_count;
} sequential_problem;

typedef struct sequential_state {
    double s, y, v;
} sequential_state;

typedef struct sequential_plan {
    sequential_state states[SEQUENTIAL_STEPS_MAX + 1]; ///< 0: now
    uint8_t  actions[SEQUENTIAL_STEPS_MAX];
    double   reward;      ///< [1] R_i
    bool     blocked;     ///< from some step on every action found meets an obstacle: it brakes
    uint32_t nodes;       ///< created
    uint32_t nodes_first; ///< created until all nodes of the plan were there
} sequential_plan;

double sequential_acceleration(uint8_t action); ///< [m/s^2]
double sequential_lateral(uint8_t action);      ///< [m/s]

/// The state t [s] into a step.
sequential_state sequential_move(const sequential_problem* problem, const sequential_state* from,
                                 uint8_t action, double t);
/// True: the action, taken in this step, meets an obstacle or leaves the road.
bool sequential_refused(const sequential_problem* problem, const sequential_state* from,
                        uint32_t step, uint8_t action);

/// False: out of memory.
bool sequential_search(const sequential_problem* problem, sequential_plan* plan);

#endif
