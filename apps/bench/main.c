/// verge-bench: measures the speed of search, sampler and whole cycles; prints one JSON document.
///
/// Search and sampler are measured as stages: verge_decide() and verge_plan_vehicle(). Cycles are
/// calls of verge_planner_step(). Times are CPU times of this thread, which depend less on the load
/// of the machine than wall time. The number of instructions does not depend on it at all:
/// tools/bench-instructions counts them and passes them as an option.
#include "common/data.h"
#include "common/number.h"
#include "common/options.h"
#include "common/output.h"
#include "common/scenario.h"
#include "common/world.h"

#include "base/random.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

enum { humans = 4, iterations = 3000, lane_total = 4, cycles_max = 400 };

// Random four-lane freeway scenes. Every controlled vehicle has the lane beside it as target lane.
typedef struct bench_scene {
    verge_planner_def  def;
    const verge_road*  road;
    verge_decider*     decider;
    verge_predictor*   predictor;
    verge_sampler*     sampler;
    void*              memory[4];  // of the four above
    verge_vehicle      vehicles[VERGE_VEHICLES_MAX];
    verge_lane_position positions[VERGE_VEHICLES_MAX];
    verge_scene        scene;      // with the two arrays above
    verge_vehicle_decision decisions[VERGE_CONTROLLED_MAX];
    verge_decision     decision;   // with the array above
    verge_track        bodies[VERGE_VEHICLES_MAX];
    verge_tracks       tracks;     // with the array above
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

static bool   open_scene(bench_scene* self, const settings* with);
static void   close_scene(bench_scene* self);
static void   decide(bench_scene* self, uint32_t number);
static void   fill_scene(bench_scene* self, uint32_t planned, uint64_t seed, uint32_t number);
static void   bench_search(bench_scene* self, const settings* with);
static void   bench_sampler(bench_scene* self, const settings* with);
static bool   cycle_scenarios_load(const settings* with);
static void   bench_cycles(const settings* with);
static int    print_document(bench_scene* self, const settings* with);
static bool   only_search_holds(const settings* with);
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
    if (with.only && !only_search_holds(&with)) {
        return 2;
    }
    if (!open_scene(&scene, &with)) {
        fputs("verge-bench:memory: out of memory\n", stderr);
        return 1;
    }
    if (with.only) {
        return count_only(&scene, &with);
    }
    if (!cycle_scenarios_load(&with)) {
        return 2;
    }
    status = print_document(&scene, &with);
    close_scene(&scene);
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
    return output_flush("verge-bench") ? 0 : 1;
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

static bool open_scene(bench_scene* self, const settings* with)
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
    self->def.seed = with->seed;
    self->def.iterations = with->only ? (uint32_t)with->only_iterations : iterations;
    self->scene = (verge_scene){ .vehicles_max = VERGE_VEHICLES_MAX, .vehicles = self->vehicles,
                                 .positions = self->positions };
    self->decision = (verge_decision){ .vehicles_max = VERGE_CONTROLLED_MAX,
                                       .vehicles = self->decisions };
    self->tracks = (verge_tracks){ .tracks_max = VERGE_VEHICLES_MAX, .of = self->bodies };
    const size_t sizes[4] = { verge_road_memory_size(&road, NULL),
                              verge_decider_memory_size(&self->def),
                              verge_predictor_memory_size(&self->def),
                              verge_sampler_memory_size(&self->def) };
    for (int i = 0; i < 4; ++i) {
        self->memory[i] = aligned_alloc(64, (sizes[i] + 63) / 64 * 64);
    }
    void* const* memory = self->memory;
    const bool good =
        verge_road_init(&self->road, &road, memory[0], sizes[0]) == VERGE_OK
        && verge_decider_init(&self->decider, &self->def, memory[1], sizes[1]) == VERGE_OK
        && verge_predictor_init(&self->predictor, &self->def, memory[2], sizes[2]) == VERGE_OK
        && verge_sampler_init(&self->sampler, &self->def, memory[3], sizes[3]) == VERGE_OK;
    self->scene.road = self->road;
    return good;
}

static void close_scene(bench_scene* self)
{
    for (int i = 0; i < 4; ++i) {
        free(self->memory[i]);
    }
}

static bool crowded(const verge_vehicle* vehicles, uint32_t count)
{
    const verge_vehicle* last = &vehicles[count];
    for (uint32_t j = 0; j < count; ++j) {
        const double ds = vehicles[j].x - last->x;
        if (vehicles[j].y == last->y && ds < 10.0 && ds > -10.0) {
            return true;
        }
    }
    return false;
}

// The scene of this number and seed.
static void fill_scene(bench_scene* self, uint32_t planned, uint64_t seed, uint32_t number)
{
    static verge_vehicle vehicles[VERGE_VEHICLES_MAX];
    vg_random random = vg_random_from(number, 6 + seed);
    const uint32_t count = planned + humans;
    for (uint32_t i = 0; i < count; ++i) {
        verge_vehicle* v = &vehicles[i];
        uint32_t lane = 0;
        *v = verge_vehicle_default();
        do {
            lane = vg_random_below(&random, lane_total);
            v->x = 100.0 + 0.1 * vg_random_below(&random, 1000);
            v->y = 4.0 * (double)lane;
        } while (crowded(vehicles, i));
        v->id = (int32_t)i;
        v->controlled = i < planned;
        v->speed = 4.0 + 0.1 * vg_random_below(&random, 40);
        if (v->controlled) {
            const bool left =
                lane == 0 || (lane < lane_total - 1 && vg_random_below(&random, 2) == 0);
            v->target_lane = (int32_t)lane + (left ? 1 : -1);
        }
    }
    (void)verge_scene_place(&self->scene, 0, vehicles, count, NULL);
}

// A decision without a previous one; the search uses random stream `number`.
static void decide(bench_scene* self, uint32_t number)
{
    verge_commitment commitment = { .decisions = number };
    (void)verge_decide(self->decider, &self->scene, &commitment, &self->decision);
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
        if (planned[row] > VERGE_CONTROLLED_MAX || planned[row] + humans > VERGE_VEHICLES_MAX) {
            break; // a small configuration
        }
        double seconds = 0.0, reward = 0.0;
        for (uint32_t number = 0; number < scenes; ++number) {
            fill_scene(self, planned[row], with->seed, number);
            const double start = cpu_seconds();
            decide(self, number);
            seconds += cpu_seconds() - start;
            reward += self->decision.search.reward;
        }
        printf("%s\n  {\"controlled\": %u, \"humans\": %d, \"iterations\": %d,"
               " \"iterations_per_s\": ", row > 0 ? "," : "", planned[row], humans, iterations);
        number_write(stdout, (double)scenes * iterations / seconds);
        printf(", \"instructions_per_iteration\": ");
        const double counted = instructions_of(with->instructions, planned[row]);
        number_write(stdout, counted > 0.0 ? counted : (double)NAN);
        uint32_t nodes_peak = 0, bytes_per_node = 0;
        verge_decider_nodes(self->decider, &nodes_peak, &bytes_per_node);
        printf(", \"bytes_per_node\": %u, \"reward\": ", bytes_per_node);
        number_write(stdout, reward / scenes);
        printf("}");
        fflush(stdout);
    }
    printf("],\n");
}

static bool only_search_holds(const settings* with)
{
    if (with->only_search < 1 || with->only_search > VERGE_CONTROLLED_MAX) {
        fprintf(stderr, "verge-bench:--only-search: out of range, expected 1..%d vehicles\n",
                VERGE_CONTROLLED_MAX);
        return false;
    }
    if (with->only_iterations < 1 || with->only_iterations > 1000000) {
        fputs("verge-bench:--iterations: out of range, expected 1..1000000\n", stderr);
        return false;
    }
    return true;
}

// Exactly one search, so that a counter of instructions sees nothing else that depends on N.
static int count_only(bench_scene* self, const settings* with)
{
    fill_scene(self, (uint32_t)with->only_search, with->seed, 3);
    decide(self, 3);
    close_scene(self);
    return self->decision.search.iterations == with->only_iterations ? 0 : 1;
}

// ---------------------------------------------------------------------------- sampler

// Whole trajectories of one vehicle among eight others; their candidates are counted.
static void bench_sampler(bench_scene* self, const settings* with)
{
    enum { // fewer others in a small configuration
        most_planned = VERGE_VEHICLES_MAX - humans < VERGE_CONTROLLED_MAX ? VERGE_VEHICLES_MAX - humans
                                                                          : VERGE_CONTROLLED_MAX,
        others = humans + (most_planned < 5 ? most_planned : 5) - 1,
    };
    const uint32_t repeats = with->quick ? 2000 : 10000;
    static verge_vehicle_plan plan;
    fill_scene(self, others + 1 - humans, with->seed, 5);
    decide(self, 5);
    (void)verge_predict(self->predictor, &self->scene, &self->decision, &self->tracks);
    const double start = cpu_seconds();
    for (uint32_t k = 0; k < repeats; ++k) {
        (void)verge_plan_vehicle(self->sampler, &self->scene, &self->decisions[0], &self->tracks,
                                 NULL,
                                 &plan);
    }
    const double seconds = cpu_seconds() - start;
    const double candidates = (double)verge_sampler_candidates(self->sampler);
    printf(" \"sampler\": [\n  {\"vehicles\": %d, \"points\": %u, \"candidates\": %.0f, "
           "\"candidates_per_s\": ", others, self->def.points, candidates / repeats);
    number_write(stdout, candidates / seconds);
    printf("}],\n");
}

// ---------------------------------------------------------------------------- cycles

static int by_size(const void* a, const void* b)
{
    const double x = *(const double*)a, y = *(const double*)b;
    return (x > y) - (x < y);
}

static const char* const cycle_names[] = { "freeway-4av-2hv", "ramp-case1", "roundabout" };

/// Checks the scenarios before the first output, so that no incomplete document is printed.
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
