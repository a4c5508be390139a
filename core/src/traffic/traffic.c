/// See traffic.h.
#include "traffic/traffic.h"

vg_traffic vg_traffic_take(vg_arena* arena, const verge_planner_def* def)
{
    vg_pairs* pairs = vg_pairs_take(arena, def);
    vg_model* model = vg_arena_take(arena, sizeof *model);
    vg_order* order = vg_arena_take(arena, sizeof *order);
    // The near lanes are related before the order is made and before flows follow the root, and
    // those are not needed any more when the next scene comes: both have one memory.
    vg_arena again = *arena;
    vg_flow* flows = vg_arena_take(arena, 3 * sizeof *flows);
    vg_order_take(order, arena, def->vehicles_max);
    (void)vg_arena_take(&again, sizeof *flows); // the root
    vg_local_take_scratch(pairs != NULL ? pairs->local : NULL, &again, def->road.lane_count,
                          def->vehicles_max);
    vg_arena_join(arena, &again);
    return (vg_traffic){ pairs, model, flows, order };
}
