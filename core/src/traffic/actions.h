/// The properties of the actions: one row for each action of Table 1. A new action needs a new row
/// here and a new name in verge_action. Static assertions name the other places that depend on the
/// set of actions.
#ifndef VG_ACTIONS_H
#define VG_ACTIONS_H

#include "verge/types.h"

#include <assert.h>

#ifdef __cplusplus
extern "C" {
#endif

/// Motion along the lane during one decision step; also the index of its state in vg_moves.
/// A lane change keeps the speed in the paper; it has motions of its own because BEST adapts it.
typedef enum vg_along {
    VG_KEEP_SPEED,
    VG_SPEED_UP,
    VG_SLOW_DOWN,
    VG_ALONG_LEFT,
    VG_ALONG_RIGHT,
    VG_ALONG_COUNT
} vg_along;
/// Motion across the lane; also the index of its state in vg_moves.
typedef enum vg_across { VG_KEEP_LANE, VG_TO_LEFT, VG_TO_RIGHT, VG_ACROSS_COUNT } vg_across;

typedef struct vg_action_row {
    const char* name;        ///< as in the paper, in JSON and in the log
    const char* words;       ///< in plain English
    uint8_t     along;       ///< vg_along
    uint8_t     across;      ///< vg_across
    int8_t      turn_signal; ///< +1 left, -1 right, 0 none
    bool        brake_light;
} vg_action_row;

extern const vg_action_row vg_actions[VERGE_ACTION_COUNT];

/// The actions that keep the lane.
enum { VG_LANE_KEEPING_COUNT = 3 };
extern const uint8_t vg_lane_keeping[VG_LANE_KEEPING_COUNT];
static_assert(VG_LANE_KEEPING_COUNT + 2 == VERGE_ACTION_COUNT,
              "vg_lane_keeping lists all actions that keep the lane");

static inline bool vg_action_changes_lane(uint32_t action)
{
    return vg_actions[action].across != VG_KEEP_LANE;
}

#ifdef __cplusplus
}
#endif

#endif
