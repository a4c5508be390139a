/// The relations of the lanes near the vehicles of one scene. They are in the memory of a stage.
/// Relations of lanes that stay near are kept from scene to scene, but the results depend on the
/// present scene only.
///
/// Near are the lanes with the least distance along the graph (successors, predecessors,
/// neighbours, lanes that cross) from a controlled vehicle; uncontrolled vehicles count as 300 m
/// further away. All lanes of a small road are near. Vehicles on lanes that are not near drive on
/// along their lanes, but are related to no other vehicle: not as leader, nor as follower.
#ifndef VG_ROAD_LOCAL_H
#define VG_ROAD_LOCAL_H

#include "base/contract.h"
#include "road/road.h"

#ifdef __cplusplus
extern "C" {
#endif

enum { VG_NOT_LOCAL = 255 };

/// A lane downstream of another one.
typedef struct vg_reach {
    double cost;    ///< [m] from the end of the one to the start of the other; VG_HUGE: not reached
    double offset;  ///< [m] add to the other's station
    double lateral; ///< [m] add to the other's y
} vg_reach;

/// Lanes downstream of one lane, found by vg_reach_walk().
typedef struct vg_reach_table {
    const uint8_t* local;   ///< [lane] place in the table, VG_NOT_LOCAL: left out; null: all lanes
    vg_reach *row, *entry;  ///< [capacity] the answer; what is known of each lane's start
    uint8_t*  state;
    uint16_t *touched, *open;
    uint32_t  capacity, touched_count, open_count;
} vg_reach_table;

void vg_reach_take(vg_reach_table* table, vg_arena* arena, uint32_t capacity);
/// Forgets the last walk: needed before `local` changes.
void vg_reach_clear(vg_reach_table* table);
/// Fills the table from lane `from` on; returns the length of the ring back to its bundle, 0
/// if there is none within reach. [m]
double vg_reach_walk(vg_reach_table* table, const struct verge_road* road, uint32_t from);
const vg_reach* vg_reach_of(const vg_reach_table* table, uint32_t lane);

/// What vg_relation is made from: a near lane downstream of another.
typedef struct vg_downstream {
    float cost, offset, lateral; ///< [m] see vg_reach
} vg_downstream;

/// What of a relation is stored for each pair of near lanes.
typedef struct vg_link {
    float offset, lateral; ///< [m] see vg_relation
} vg_link;
enum { VG_ROUND = 128 }; ///< added to a kind: both lanes are on one ring

typedef struct vg_local {
    const struct verge_road* road; ///< of the last scene, and its fingerprint
    uint64_t  fingerprint;
    uint32_t  capacity, count;  ///< near lanes
    uint16_t* lanes;            ///< [capacity] ascending
    uint8_t*  place;            ///< [lane] place in lanes, VG_NOT_LOCAL
    vg_link*  links;            ///< [capacity][capacity] by place: of vg_relation
    uint8_t*  kinds;            ///< [capacity][capacity] by place: vg_relation_kind, and VG_ROUND
    float*    ring;             ///< [capacity] [m] length of the ring through a lane, 0: none
    uint64_t* after;            ///< [capacity] near lanes (bits by place) that are or continue it
    bool      rings;            ///< some relation has a period
    uint32_t  columns;          ///< targets that there is room for, and one for none (column 0)
    int32_t*  targets;          ///< [columns] lane index, -1 none, -2 free
    uint64_t* used;             ///< [columns] when it was last asked for
    uint64_t  uses;
    uint64_t* matters;          ///< [columns][capacity] near lanes (bits by place) that a vehicle
                                ///< on the lane takes into account: related lanes without the
                                ///< branches that are not on its route
    // Scratch memory, in which nothing stays from call to call of vg_local_cover().
    uint16_t* distance;         ///< [lane] m from the vehicles
    vg_downstream* downstream;  ///< [capacity][capacity] by place
    vg_reach_table reach;
} vg_local;

/// Where a vehicle is, for choosing the near lanes.
typedef struct vg_source {
    uint32_t lane;       ///< index
    double   s;          ///< [m]
    bool     controlled;
} vg_source;

/// Room for scenes of so many vehicles and different targets, without scratch memory. Near are at
/// most VERGE_LANES_NEAR_MAX lanes, 24 for up to 16 vehicles, and lane_count, 0 if
/// it is not known.
vg_local* vg_local_take(vg_arena* arena, uint32_t lane_count, uint32_t vehicles, uint32_t targets);
/// The scratch memory, for the same numbers. The arena may be one whose memory is used for
/// something else between two calls of vg_local_cover(). local: null with a measuring arena.
void vg_local_take_scratch(vg_local* local, vg_arena* arena, uint32_t lane_count,
                           uint32_t vehicles);

/// Chooses the near lanes of a scene and relates them.
void vg_local_cover(vg_local* local, const struct verge_road* road, const vg_source* sources,
                    uint32_t count);

/// Column of a target (lane index, -1 none) for vg_local_matters(). Valid until the next scene, or
/// until more others than there is room for were asked for.
uint32_t vg_local_column(vg_local* local, int32_t target);

/// How a vehicle on lane b appears to one on lane a; kind VG_UNRELATED where one is not near.
vg_relation vg_local_relation(const vg_local* local, uint32_t a, uint32_t b);

/// The length of the ring that both lanes are on, 0: they are not on one. [m]
static inline float vg_local_ring(const vg_local* local, uint32_t a, uint32_t b)
{
    VERGE_ASSERT(a < VERGE_LANES_MAX && b < VERGE_LANES_MAX);
    const uint32_t at = local->place[a], to = local->place[b];
    const bool near = at != VG_NOT_LOCAL && to != VG_NOT_LOCAL;
    return near && (local->kinds[at * local->capacity + to] & VG_ROUND) != 0 ? local->ring[at]
                                                                             : 0.0f;
}

/// Has a vehicle on `lane` with this target to look at those on `other`?
static inline bool vg_local_matters(const vg_local* local, uint32_t column, uint32_t lane,
                                    uint32_t other)
{
    VERGE_ASSERT(column < local->columns);
    const uint32_t at = local->place[lane], to = local->place[other];
    return at != VG_NOT_LOCAL && to != VG_NOT_LOCAL
           && (local->matters[column * local->capacity + at] >> to & 1u) != 0;
}

#ifdef __cplusplus
}
#endif

#endif
