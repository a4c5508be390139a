/// verge-replay: plans a recording again and names the first cycle whose digest differs.
///
/// A run file of verge-sim contains its whole scenario. A run file of verge-publish contains the
/// states that it sent; a daemon made its plans, with the parameters of the scenario or of
/// --config. A log of `verge-rsu --record` needs the configuration with which it was recorded. With
/// --seed the digests differ, unless it is the seed of the recording.
///
/// Exit 0: all digests are equal; 1: one differs; 2: the recording or the command line is not
/// usable.
#define _GNU_SOURCE
#include "bus_run.h"

#include "common/floating.h"
#include "common/input.h"
#include "common/number.h"
#include "common/options.h"
#include "common/output.h"
#include "common/world.h"
#include "rsu/replay.h"

#include <errno.h>
#include <inttypes.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

static int  replay_run_file(const char* path, FILE* file, const char* config_path,
                            const uint64_t* seed);
static int  replay_log(const char* path, const char* config_path, const uint64_t* seed);

/// True: the first 64 KiB contain the sync word of an LCM event. A damaged log may not begin with
/// it.
static bool is_log(FILE* file)
{
    static const unsigned char SYNC[] = { 0xed, 0xa1, 0xda, 0x01 };
    static unsigned char bytes[1 << 16];
    rewind(file);
    const size_t size = fread(bytes, 1, sizeof bytes, file);
    return memmem(bytes, size, SYNC, sizeof SYNC) != NULL;
}

int main(int argc, char** argv)
{
    floating_correct(); // the mode in which the daemon plans
    const char* config_path = NULL;
    const char* seed_text = NULL;
    const option_entry table[] = {
        { "--config", "RSU.json", "for a log or a run on a bus: the daemon's configuration",
          &config_path, NULL },
        { "--seed", "N", "replaces the recorded seed; another seed gives other digests",
          &seed_text, NULL },
    };
    const program self = {
        .name = "verge-replay",
        .argument = "RUN-or-LOG",
        .text = "Plans a recording again and names the first cycle whose digest differs.",
        .options = table,
        .option_count = sizeof table / sizeof table[0],
        .usage_status = 2,
    };
    const char* path = NULL;
    int status = 0;
    uint64_t seed_value = 0;
    bool seeded = false;
    if (!options_parse(&self, argc, argv, &path, &status)) {
        return status;
    }
    if (!options_u64(&self, "--seed", seed_text, &seed_value, &seeded)) {
        return 2;
    }
    const uint64_t* seed = seeded ? &seed_value : NULL;
    const char* reason = NULL;
    FILE* file = input_open(path, &reason);
    // An LCM event log begins with its sync word, a run file with the brace of a JSON object.
    const int first = file != NULL ? getc(file) : EOF;
    if (first == EOF) {
        fprintf(stderr, "%s:file: cannot be read (%s), expected a run file or an LCM event log\n",
                path, file == NULL ? reason : feof(file) ? "empty" : strerror(errno));
        if (file != NULL) {
            fclose(file);
        }
        return 2;
    }
    if (first != '{' && !is_log(file)) {
        fprintf(stderr, "%s:file: is neither, expected a run file or an LCM event log\n", path);
        fclose(file);
        return 2;
    }
    rewind(file);
    status = first == '{' ? replay_run_file(path, file, config_path, seed)
                          : replay_log(path, config_path, seed);
    fclose(file);
    return output_flush("verge-replay") ? status : 1;
}

static void print_equal(const char* path, uint64_t cycles)
{
    printf("%s: %" PRIu64 " cycles, every digest is the same\n", path, cycles);
}

static void print_different(const char* path, int64_t cycle, const char* when, uint64_t recorded,
                           uint64_t replayed)
{
    printf("%s: cycle %" PRId64 " (%s) is the first that differs: recorded %016" PRIx64
           ", replayed %016" PRIx64 "\n",
           path, cycle, when, recorded, replayed);
}

// ---- a log --------------------------------------------------------------------------------

static int replay_log(const char* path, const char* config_path, const uint64_t* seed)
{
    char error[CONFIG_ERROR_SIZE];
    if (config_path == NULL) {
        fprintf(stderr, "verge-replay:--config: missing, expected the daemon's configuration "
                        "beside an LCM event log\n");
        return 2;
    }
    site*         site = NULL;
    replay_report report;
    const replay_options options = { .log_path = path };
    int code = site_load(&site, &CONFIG_DEF, config_path, error);
    if (code == 0) {
        site->planner.seed = seed != NULL ? *seed : site->planner.seed;
        code = replay_run(&options, config_of(site), &report, error);
    }
    site_free(site);
    if (code != 0) {
        error[strcspn(error, "\n")] = '\0';
        fprintf(stderr, "%s\n", error);
        return 2;
    }
    if (report.compared == 0 && !report.differs) {
        fprintf(stderr, "%s:file: holds no plans to compare with, expected a log of verge-rsu "
                        "--record\n", path);
        return 2;
    }
    if (report.differs) {
        char when[64];
        snprintf(when, sizeof when, "utime %" PRId64 "%s", report.differs_utime,
                 report.count_differs ? ", other vehicles planned" : "");
        print_different(path, report.differs_cycle, when, report.recorded_digest,
                       report.replayed_digest);
        return 1;
    }
    print_equal(path, report.compared);
    return 0;
}

// ---- a run file ---------------------------------------------------------------------------

/// The planning cycles a run file holds, in order.
typedef struct recording {
    scenario  scene;
    uint64_t* digests;
    uint32_t  count, capacity;
    bool      complete;   // the last line has the metrics

    // A run of verge-publish is planned again while it is read.
    const char*    config_path; // of the daemon; null: the scenario has its parameters
    site*          site;
    planning       planner;
    bus_run        bus;
    bool           on_bus;
} recording;

static bool read_recording(recording* self, const char* path, FILE* file, const uint64_t* seed);
static int  compare(const char* path, const recording* self, world* world);
static int  print_bus_run(const char* path, const recording* self);

static int replay_run_file(const char* path, FILE* file, const char* config_path,
                           const uint64_t* seed)
{
    static recording self; // static: it is large
    int code = 2;
    self.config_path = config_path;
    const bool read = read_recording(&self, path, file, seed);
    if (read && self.on_bus) {
        code = print_bus_run(path, &self);
        scenario_free(&self.scene);
    } else if (read) {
        world world;
        if (world_init(&world, &self.scene)) {
            code = compare(path, &self, &world);
            world_free(&world);
        } else {
            fprintf(stderr, "%s:file: out of memory\n", path);
        }
        scenario_free(&self.scene);
    }
    free(self.digests);
    bus_run_free(&self.bus);
    planning_close(&self.planner);
    site_free(self.site);
    return code;
}

static int print_bus_run(const char* path, const recording* self)
{
    const bus_run* bus = &self->bus;
    if (bus->differs) {
        print_different(path, bus->differs_number, "of the roadside unit", bus->recorded,
                       bus->replayed);
        fprintf(stderr, "%s:file: planned by a roadside unit; expected %sno other vehicles on its"
                        " bus, and an empty road before\n", path,
                self->site != NULL ? "" : "its parameters in the scenario or in --config, ");
        return 1;
    }
    print_equal(path, bus->compared);
    if (bus->ended) {
        fprintf(stderr, "%s:file: the plans of cycle %d did not arrive, so those of later cycles"
                        " cannot be compared\n", path, bus->gap_number);
    }
    return 0;
}

static bool read_head(recording* self, const char* path, json_file* line, const uint64_t* seed);
static bool read_line(recording* self, const char* path, json_file* line);
static bool read_kind(recording* self, json_file* line, const uint64_t* seed);
static bool open_bus_run(recording* self, const json_at* start, const uint64_t* seed);

static bool read_recording(recording* self, const char* path, FILE* file, const uint64_t* seed)
{
    char*   text = NULL;
    size_t  room = 0;
    ssize_t size = 0;
    bool    good = true;
    bool    headed = false;
    for (uint32_t number = 1; good && (size = getline(&text, &room, file)) > 0; ++number) {
        char name[4200];
        snprintf(name, sizeof name, "%s:%u", path, number);
        json_file line;
        good = json_file_parse(&line, name, text, (size_t)size);
        if (!good && number > 1 && text[size - 1] != '\n') {
            fprintf(stderr, "%s: cut off; the run is compared up to there\n", name);
            good = true;
            break;
        }
        if (good && number == 1) {
            headed = read_head(self, name, &line, seed);
            good = headed && read_kind(self, &line, seed);
        } else if (good) {
            good = read_line(self, name, &line);
        }
        if (!good && line.error[0] != '\0') {
            fputs(line.error, stderr);
        }
        json_file_free(&line);
    }
    free(text);
    if (good && self->count == 0) {
        fprintf(stderr, "%s:file: holds no plan, expected a run of verge-sim or verge-publish\n",
                path);
        good = false;
    }
    if (!good && headed) {
        scenario_free(&self->scene);
    }
    return good;
}

/// The first line: builds the scenario of the run.
static bool read_head(recording* self, const char* path, json_file* line, const uint64_t* seed)
{
    const json_at root = json_root(line);
    const json_at format = json_member(&root, "format");
    const json_at scene = json_member(&root, "scenario");
    if (strcmp(json_string(&root, "format"), "verge-run/1") != 0) {
        return json_fail(&format, "is not \"verge-run/1\", expected a run of verge-sim or"
                                  " verge-publish");
    }
    if (!json_given(&scene)) {
        return json_fail(&scene, "is missing, expected the scenario of the run");
    }
    char* text = value_text(scene.node);
    const bool built =
        text != NULL && scenario_parse(&self->scene, path, text, strlen(text), seed);
    if (text == NULL) {
        fprintf(stderr, "%s: out of memory\n", path);
    } else if (!built) {
        fputs(self->scene.file.error, stderr);
    }
    free(text);
    return built;
}

/// A run of verge-publish has the instant of its start.
static bool read_kind(recording* self, json_file* line, const uint64_t* seed)
{
    const json_at root = json_root(line);
    const json_at start = json_member(&root, "start_utime");
    if (json_given(&start)) {
        return open_bus_run(self, &start, seed);
    }
    if (self->config_path != NULL) {
        fprintf(stderr, "verge-replay:--config: given for a run of verge-sim, expected a log or a"
                        " run of verge-publish\n");
    }
    return self->config_path == NULL;
}

/// The planner of the daemon's configuration, or of the scenario.
static bool open_bus_run(recording* self, const json_at* start, const uint64_t* seed)
{
    char      error[CONFIG_ERROR_SIZE];
    cycle_def def = {
        .planner = self->scene.planner,
        .vehicles_max = self->scene.def.vehicles_max,
        .controlled_max = self->scene.def.controlled_max,
        .limits = inbox_default_limits(),
        .map_crc32 = wire_map_crc32(&self->scene.def.road),
    };
    const int64_t start_utime = json_as_integer(start, 0, INT64_C(1) << 53);
    if (start->file->error[0] != '\0') {
        return false;
    }
    if (self->config_path != NULL) {
        int code = site_load(&self->site, &CONFIG_DEF, self->config_path, error);
        if (code == 0) {
            verge_planner_def* planner = &self->site->planner;
            planner->seed = seed != NULL ? *seed : planner->seed;
            code = planning_open(&self->planner, planner, NULL, error);
        }
        if (code != 0) {
            error[strcspn(error, "\n")] = '\0';
            fprintf(stderr, "%s\n", error);
            return false;
        }
        def = config_cycle_def(config_of(self->site), &self->planner);
    }
    const bool configured = self->site != NULL;
    self->on_bus = bus_run_init(&self->bus, &self->scene, start_utime, &def,
                                configured ? &self->site->planner : &self->scene.def,
                                configured ? self->planner.memory : self->scene.arena,
                                configured ? self->planner.size : self->scene.arena_size);
    return self->on_bus || json_fail(start, "out of memory");
}

static bool keep_digest(recording* self, uint64_t digest)
{
    if (self->count == self->capacity) {
        const uint32_t capacity = self->capacity == 0 ? 64 : 2 * self->capacity;
        uint64_t* digests = realloc(self->digests, capacity * sizeof *digests);
        if (digests == NULL) {
            return false;
        }
        self->digests = digests;
        self->capacity = capacity;
    }
    self->digests[self->count++] = digest;
    return true;
}

/// Any other line: only plans and the final metrics are used.
static bool read_line(recording* self, const char* path, json_file* line)
{
    (void)path;
    const json_at root = json_root(line);
    const json_at plan = json_member(&root, "plan");
    const json_at metrics = json_member(&root, "metrics");
    self->complete = self->complete || json_given(&metrics);
    if (!json_given(&plan)) {
        const json_at vehicles = json_member(&root, "vehicles");
        return !self->on_bus || !json_given(&vehicles) || bus_run_tick(&self->bus, &root);
    }
    const char* text = json_string(&plan, "digest");
    char* end = NULL;
    const uint64_t digest = strtoull(text, &end, 16);
    if (strlen(text) != 16 || *end != '\0') {
        const json_at at = json_member(&plan, "digest");
        return json_fail(&at, "is not a digest, expected 16 hexadecimal digits");
    }
    if (self->on_bus && !bus_run_plan(&self->bus, &root, digest)) {
        return false;
    }
    return keep_digest(self, digest) || json_fail(&plan, "out of memory");
}

/// Repeats the closed loop of verge-sim and compares every cycle with the recorded one.
static int compare(const char* path, const recording* self, world* world)
{
    static verge_plan plan;
    const uint32_t end = (uint32_t)lround(self->scene.duration * WORLD_TICKS_PER_SECOND);
    const uint32_t cycle = (uint32_t)lround(self->scene.replan * WORLD_TICKS_PER_SECOND);
    uint32_t number = 0;
    char when[64];
    for (; world->tick < end; world_advance(world)) {
        if (world->tick % cycle != 0) {
            continue;
        }
        snprintf(when, sizeof when, "t = %.1f s", world_time(world));
        const verge_status status = world_plan(world, &plan);
        if (number == self->count && !self->complete) {
            break; // the run was cut short, and all of it has been compared
        }
        const uint64_t recorded = number < self->count ? self->digests[number] : 0;
        if (status != VERGE_OK || number == self->count || recorded != plan.digest) {
            print_different(path, number, when, recorded, status == VERGE_OK ? plan.digest : 0);
            return 1;
        }
        ++number;
        for (uint32_t i = 0; i < plan.vehicle_count; ++i) {
            world_follow(world, &plan.vehicles[i], world_time(world));
        }
    }
    if (number < self->count) {
        print_different(path, number, "after the end of the scenario", self->digests[number], 0);
        return 1;
    }
    print_equal(path, number);
    return 0;
}
