/// Goal: a log gives the same plans at every replay, at multiples of the cycle, and a
/// difference is found at the cycle where it begins.
/// Method: logs written here, of vehicles that drive straight ahead, with and without the daemon's
/// marks; replayed with one thread and with three.
#include "check.h"

#include "rsu/replay.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <unistd.h>

static const int64_t EPOCH = 1700000000000000; // [us] a multiple of every cycle_ms used here
enum { PERIOD_US = 200000, LINES_MAX = 400 };

typedef struct line {
    int64_t  cycle, utime;
    uint64_t digest;
    unsigned vehicles;
} line;

typedef struct outcome {
    int           code;
    replay_report report;
    uint32_t      count;
    line          lines[LINES_MAX];
} outcome;

static char folder[] = "/tmp/verge-replay-XXXXXX";

static const char* path_of(const char* name)
{
    static char paths[4][128]; // the last four asked for stay valid
    static unsigned next;
    char* path = paths[next++ % 4];
    snprintf(path, sizeof paths[0], "%s/%s", folder, name);
    return path;
}

static site* config_with(uint32_t threads)
{
    const char* path = path_of("rsu.json");
    FILE* file = fopen(path, "w");
    assert_non_null(file);
    fprintf(file,
            "{\"format\": \"verge-rsu/1\", \"bus\": \"loop:\", \"cycle_ms\": %d, \"road\": "
            "{\"lanes\": [{\"id\": 0, \"centerline\": [[0, 0], [900, 0]], \"width\": 3.75, "
            "\"speed_limit\": 20, \"left\": 1, \"right\": null}, {\"id\": 1, \"centerline\": "
            "[[0, 3.75], [900, 3.75]], \"width\": 3.75, \"speed_limit\": 20, \"left\": null, "
            "\"right\": 0}]}, \"planner\": {\"iterations\": 40, \"nodes_max\": 64, \"threads\": "
            "%u, \"sample_speeds\": 3, \"sample_offsets\": 8}}",
            PERIOD_US / 1000, threads);
    fclose(file);
    char error[CONFIG_ERROR_SIZE];
    site* loaded = NULL;
    if (site_load(&loaded, &CONFIG_DEF, path, error) != 0) {
        fail_msg("%s", error);
    }
    return loaded;
}

static verge_vehicle_state_t state_at(int32_t id, int64_t utime)
{
    const double t = (double)(utime - EPOCH) * 1e-6;
    verge_vehicle vehicle = verge_vehicle_default();
    vehicle.id = id;
    vehicle.controlled = true;
    vehicle.x = 20.0 + 40.0 * id + fmod(10.0 * t, 500.0);
    vehicle.y = id % 2 == 0 ? 0.0 : 3.75;
    vehicle.speed = 10.0;
    vehicle.target_lane = 0;
    return wire_state_from_vehicle(&vehicle, VERGE_NORMAL, utime, 0, -1);
}

static transport* log_open(const char* name)
{
    char url[160], error[256];
    transport* log = NULL;
    snprintf(url, sizeof url, "log:%s", path_of(name));
    assert_int_equal(transport_open(&log, url, TRANSPORT_RECORD, error, sizeof error), 0);
    return log;
}

static void log_state(transport* log, int32_t id, int64_t utime, int64_t arrival)
{
    static transport_message message;
    message.kind = TRANSPORT_STATE;
    message.as.state = state_at(id, utime);
    assert_int_equal(transport_record(log, arrival, &message), 0);
}

static outcome* replay(const site* config, const char* name, const char* record)
{
    static outcome results[3]; // the last three stay valid
    static unsigned next;
    outcome* result = &results[next++ % 3];
    memset(result, 0, sizeof *result);
    FILE* out = tmpfile();
    assert_non_null(out);
    char error[CONFIG_ERROR_SIZE];
    const replay_options options = { .log_path = path_of(name), .record_path = record, .out = out };
    result->code = replay_run(&options, config_of(config), &result->report, error);
    rewind(out);
    line* at = result->lines;
    while (result->count < LINES_MAX &&
           fscanf(out,
                  "{\"cycle\":%" SCNd64 ",\"utime\":%" SCNd64 ",\"digest\":\"%" SCNx64
                  "\",\"vehicles\":%u}\n",
                  &at->cycle, &at->utime, &at->digest, &at->vehicles) == 4) {
        ++result->count;
        ++at;
    }
    fclose(out);
    assert_int_equal(result->code, 0);
    assert_int_equal(result->report.cycles, result->count);
    return result;
}

/// Three vehicles at 10 Hz, arriving 7 ms after their fix, from `from` for `seconds`.
static void log_drive(transport* log, int64_t from, int seconds)
{
    for (int tick = 0; tick < 10 * seconds; ++tick) {
        for (int32_t id = 0; id < 3; ++id) {
            const int64_t utime = from + tick * 100000;
            log_state(log, id, utime, utime + 7000 + id);
        }
    }
}

static void test_a_foreign_log_is_planned_at_multiples_of_the_cycle(void** state)
{
    (void)state;
    site* config = config_with(1);
    transport* log = log_open("foreign.log");
    log_drive(log, EPOCH + 30000, 4);
    transport_close(log);

    const outcome* result = replay(config, "foreign.log", NULL);
    // First state at 37 ms, last at 3.939 s: from 0.2 s to 4.0 s.
    assert_int_equal(result->count, 20);
    for (uint32_t i = 0; i < result->count; ++i) {
        assert_int_equal(result->lines[i].cycle, i);
        assert_true(result->lines[i].utime == EPOCH + (int64_t)(i + 1) * PERIOD_US);
        assert_int_equal(result->lines[i].vehicles, 3);
        assert_true(result->lines[i].digest != 0);
    }
    const outcome* again = replay(config, "foreign.log", NULL);
    assert_memory_equal(result->lines, again->lines, sizeof result->lines);
    site_free(config);
}

static void test_threads_do_not_change_a_digest(void** state)
{
    (void)state;
    site* one = config_with(1);
    site* three = config_with(3);
    const outcome* alone = replay(one, "foreign.log", NULL);
    const outcome* together = replay(three, "foreign.log", NULL);
    assert_int_equal(alone->count, 20);
    assert_memory_equal(alone->lines, together->lines, sizeof alone->lines);
    site_free(one);
    site_free(three);
}

static void test_a_state_that_arrives_at_a_cycle_belongs_to_it(void** state)
{
    (void)state;
    site* config = config_with(1);
    transport* log = log_open("edge.log");
    log_state(log, 0, EPOCH + PERIOD_US - 5000, EPOCH + PERIOD_US);
    log_state(log, 1, EPOCH + PERIOD_US - 5000, EPOCH + PERIOD_US + 1);
    transport_close(log);
    const outcome* result = replay(config, "edge.log", NULL);
    assert_int_equal(result->count, 2);
    assert_true(result->lines[0].utime == EPOCH + PERIOD_US);
    assert_int_equal(result->lines[0].vehicles, 1);
    assert_int_equal(result->lines[1].vehicles, 2);
    site_free(config);
}

static void test_a_long_silence_is_left_out(void** state)
{
    (void)state;
    site* config = config_with(1);
    transport* log = log_open("gap.log");
    log_drive(log, EPOCH, 1);
    log_drive(log, EPOCH + 86400000000, 1); // a day later
    transport_close(log);
    const outcome* result = replay(config, "gap.log", NULL);
    // A second with vehicles, 2.2 s until they are forgotten, a second with vehicles.
    CHECK_BETWEEN(result->count, 15, 30);
    assert_true(result->lines[result->count - 1].utime >= EPOCH + 86400000000);
    assert_int_equal(result->lines[result->count - 1].vehicles, 3);
    site_free(config);
}

static void test_a_recorded_replay_replays_to_the_same_digests(void** state)
{
    (void)state;
    site* config = config_with(1);
    const outcome* first = replay(config, "foreign.log", path_of("marked.log"));
    const outcome* second = replay(config, "marked.log", NULL);
    assert_memory_equal(first->lines, second->lines, sizeof first->lines);
    assert_int_equal(second->report.compared, 20);
    assert_false(second->report.differs);
    site_free(config);
}

/// What goes out when a cycle is late and no plan is left.
static void log_fallback(transport* log, int32_t number, int64_t utime)
{
    const wire_plan_header header = { .utime = utime, .cycle = number };
    static transport_message message;
    message.kind = TRANSPORT_PLAN;
    message.as.plan = wire_plan_cancelled(&header, 0, VERGE_REASON_OVERRUN);
    message.as.plan.status = VERGE_FALLBACK_BRAKE;
    assert_int_equal(transport_record(log, utime, &message), 0);
}

/// Copies marked.log, with a change at one cycle's plans.
static void copy_changed(const char* name, int64_t cycle, bool drop)
{
    static transport_message batch[16];
    char url[160], error[256];
    transport *from = NULL, *to = log_open(name);
    snprintf(url, sizeof url, "log:%s", path_of("marked.log"));
    const unsigned all = TRANSPORT_STATES | TRANSPORT_PLANS | TRANSPORT_MARKS;
    assert_int_equal(transport_open(&from, url, all, error, sizeof error), 0);
    bool dropped = false;
    while (!transport_ended(from)) {
        const uint32_t count = transport_drain(from, batch, 16);
        for (uint32_t i = 0; i < count; ++i) {
            const bool here = batch[i].kind == TRANSPORT_PLAN && batch[i].as.plan.cycle == cycle;
            if (here && drop && !dropped) {
                dropped = true;
                continue;
            }
            batch[i].as.plan.digest ^= here && !drop ? 1 : 0;
            assert_int_equal(transport_record(to, batch[i].arrival_utime, &batch[i]), 0);
            if (batch[i].kind == TRANSPORT_MARK) { // and each cycle came late, it says
                const int64_t number = batch[i].as.mark.cycle;
                batch[i].as.mark.overrun = 1;
                assert_int_equal(transport_record(to, batch[i].arrival_utime, &batch[i]), 0);
                log_fallback(to, (int32_t)number, batch[i].arrival_utime + 1000);
            }
        }
    }
    transport_close(from);
    transport_close(to);
}

static void test_the_first_cycle_that_differs_is_named(void** state)
{
    (void)state;
    site* config = config_with(1);
    copy_changed("same.log", -1, false);
    assert_false(replay(config, "same.log", NULL)->report.differs);

    copy_changed("digest.log", 11, false);
    const outcome* result = replay(config, "digest.log", NULL);
    assert_true(result->report.differs);
    assert_int_equal(result->report.differs_cycle, 11);
    assert_true(result->report.recorded_digest == (result->report.replayed_digest ^ 1));

    copy_changed("lost.log", 5, true);
    result = replay(config, "lost.log", NULL);
    assert_true(result->report.differs && result->report.count_differs);
    assert_int_equal(result->report.differs_cycle, 5);
    site_free(config);
}

static void test_a_log_cut_off_anywhere_replays_up_to_there(void** state)
{
    (void)state;
    site* config = config_with(1);
    static outcome whole; // a copy: more replays follow than stay valid
    whole = *replay(config, "marked.log", NULL);
    FILE* file = fopen(path_of("marked.log"), "rb");
    assert_non_null(file);
    static char bytes[1 << 20];
    const size_t size = fread(bytes, 1, sizeof bytes, file);
    fclose(file);
    assert_true(size > 1000 && size < sizeof bytes);
    for (size_t cut = 0; cut < size; cut += size / 7 + 1) {
        file = fopen(path_of("cut.log"), "wb");
        assert_int_equal(fwrite(bytes, 1, cut, file), cut);
        fclose(file);
        const outcome* part = replay(config, "cut.log", NULL);
        assert_true(part->count <= whole.count);
        assert_memory_equal(part->lines, whole.lines, part->count * sizeof part->lines[0]);
        assert_false(part->report.differs);
    }
    site_free(config);
}

static int make_folder(void** state)
{
    (void)state;
    return mkdtemp(folder) == NULL ? -1 : 0;
}

static int remove_folder(void** state)
{
    (void)state;
    static const char* const NAMES[] = { "rsu.json",  "foreign.log", "gap.log",  "marked.log",
                                         "same.log",  "digest.log",  "lost.log", "cut.log",
                                         "edge.log" };
    for (unsigned i = 0; i < sizeof NAMES / sizeof NAMES[0]; ++i) {
        remove(path_of(NAMES[i]));
    }
    return rmdir(folder);
}

int main(void)
{
    const struct CMUnitTest tests[] = { // in this order: later ones read what earlier ones wrote
        cmocka_unit_test(test_a_foreign_log_is_planned_at_multiples_of_the_cycle),
        cmocka_unit_test(test_threads_do_not_change_a_digest),
        cmocka_unit_test(test_a_state_that_arrives_at_a_cycle_belongs_to_it),
        cmocka_unit_test(test_a_long_silence_is_left_out),
        cmocka_unit_test(test_a_recorded_replay_replays_to_the_same_digests),
        cmocka_unit_test(test_the_first_cycle_that_differs_is_named),
        cmocka_unit_test(test_a_log_cut_off_anywhere_replays_up_to_there),
    };
    return cmocka_run_group_tests(tests, make_folder, remove_folder);
}
