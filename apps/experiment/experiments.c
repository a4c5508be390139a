/// See experiments.h.
#include "experiments.h"

const experiment experiments[] = {
    { "freeway-table", "The paper's Table 3: three methods, 2 to 4 controlled vehicles.", 100,
      freeway_table, { "freeway-2av-as-stated-verge" } },
    { "pareto", "Finish time against smallest gap, 1.5 s steps, closed loop.", 20, pareto,
      { NULL } },
    { "beyond", "5, 6 and 8 controlled vehicles: the authors' freeway, random dense traffic.", 200,
      beyond, { NULL } },
    { "regret", "Distance of X_flow to the best known plan and to the bound, over the budget.", 30,
      regret, { NULL } },
    { "ramp-cases", "Cases 1, 2 and 3 of the paper's section 4.2.", 20, ramp_cases,
      { "ramp-case-1-state-1.00-3000", "ramp-case-2-state-1.00-3000", "ramp-case-3-speeds-up" } },
    { "roundabout", "Entrants and circulating vehicles at a two-lane roundabout.", 10, roundabout,
      { NULL } },
    { "recorded", "Recorded US-101 traffic with the humans replayed.", 10, recorded, { NULL } },
    { "diversity", "The same scenes under the three habits, and who yields.", 100, diversity,
      { NULL } },
};
const uint32_t experiment_count = sizeof experiments / sizeof experiments[0];
