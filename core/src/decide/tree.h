/// The pool of metanodes: fixed size, one state per node packed for the scene's vehicle counts.
#ifndef VG_TREE_H
#define VG_TREE_H

#include "decide/search.h"

#ifdef __cplusplus
extern "C" {
#endif

enum {
    VG_NO_NODE = -1,
    VG_TABLE_SIZE = 4096, ///< numbers of visits with tabulated logarithm and square root
    VG_TRAIL_COUNT = 2,   ///< trails: the states along the best plan and along the present one
    VG_TRAIL_LENGTH = VERGE_STEPS_MAX + 1,
};

/// One node, without its state. The fields joint_* number the joint actions not yet visited.
typedef struct vg_metanode {
    int32_t  parent, first_child, next_sibling;
    uint32_t visits;
    double   mean;         ///< of the rewards backed up: X-bar of Eq. 1
    uint64_t joint_left;   ///< joint actions not yet visited
    uint64_t joint_at;     ///< number of the next one
    uint32_t joint_stride; ///< coprime to the product of the legal sets' sizes
    uint8_t  depth, opened, terminal;
    uint8_t  actions[VERGE_CONTROLLED_MAX];
} vg_metanode;

struct vg_tree {
    uint32_t     nodes_max, count, stride;
    vg_metanode* nodes;
    uint8_t*     states;
    double*      log_of;       ///< [VG_TABLE_SIZE]
    double*      inverse_root; ///< [VG_TABLE_SIZE] 1 / sqrt(n)
};

struct vg_search;

/// Empties the tree for a scene with these counts.
void vg_tree_empty(vg_tree* tree, uint32_t vehicle_count, uint32_t controlled_count);
/// Adds a node below `parent` (VG_NO_NODE: as the root) with this state and returns its index. The
/// pool must not be full.
int32_t vg_tree_add(struct vg_search* self, int32_t parent, const uint8_t* actions,
                    const vg_flow* flow);
/// Saves and loads a state. Slots 0 .. nodes_max - 1 hold the states of the nodes, the slots after
/// them those of the trails.
void vg_tree_save(const struct vg_search* self, uint32_t slot, const vg_flow* flow);
void vg_tree_load(const struct vg_search* self, uint32_t slot, vg_flow* flow);
/// The slot of one step along a trail.
uint32_t vg_tree_trail(const struct vg_search* self, uint32_t trail, uint32_t step_index);

#ifdef __cplusplus
}
#endif

#endif
