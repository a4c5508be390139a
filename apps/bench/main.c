/// verge-bench: how fast the search, the sampler and whole cycles are; one JSON document.
///
/// Search and sampler are measured below the planner's interface, so that each figure stands for
/// one thing; cycles are whole calls of verge_planner_step(). Times are CPU times of this thread:
/// other load on the machine moves them less than wall time, but it still moves them. What does
/// not move is instructions: tools/bench-instructions counts them and hands them in.
#include "common/data.h"
#include "common/number.h"
#include "common/options.h"
#include "common/scenario.h"
#include "common/world.h"

#include "decide/mcts.h"
#include "motion/predict.h"
#include "motion/sampler.h"

#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

enum { humans = 4, iterations = 3000, lane_total = 4, cycles_max = 400 };

// Random four-lane freeway scenes: everyone planned wants one lane change, the rest drive on.
typedef struct bench_scene {
    verge_planner_def def;
    void*        memory;
    verge_road*  road;
    vg_tree*     tree;
    vg_pairs     sight;
    vg_model     scene;
    vg_flow      root;
    vg_decision  decision;
    vg_tracks    tracks;
    verge_vehicle vehicles[VERGE_VEHICLES_MAX];
    vg_placed    placed[VERGE_VEHICLES_MAX];
    vg_workspace* workspace;
} bench_scene;

typedef struct settings {
    bool        quick;
    const char* scenarios;     // folder
    const char* instructions;  // "2:5000,4:6000": counted elsewhere
    uint64_t    only_search;   // controlled vehicles of the one search, for the counter
    bool        only;
    uint64_t    only_iterations;
    uint64_t    seed;          // of scenes and searches
    bool        seeded;        // then also of the cycle scenarios
} settings;

static bool   open_scene(bench_scene* self);
static void   fill_scene(bench_scene* self, uint32_t planned, uint64_t seed, uint32_t number);
static void   bench_search(bench_scene* self, const settings* with);
static void   bench_sampler(bench_scene* self, const settings* with);
static bool   cycle_scenarios_load(const settings* with);
static void   bench_cycles(const settings* with);
static int    print_document(bench_scene* self, const settings* with);
static int    count_only(bench_scene* self, const settings* with);
static void   print_machine(void);

static double cpu_seconds(void)
{
    struct timespec now;
    clock_gettime(CLOCK_THREAD_CPUTIME_ID, &now);
    return (double)now.tv_sec + 1e-9 * (double)now.tv_nsec;
}

int main(int argc, char** argv)
{
    char     folder[DATA_PATH_SIZE];
    settings with = { .scenarios = data_path(folder, "scenarios"),
                      .only_iterations = iterations, .seed = 1 };
    const char* seed_text = NULL;
    const char* search_text = NULL;
    const char* iterations_text = NULL;
    const option_entry options[] = {
        { "--quick", NULL, "ends within 30 s", NULL, &with.quick },
        { "--seed", "N", "seed (default 1; for cycles the seed of each scenario)",
          &seed_text, NULL },
        { "--scenarios", "DIR", "takes the cycle scenarios from DIR", &with.scenarios, NULL },
        { "--instructions", "LIST",
          "instructions per iteration, as 2:N,4:N,.. (tools/bench-instructions)",
          &with.instructions, NULL },
        { "--only-search", "K", "runs one search with K controlled vehicles and prints nothing",
          &search_text, NULL },
        { "--iterations", "N", "with --only-search: number of iterations", &iterations_text, NULL },
    };
    const program self = {
        .name = "verge-bench",
        .text = "Measures search, sampler and planning cycles; prints one JSON document.",
        .options = options,
        .option_count = sizeof options / sizeof options[0],
        .usage_status = 2,
    };
    int status = 0;
    if (!options_parse(&self, argc, argv, NULL, &status)) {
        return status;
    }
    if (!options_u64(&self, "--seed", seed_text, &with.seed, &with.seeded)
        || !options_u64(&self, "--only-search", search_text, &with.only_search, &with.only)
        || !options_u64(&self, "--iterations", iterations_text, &with.only_iterations, NULL)) {
        return 2;
    }
    static bench_scene scene;
    if (!open_scene(&scene)) {
        fputs("verge-bench:memory: there is not enough of it\n", stderr);
        return 1;
    }
    if (with.only) {
        return count_only(&scene, &with);
    }
    if (!cycle_scenarios_load(&with)) {
        return 2;
    }
    status = print_document(&scene, &with);
    free(scene.memory);
    return status;
}

static int print_document(bench_scene* self, const settings* with)
{
    printf("{\"format\": \"verge-bench/1\",\n \"machine\": ");
    print_machine();
    printf(",\n \"build\": \"%s, %s\",\n", VERGE_BUILD, VERGE_COMPILER);
    bench_search(self, with);
    bench_sampler(self, with);
    bench_cycles(with);
    printf("}\n");
    if (fflush(stdout) != 0 || ferror(stdout)) {
        fprintf(stderr, "verge-bench:standard output: %s\n", strerror(errno));
        return 1;
    }
    return 0;
}

// The model's name, printable characters only.
static void print_machine(void)
{
    char line[256], name[128] = "unknown";
    FILE* info = fopen("/proc/cpuinfo", "r");
    while (info != NULL && fgets(line, sizeof line, info) != NULL) {
        const char* colon = strchr(line, ':');
        if (strncmp(line, "model name", 10) == 0 && colon != NULL) {
            snprintf(name, sizeof name, "%.*s", (int)strcspn(colon + 2, "\n\"\\"), colon + 2);
            break;
        }
    }
    if (info != NULL) {
        fclose(info);
    }
    printf("\"%s\"", name);
}

// ---------------------------------------------------------------------------- scenes

static bool open_scene(bench_scene* self)
{
    static const double lines[lane_total][2][2] = { { { 0, 0 }, { 1000, 0 } },
                                                    { { 0, 4 }, { 1000, 4 } },
                                                    { { 0, 8 }, { 1000, 8 } },
                                                    { { 0, 12 }, { 1000, 12 } } };
    static verge_lane_def lanes[lane_total];
    for (int i = 0; i < lane_total; ++i) {
        lanes[i] = (verge_lane_def){ .id = i, .points = lines[i], .point_count = 2, .width = 4.0,
                                     .speed_limit = 10.0,
                                     .left = i + 1 < lane_total ? i + 1 : VERGE_NO_LANE,
                                     .right = i > 0 ? i - 1 : VERGE_NO_LANE };
    }
    const verge_road_def road = { lanes, lane_total };
    self->def = verge_planner_default_def();
    self->def.iterations = iterations;
    const size_t scratch_size = vg_road_scratch_size(&road);
    const size_t size = ((size_t)32 << 20) + scratch_size;
    self->memory = aligned_alloc(VG_ARENA_ALIGN, size / VG_ARENA_ALIGN * VG_ARENA_ALIGN);
    void* fit = aligned_alloc(VG_ARENA_ALIGN, (scratch_size / VG_ARENA_ALIGN + 1) * VG_ARENA_ALIGN);
    if (self->memory == NULL || fit == NULL) {
        return false;
    }
    vg_arena arena, scratch;
    vg_arena_init(&arena, self->memory, size);
    vg_arena_init(&scratch, fit, scratch_size);
    self->road = vg_road_build(&arena, &scratch, &road);
    self->tree = vg_tree_take(&arena, &self->def);
    self->workspace = vg_arena_take(&arena, vg_workspace_size());
    free(fit);
    return self->road != NULL && self->tree != NULL && self->workspace != NULL;
}

static bool crowded(const bench_scene* self, uint32_t count)
{
    const vg_placed* last = &self->placed[count];
    for (uint32_t j = 0; j < count; ++j) {
        const double ds = self->placed[j].s - last->s;
        if (self->placed[j].lane == last->lane && ds < 10.0 && ds > -10.0) {
            return true;
        }
    }
    return false;
}

// Scene number so and so of a seed.
static void fill_scene(bench_scene* self, uint32_t planned, uint64_t seed, uint32_t number)
{
    vg_random random = vg_random_from(number, 6 + seed);
    const uint32_t count = planned + humans;
    for (uint32_t i = 0; i < count; ++i) {
        verge_vehicle* v = &self->vehicles[i];
        vg_placed* at = &self->placed[i];
        do {
            *at = (vg_placed){ .on_road = true,
                               .lane = vg_random_below(&random, lane_total),
                               .s = 100.0 + 0.1 * vg_random_below(&random, 1000) };
        } while (crowded(self, i));
        *v = verge_vehicle_default();
        v->id = (int32_t)i;
        v->controlled = i < planned;
        v->x = at->s;
        v->y = 4.0 * (double)at->lane;
        v->speed = 4.0 + 0.1 * vg_random_below(&random, 40);
        if (v->controlled) {
            const bool left = at->lane == 0 || (at->lane < lane_total - 1 &&
                                                vg_random_below(&random, 2) == 0);
            v->target_lane = (int32_t)at->lane + (left ? 1 : -1);
        }
    }
    vg_model_from(&self->scene, &self->root, &self->def, self->road, &self->sight, self->vehicles,
                  self->placed, count);
}

// ---------------------------------------------------------------------------- search

static double instructions_of(const char* list, uint32_t planned)
{
    for (const char* at = list; at != NULL && *at != '\0';) {
        char* end = NULL;
        const unsigned long k = strtoul(at, &end, 10);
        if (*end != ':') {
            break;
        }
        const double n = strtod(end + 1, &end);
        if (k == planned) {
            return n;
        }
        at = *end == ',' ? end + 1 : NULL;
    }
    return -1.0;
}

static void bench_search(bench_scene* self, const settings* with)
{
    static const uint32_t planned[] = { 2, 3, 4, 6, 8 };
    const uint32_t scenes = with->quick ? 40 : 200;
    printf(" \"search\": [");
    for (size_t row = 0; row < sizeof planned / sizeof planned[0]; ++row) {
        double seconds = 0.0, reward = 0.0;
        for (uint32_t number = 0; number < scenes; ++number) {
            fill_scene(self, planned[row], with->seed, number);
            vg_random random = vg_random_from(with->seed, number);
            const double start = cpu_seconds();
            vg_mcts_run(self->tree, &self->scene, &self->root, &random, NULL, &self->decision);
            seconds += cpu_seconds() - start;
            reward += self->decision.report.reward;
        }
        printf("%s\n  {\"controlled\": %u, \"humans\": %d, \"iterations\": %d,"
               " \"iterations_per_s\": ", row > 0 ? "," : "", planned[row], humans, iterations);
        number_write(stdout, (double)scenes * iterations / seconds);
        printf(", \"instructions_per_iteration\": ");
        const double counted = instructions_of(with->instructions, planned[row]);
        number_write(stdout, counted > 0.0 ? counted : (double)NAN);
        printf(", \"bytes_per_node\": %u, \"reward\": ",
               vg_node_size(self->scene.count, self->scene.controlled_count));
        number_write(stdout, reward / scenes);
        printf("}");
        fflush(stdout);
    }
    printf("],\n");
}

// Exactly one search, so that a counter of instructions sees nothing else that depends on N.
static int count_only(bench_scene* self, const settings* with)
{
    const uint64_t planned = with->only_search;
    const uint64_t budget = with->only_iterations;
    if (planned < 1 || planned > VERGE_CONTROLLED_MAX) {
        fputs("verge-bench:--only-search: out of range, expected 1..16 vehicles\n", stderr);
        return 2;
    }
    if (budget < 1 || budget > 1000000) {
        fputs("verge-bench:--iterations: out of range, expected 1..1000000\n", stderr);
        return 2;
    }
    self->def.iterations = (uint32_t)budget;
    fill_scene(self, (uint32_t)planned, with->seed, 3);
    vg_random random = vg_random_from(with->seed, 3);
    vg_mcts_run(self->tree, &self->scene, &self->root, &random, NULL, &self->decision);
    free(self->memory);
    return self->decision.report.iterations == budget ? 0 : 1;
}

// ---------------------------------------------------------------------------- sampler

static void bench_sampler(bench_scene* self, const settings* with)
{
    enum { others = 8, candidates = 1000 };
    const uint32_t repeats = with->quick ? 200 : 1000;
    fill_scene(self, others + 1 - humans, with->seed, 5);
    vg_random random = vg_random_from(with->seed, 5);
    vg_mcts_run(self->tree, &self->scene, &self->root, &random, NULL, &self->decision);
    vg_predict_tracks(&self->tracks, &self->scene, &self->root, &self->decision, self->vehicles,
                      self->placed, self->scene.count);
    const vg_job job = {
        .def = &self->def, .road = self->road, .vehicle = &self->vehicles[0], .on_road = true,
        .lane = self->placed[0].lane, .s = self->placed[0].s, .target = -1, .track_index = 0,
        .segment_count = 1,
        .segments = { { 0.0, 3.0, VERGE_KEEP_SPEED, self->placed[0].lane,
                        self->placed[0].s + 3.0 * self->vehicles[0].speed, 0.0,
                        self->vehicles[0].speed } },
    };
    const double start = cpu_seconds();
    double checksum = 0.0;
    for (uint32_t k = 0; k < repeats; ++k) {
        checksum += vg_sampler_bench(self->workspace, &job, &self->tracks, candidates);
    }
    const double seconds = cpu_seconds() - start;
    printf(" \"sampler\": [\n  {\"vehicles\": %d, \"points\": %u, \"candidates\": %d, "
           "\"candidates_per_s\": ", others, self->def.points, candidates);
    number_write(stdout, checksum == checksum ? (double)repeats * candidates / seconds : 0.0);
    printf("}],\n");
}

// ---------------------------------------------------------------------------- cycles

static int by_size(const void* a, const void* b)
{
    const double x = *(const double*)a, y = *(const double*)b;
    return (x > y) - (x < y);
}

static const char* const cycle_names[] = { "freeway-4av-2hv", "ramp-case1", "roundabout" };

/// Told before anything is printed: half a document is none.
static bool cycle_scenarios_load(const settings* with)
{
    for (size_t k = 0; k < sizeof cycle_names / sizeof cycle_names[0]; ++k) {
        char     path[4096];
        scenario scene;
        snprintf(path, sizeof path, "%s/%s.json", with->scenarios, cycle_names[k]);
        if (!scenario_load(&scene, path, NULL)) {
            fputs(scene.file.error, stderr);
            return false;
        }
        scenario_free(&scene);
    }
    return true;
}

static void bench_cycle(const settings* with, const char* name, uint32_t repeats, bool first)
{
    static double        ms[cycles_max];
    static verge_plan    plan;
    static verge_vehicle vehicles[VERGE_VEHICLES_MAX];
    char     path[4096];
    scenario scene;
    world    start;
    snprintf(path, sizeof path, "%s/%s.json", with->scenarios, name);
    if (!scenario_load(&scene, path, with->seeded ? &with->seed : NULL)) {
        fputs(scene.file.error, stderr);
        return;
    }
    if (!world_init(&start, &scene)) {
        scenario_free(&scene);
        return;
    }
    const uint32_t count = world_states(&start, vehicles);
    for (uint32_t k = 0; k < repeats; ++k) {
        verge_planner_reset(scene.planner);
        const double from = cpu_seconds();
        (void)verge_planner_step(scene.planner, 0, vehicles, count, &plan);
        ms[k] = 1e3 * (cpu_seconds() - from);
    }
    qsort(ms, repeats, sizeof ms[0], by_size);
    const verge_counters counters = verge_planner_counters(scene.planner);
    printf("%s\n  {\"scenario\": \"%s\", \"vehicles\": %u, \"controlled\": %u, \"ms_p50\": ",
           first ? "" : ",", name, count, plan.vehicle_count);
    number_write(stdout, ms[repeats / 2]);
    printf(", \"ms_p99\": ");
    number_write(stdout, ms[repeats * 99 / 100]);
    printf(", \"ms_max\": ");
    number_write(stdout, ms[repeats - 1]);
    printf(", \"arena_bytes\": %zu, \"arena_peak_bytes\": %zu}", counters.arena_size,
           counters.arena_peak);
    world_free(&start);
    scenario_free(&scene);
}

static void bench_cycles(const settings* with)
{
    printf(" \"cycle\": [");
    for (size_t k = 0; k < sizeof cycle_names / sizeof cycle_names[0]; ++k) {
        bench_cycle(with, cycle_names[k], with->quick ? 100 : cycles_max, k == 0);
        fflush(stdout);
    }
    printf("]\n");
}
