/// Random dense traffic on a straight freeway of four lanes: scenario documents from a few
/// numbers and a seed. The same numbers give the same document everywhere.
#ifndef VERGE_EXPERIMENT_TRAFFIC_H
#define VERGE_EXPERIMENT_TRAFFIC_H

#include "lab.h"

typedef struct traffic {
    uint32_t controlled;   ///< each wants into a neighbouring lane, left or right by chance
    uint32_t humans;       ///< drive on in their lanes
    double   density;      ///< [1/km] vehicles a lane, where the vehicles are: they fill a stretch
                           ///< of (controlled + humans) / (4 density) km; at most 60
    double   speed_min, speed_max; ///< [m/s] evenly distributed, whole tenths
    uint64_t seed;
} traffic;

/// Centres of two vehicles in one lane are at least TRAFFIC_SPACING apart. [m]
#define TRAFFIC_SPACING 10.0
#define TRAFFIC_SPEED_LIMIT 10.0 ///< [m/s] as on the authors' freeway

lab_document* traffic_document(const traffic* self);

#endif
