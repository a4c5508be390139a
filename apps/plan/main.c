/// verge-plan: one planning cycle from a scenario's initial state, printed as the plan document.
#include "common/options.h"
#include "common/output.h"
#include "common/plan_json.h"
#include "common/scenario_open.h"
#include "common/world.h"

#include <stdio.h>
#include <string.h>

static int run(const scenario* scene);

int main(int argc, char** argv)
{
    const char* seed_text = NULL;
    bool        no_timing = false;
    const option_entry options[] = {
        { "--seed", "N", "plans with this seed instead of the scenario's", &seed_text, NULL },
        { "--no-timing", NULL, "has no effect: a plan document has no timing", NULL,
          &no_timing },
    };
    const program self = {
        .name = "verge-plan",
        .argument = "SCENARIO.json",
        .text = "Decides jointly for the scenario's controlled vehicles, plans a trajectory for\n"
                "each and prints the plan document (format verge-plan/1) on standard output.",
        .options = options,
        .option_count = sizeof options / sizeof options[0],
        .usage_status = 2,
    };
    const char* path = NULL;
    int         status = 0;
    if (!options_parse(&self, argc, argv, &path, &status)) {
        return status;
    }
    scenario scene;
    if (!scenario_open(&scene, &self, path, seed_text)) {
        return 2;
    }
    status = run(&scene);
    scenario_free(&scene);
    return status;
}

static int run(const scenario* scene)
{
    static verge_plan plan;
    world start;
    if (!world_init(&start, scene)) {
        fputs("verge-plan:memory: out of memory\n", stderr);
        return 1;
    }
    const verge_status planned = world_plan(&start, &plan);
    world_free(&start);
    if (planned != VERGE_OK) {
        fprintf(stderr, "verge-plan:step: %s\n", verge_status_text(planned));
        return 1;
    }
    plan_write(stdout, &plan, scene->name, scene->def.point_s, PLAN_READABLE);
    return output_flush("verge-plan") ? 0 : 1;
}
