/// The time that a vehicle still needs from a place on the road (its value-to-go): to its target
/// lane and on, at the speeds that the road allows, alone. The search adds it to the time already
/// driven, so what lies beyond its horizon counts: exits, ends of lanes, turns.
///
/// For each controlled vehicle a table covers the lanes it can reach within VG_VALUE_REACH. The
/// time is defined by dynamic programming, backwards from the ends of the covered lanes:
///
///     time(lane, s) = min( step / speed + time(lane, s + step),               keep the lane
///                          length / speed + cost + time(beside, s + length) ) change it
///
/// The cost of a change grows where little of the stretch is left in which the change is allowed,
/// so a vehicle changes early where it has to. A lane from which the target cannot be reached, and
/// a lane that ends beside others, cost VG_VALUE_DEAD_END at their ends. The road beyond the reach
/// counts by the number of lane changes to the target. All vehicles take one continuation of a
/// lane, that of their route.
///
/// The tables depend on the scene only. Their work and memory are bounded by VG_VALUE_LANES and
/// VG_VALUE_NODES for each vehicle, whatever the size of the road.
#ifndef VG_VALUE_H
#define VG_VALUE_H

#include "traffic/flow.h"

#ifdef __cplusplus
extern "C" {
#endif

#define VG_VALUE_REACH 2000.0    ///< [m] ahead of the vehicle
#define VG_VALUE_DEAD_END 60.0f  ///< [s] lost where a lane ends, or leads away from the target
#define VG_VALUE_CHANGE 1.0f     ///< [s] cost of a lane change
enum { VG_VALUE_LANES = 32, VG_VALUE_NODES = 2048 };

/// The nodes of one lane, at station_end - (node_count - 1 - k) * spacing.
typedef struct vg_value_lane {
    uint32_t lane;                ///< index
    uint32_t first, node_count;   ///< its part of vg_value_table.time, at least 2 nodes
    float    station_end;         ///< [m] of the last node
    float    begins_at;           ///< [m] from the vehicle to the start of the lane
    float    end_time;            ///< [s] at the last node where the lane does not go on
    int32_t  continued;           ///< entry of the lane that continues it, -1: not covered
} vg_value_lane;

typedef struct vg_value_table {
    uint32_t lane_count;
    float    spacing;             ///< [m] of the nodes
    bool     unreachable;         ///< the target cannot be reached from here: all lanes count
    vg_value_lane lanes[VG_VALUE_LANES];
    float    time[VG_VALUE_NODES];///< [s]
} vg_value_table;

struct vg_value {
    uint32_t lane_count, tables_max;
    uint8_t* entry;               ///< [tables_max][lane_count] entry of a lane, VG_VALUE_NONE
    vg_value_table* tables;       ///< [tables_max] by slot
};
enum { VG_VALUE_NONE = 255 };
typedef struct vg_value vg_value;

/// Takes memory for the tables of controlled_max vehicles on a road of lane_count lanes. Null: it
/// does not fit, or the arena is measuring.
vg_value* vg_value_take(vg_arena* arena, uint32_t controlled_max, uint32_t lane_count);

/// Fills the tables of all controlled vehicles of a scene, and lets the model use them.
void vg_value_fill(vg_value* value, vg_model* model, const vg_flow* flow);

/// Time to go of a vehicle at a station of a lane, between the nodes linear. Lanes that the table
/// does not cover lead nowhere: VG_VALUE_DEAD_END more than the reach takes. [s]
float vg_value_at(const vg_value* value, uint32_t slot, uint32_t lane, float station);

/// Is the target of this vehicle out of reach?
static inline bool vg_value_unreachable(const vg_value* value, uint32_t slot)
{
    VERGE_ASSERT(slot < value->tables_max);
    return value->tables[slot].unreachable;
}

#ifdef __cplusplus
}
#endif

#endif
