/// See traffic.h.
#include "traffic/traffic.h"

// The near lanes are related before the flows after the root are written, and those are not needed
// any more when the next scene comes: both have one memory.
static vg_flow* take_flows(vg_arena* arena, const verge_planner_def* def, vg_pairs* pairs)
{
    vg_arena again = *arena;
    vg_flow* flows = vg_arena_take(arena, 3 * sizeof *flows);
    (void)vg_arena_take(&again, sizeof *flows); // the root
    vg_local_take_scratch(pairs != NULL ? pairs->local : NULL, &again, def->road.lane_count,
                          def->vehicles_max);
    vg_arena_join(arena, &again);
    return flows;
}

vg_traffic vg_traffic_take(vg_arena* arena, const verge_planner_def* def)
{
    vg_pairs* pairs = vg_pairs_take(arena, def);
    vg_model* model = vg_arena_take(arena, sizeof *model);
    vg_order* order = vg_order_take(arena, def->vehicles_max);
    return (vg_traffic){ pairs, model, take_flows(arena, def, pairs), order };
}
