/// See scenario_open.h.
#include "scenario_open.h"

bool scenario_open(scenario* scene, const program* self, const char* path, const char* seed_text)
{
    uint64_t seed = 0;
    bool     seeded = false;
    if (!options_u64(self, "--seed", seed_text, &seed, &seeded)) {
        return false;
    }
    if (!scenario_load(scene, path, seeded ? &seed : NULL)) {
        fputs(scene->file.error, stderr);
        return false;
    }
    return true;
}
