/// One memory for two stages: a predictor that works in the memory of a decider.
#include "verge/trajectory.h"

#include "decide/decider.h"
#include "motion/predictor.h"

verge_status verge_predictor_init_shared(verge_predictor** predictor, const verge_decider* decider,
                                         void* memory, size_t size)
{
    if (predictor == NULL) {
        return VERGE_ERR_ARGUMENT;
    }
    *predictor = NULL;
    if (decider == NULL) {
        return VERGE_ERR_ARGUMENT;
    }
    const vg_traffic traffic = vg_decider_traffic(decider);
    return vg_predictor_init_with(predictor, vg_decider_def(decider), &traffic, memory, size);
}
