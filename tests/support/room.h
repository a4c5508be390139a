/// Paths and batches with static memory of their own, for the most they can hold.
#ifndef TEST_ROOM_H
#define TEST_ROOM_H

#include "motion/batch.h"
#include "motion/path.h"

enum { TEST_CANDIDATES = VERGE_SAMPLE_SPEEDS_MAX * VERGE_SAMPLE_OFFSETS_MAX };

#define TEST_PATH(name)                                                                          \
    static double name##_room[6][VG_PATH_KNOTS_MAX];                                             \
    static vg_path name = { .knots_max = VG_PATH_KNOTS_MAX,                                      \
                            .x = name##_room[0], .y = name##_room[1],                            \
                            .xss = name##_room[2], .yss = name##_room[3],                        \
                            .h = name##_room[4], .work = name##_room[5] }

#define TEST_BATCH(name)                                                                         \
    static vg_leg  name##_legs[VERGE_SAMPLE_SPEEDS_MAX];                                         \
    static double  name##_room[4][TEST_CANDIDATES];                                              \
    static uint8_t name##_marks[TEST_CANDIDATES];                                                \
    static vg_batch name = { .legs = name##_legs, .offsets = name##_room[0],                     \
                             .leg_penalties = name##_room[1], .offset_penalties = name##_room[2], \
                             .costs = name##_room[3], .marks = name##_marks }

#endif
