/// See actions.h.
#include "traffic/actions.h"

const vg_action_row vg_actions[] = {
    [VERGE_KEEP_SPEED] = { "KS", "keeping lane and speed", VG_KEEP_SPEED, VG_KEEP_LANE, 0, false },
    [VERGE_ACCELERATE] = { "AC", "speeding up", VG_SPEED_UP, VG_KEEP_LANE, 0, false },
    [VERGE_DECELERATE] = { "DC", "slowing down", VG_SLOW_DOWN, VG_KEEP_LANE, 0, true },
    [VERGE_CHANGE_LEFT] = { "LCL", "changing to the left lane", VG_ALONG_LEFT, VG_TO_LEFT, 1,
                            false },
    [VERGE_CHANGE_RIGHT] = { "LCR", "changing to the right lane", VG_ALONG_RIGHT, VG_TO_RIGHT, -1,
                             false },
};
static_assert(sizeof vg_actions / sizeof vg_actions[0] == VERGE_ACTION_COUNT,
              "one row for each action");

const uint8_t vg_lane_keeping[VG_LANE_KEEPING_COUNT] = { VERGE_KEEP_SPEED, VERGE_ACCELERATE,
                                                         VERGE_DECELERATE };
