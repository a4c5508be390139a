/// Access to a decision. It is separate from the search, so that a program with its own decision
/// stage does not link the search.
#include "verge/decision.h"

const verge_vehicle_decision* verge_decision_of(const verge_decision* decision, int32_t vehicle_id)
{
    for (uint32_t i = 0; i < decision->vehicle_count; ++i) {
        if (decision->vehicles[i].vehicle_id == vehicle_id) {
            return &decision->vehicles[i];
        }
    }
    return NULL;
}
