/// verge-sim: runs a scenario in closed loop, from its initial state to its end. Uncontrolled
/// vehicles move by their model or track, controlled vehicles along their latest trajectory, which
/// is planned every simulation.replan seconds. Prints the metrics and writes the run file.
#include "common/number.h"
#include "common/options.h"
#include "common/output.h"
#include "common/run.h"
#include "common/scenario_open.h"
#include "fleet/fleet.h"

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
    fleet*          fleet;   ///< null: vehicles drive the plans themselves
    uint32_t        changes; ///< of mode, already written
} simulation;

static int  run(const scenario* scene, const char* path, bool timing, const fleet_options* faults);
static bool read_faults(const program* self, const char* const texts[3], fleet_options* faults);
static bool simulate(simulation* self);
static bool plan_cycle(simulation* self);
static void fleet_cycle(simulation* self);
static double now_ms(void);
static bool metrics_print(const simulation* self);

int main(int argc, char** argv)
{
    const char* out = NULL;
    const char* seed_text = NULL;
    bool        no_timing = false, units = false;
    const char* faults_text[3] = { NULL, NULL, NULL };
    const option_entry options[] = {
        { "--out", "RUN.jsonl", "writes the run (format verge-run/1) to this file", &out, NULL },
        { "--seed", "N", "plans with this seed instead of the scenario's", &seed_text, NULL },
        { "--no-timing", NULL, "omits the measured times (cycle_ms)", NULL,
          &no_timing },
        { "--units", NULL, "an on-vehicle unit (as verge-obu) drives each controlled vehicle", NULL,
          &units },
        { "--plan-delay", "S", "plans arrive S seconds late", &faults_text[0], NULL },
        { "--plan-loss", "SHARE", "this share of the plans is lost", &faults_text[1], NULL },
        { "--rsu-off", "FROM-TO", "there is no roadside unit from .. to [s]", &faults_text[2], NULL },
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
    fleet_options faults = { .seed = scene.def.seed };
    status = 2;
    if (read_faults(&self, faults_text, &faults)) {
        const bool messages = units || faults_text[0] != NULL || faults_text[1] != NULL
                              || faults_text[2] != NULL;
        faults.without_units = !units;
        status = run(&scene, out, !no_timing, messages ? &faults : NULL);
    }
    scenario_free(&scene);
    return status;
}

/// The numbers of --plan-delay, --plan-loss and --rsu-off. False: one of them is wrong, one line on
/// standard error.
static bool read_faults(const program* self, const char* const texts[3], fleet_options* faults)
{
    if (!options_number(self, "--plan-delay", texts[0], 0.0, 1.0, &faults->delay_s)
        || !options_number(self, "--plan-loss", texts[1], 0.0, 1.0, &faults->loss)) {
        return false;
    }
    if (texts[2] == NULL) {
        return true;
    }
    char* end = NULL;
    faults->off_from = strtod(texts[2], &end);
    const bool range = end != texts[2] && *end == '-';
    const char* second = range ? end + 1 : "";
    faults->off_to = range ? strtod(second, &end) : 0.0;
    if (!range || end == second || *end != '\0' || !(faults->off_from >= 0.0)
        || !(faults->off_to > faults->off_from)) {
        fprintf(stderr, "verge-sim:--rsu-off: is \"%.40s\", expected two times such as 5-9.5\n",
                texts[2]);
        return false;
    }
    return true;
}

static int run(const scenario* scene, const char* path, bool timing, const fleet_options* faults)
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
    char error[256] = "";
    if (good && faults != NULL && (self.fleet = fleet_open(&self.world, faults, error,
                                                          sizeof error)) == NULL) {
        fprintf(stderr, "verge-sim:%s\n", error);
        good = false;
    }
    good = good && simulate(&self);
    if (good && path != NULL && !output_close(&file)) {
        output_report(path);
        good = false;
    }
    good = good && metrics_print(&self);
    output_abandon(&file);
    fleet_close(self.fleet);
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
        if (self->fleet != NULL && tick < end) {
            fleet_cycle(self);
        } else if (plans && !plan_cycle(self)) {
            return false;
        }
        metrics_tick(&self->metrics, &self->world);
        if (self->run != NULL) {
            run_write_tick(self->run, &self->world);
        }
        if (self->run != NULL && plans && self->fleet == NULL) {
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

/// One tick with on-vehicle units. The plans of the roadside unit are written where it made some,
/// and so is each change of mode.
static void fleet_cycle(simulation* self)
{
    fleet_tick(self->fleet);
    bool planned = false;
    const verge_plan* plan = fleet_plan(self->fleet, &planned);
    if (planned) {
        metrics_cycle(&self->metrics, plan, NULL, -1.0);
    }
    if (planned && self->run != NULL) {
        run_write_plan(self->run, &self->world, plan);
    }
    uint32_t count = 0;
    const fleet_change* changes = fleet_changes(self->fleet, &count);
    for (; self->changes < count && self->run != NULL; ++self->changes) {
        const fleet_change* change = &changes[self->changes];
        const run_unit unit = { change->vehicle_id, wire_unit_mode_name(change->mode),
                                wire_unit_reason_name(change->reason), change->about,
                                change->cycle };
        run_write_unit(self->run, world_time(&self->world), &unit);
    }
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
