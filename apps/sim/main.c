/// verge-sim: runs a scenario in closed loop, from its initial state to its end. Uncontrolled
/// vehicles move by their model or track, controlled vehicles along their latest trajectory, which
/// is planned every simulation.replan seconds. Prints the metrics and writes the run file.
#include "common/number.h"
#include "common/options.h"
#include "common/output.h"
#include "common/run.h"
#include "common/scenario_open.h"

#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <string.h>
#include <time.h>
#include <unistd.h>

/// One run with its options.
typedef struct simulation {
    const scenario* scene;
    world           world;
    metrics         metrics;
    verge_plan      plan;    ///< of the latest cycle
    FILE*           run;     ///< null: not recorded
    bool            timing;
} simulation;

static int  run(const scenario* scene, const char* path, bool timing);
static bool simulate(simulation* self);
static bool plan_cycle(simulation* self);
static double now_ms(void);
static bool metrics_print(const simulation* self);

int main(int argc, char** argv)
{
    const char* out = NULL;
    const char* seed_text = NULL;
    bool        no_timing = false;
    const option_entry options[] = {
        { "--out", "RUN.jsonl", "writes the run (format verge-run/1) to this file", &out, NULL },
        { "--seed", "N", "plans with this seed instead of the scenario's", &seed_text, NULL },
        { "--no-timing", NULL, "omits the measured times (cycle_ms)", NULL,
          &no_timing },
    };
    const program self = {
        .name = "verge-sim",
        .argument = "SCENARIO.json",
        .text = "Runs the scenario in closed loop and prints its metrics on standard output.",
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
    status = run(&scene, out, !no_timing);
    scenario_free(&scene);
    return status;
}

static int run(const scenario* scene, const char* path, bool timing)
{
    static output     file; // static: large
    static simulation self;
    self = (simulation){ .scene = scene, .timing = timing };
    output_guard_signals();
    if (path != NULL && !output_open(&file, path)) {
        output_report(path);
        return 2;
    }
    self.run = file.stream;
    bool good = world_init(&self.world, scene) && metrics_init(&self.metrics, &self.world);
    if (!good) {
        fputs("verge-sim:memory: out of memory\n", stderr);
    }
    good = good && simulate(&self);
    if (good && path != NULL && !output_close(&file)) {
        output_report(path);
        good = false;
    }
    good = good && metrics_print(&self);
    output_abandon(&file);
    metrics_free(&self.metrics);
    world_free(&self.world);
    return good ? 0 : 1;
}

static bool simulate(simulation* self)
{
    const uint32_t end = (uint32_t)lround(self->scene->duration * WORLD_TICKS_PER_SECOND);
    const uint32_t cycle = (uint32_t)lround(self->scene->replan * WORLD_TICKS_PER_SECOND);
    const bool     watched = isatty(STDERR_FILENO) != 0;
    if (self->run != NULL) {
        run_write_head(self->run, self->scene);
    }
    for (;;) {
        const uint32_t tick = self->world.tick;
        const bool     plans = tick % cycle == 0 && tick < end;
        // Plan before the tick is written, because its lights are those of the new plan.
        if (plans && !plan_cycle(self)) {
            return false;
        }
        metrics_tick(&self->metrics, &self->world);
        if (self->run != NULL) {
            run_write_tick(self->run, &self->world);
        }
        if (self->run != NULL && plans) {
            run_write_plan(self->run, &self->world, &self->plan);
        }
        if (watched && tick % WORLD_TICKS_PER_SECOND == 0) {
            fprintf(stderr, "\r%4.0f s of %.0f", world_time(&self->world), self->scene->duration);
        }
        if (tick >= end) {
            break;
        }
        world_advance(&self->world);
    }
    if (watched) {
        fputs("\r\033[K", stderr);
    }
    if (self->run != NULL) {
        run_write_metrics(self->run, &self->metrics, self->timing);
    }
    return true;
}

/// Plans for the present state of the world and gives each controlled vehicle its plan.
static bool plan_cycle(simulation* self)
{
    verge_plan*        plan = &self->plan;
    const double       start = now_ms();
    const verge_status status = world_plan(&self->world, plan);
    const double       ms = now_ms() - start;
    if (status != VERGE_OK) {
        fprintf(stderr, "verge-sim:step at %g s: %s\n", world_time(&self->world),
                verge_status_text(status));
        return false;
    }
    const verge_counters counters = verge_planner_counters(self->scene->planner);
    metrics_cycle(&self->metrics, plan, &counters, ms);
    for (uint32_t i = 0; i < plan->vehicle_count; ++i) {
        world_follow(&self->world, &plan->vehicles[i], world_time(&self->world));
    }
    return true;
}

static double now_ms(void)
{
    struct timespec now;
    clock_gettime(CLOCK_MONOTONIC, &now);
    return (double)now.tv_sec * 1e3 + (double)now.tv_nsec * 1e-6;
}

static bool metrics_print(const simulation* self)
{
    fputs("{\"scenario\":", stdout);
    string_write(stdout, self->scene->name);
    fputs(",\"seed\":", stdout);
    number_write_u64(stdout, self->scene->def.seed);
    fputs(",\n\"metrics\":", stdout);
    metrics_write(stdout, &self->metrics, self->timing, "\n");
    fputs("}\n", stdout);
    return output_flush("verge-sim");
}
