/// Goal: a reload runs in a thread of its own and takes effect when the caller installs it. Reloads
/// requested meanwhile run once after it. A wrong configuration leaves the one in effect unchanged.
/// Method: real configurations on loop:, written by the tests; the work of the caller is measured
/// in processor time, which does not depend on the load of the machine.
#define _GNU_SOURCE
#include "check.h"

#include "rsu/config.h"

#include "daemon/reload.h"

#include <fcntl.h>
#include <poll.h>
#include <stdio.h>
#include <stdlib.h>
#include <time.h>
#include <unistd.h>

enum { PATIENCE_S = 300, LANES = 8, POINTS = 500 };

static char folder[] = "/tmp/verge-reload-XXXXXX";
static char path[64];

/// One lane of two points, or many of many.
static void write_road(FILE* out, bool large)
{
    const int lanes = large ? LANES : 1, points = large ? POINTS : 2;
    fprintf(out, "{ \"lanes\": [");
    for (int lane = 0; lane < lanes; ++lane) {
        fprintf(out, "%s{ \"id\": %d, \"width\": 3.5, \"speed_limit\": 20, \"left\": null, "
                "\"right\": null, \"centerline\": [", lane == 0 ? "" : ", ", lane);
        for (int i = 0; i < points; ++i) {
            fprintf(out, "%s[%d, %d]", i == 0 ? "" : ", ", i * 1000 / (points - 1), lane * 50);
        }
        fprintf(out, "] }");
    }
    fprintf(out, "] }");
}

static void write_config(int rsu_id, const char* bus, bool large, const char* planner)
{
    FILE* out = fopen(path, "w");
    assert_non_null(out);
    fprintf(out, "{ \"format\": \"verge-rsu/1\", \"rsu_id\": %d, \"bus\": \"%s\", "
            "\"planner\": { %s }, \"road\": ", rsu_id, bus, planner);
    write_road(out, large);
    fprintf(out, " }\n");
    fclose(out);
}

static const setup_def DEF = { .path = path, .site = &CONFIG_DEF, .bus_use = CONFIG_BUS_USE };

static void load(setup* now)
{
    char error[CONFIG_ERROR_SIZE];
    memset(now, 0, sizeof *now);
    if (setup_load(now, &DEF, error) != 0 || setup_plan(now, &DEF, error) != 0 ||
        setup_connect(now, &DEF, error) != 0) {
        fail_msg("%s", error);
    }
}

static int rsu_id_of(const setup* self)
{
    return config_of(self->site)->rsu_id;
}

static void open_both(setup* now, reloader* self)
{
    load(now);
    const reloader_def def = { .setup = DEF, .now = now };
    assert_true(reloader_open(self, &def));
}

static void close_both(setup* now, reloader* self)
{
    reloader_close(self);
    setup_free(now);
}

static reload_result wait_for_result(reloader* self)
{
    for (;;) {
        struct pollfd end = { .fd = reloader_fd(self), .events = POLLIN };
        assert_int_equal(poll(&end, 1, PATIENCE_S * 1000), 1);
        const reload_result result = reloader_collect(self);
        if (result != RELOAD_PENDING) {
            return result;
        }
    }
}

/// Until nothing is under way: accepted ones are installed.
static unsigned settle(reloader* self)
{
    unsigned installed = 0;
    while (self->phase != RELOAD_IDLE) {
        if (reloader_next(self) != NULL) {
            reloader_install(self);
            ++installed;
            continue;
        }
        struct pollfd end = { .fd = reloader_fd(self), .events = POLLIN };
        assert_int_equal(poll(&end, 1, PATIENCE_S * 1000), 1);
        reloader_collect(self);
    }
    return installed;
}

static void test_a_good_configuration_takes_effect_when_it_is_installed(void** state)
{
    (void)state;
    static setup now;
    static reloader self;
    write_config(1, "loop:", false, "");
    open_both(&now, &self);
    const site* before = now.site;
    transport*    bus = now.buses.bus[0];

    write_config(2, "loop:", false, "\"iterations\": 99, \"threads\": 2");
    const uint64_t ticket = reloader_ask(&self);
    assert_int_equal(reloader_answer(&self, ticket), RELOAD_PENDING);
    assert_true(reloader_busy(&self));
    assert_int_equal(wait_for_result(&self), RELOAD_ACCEPTED);
    assert_int_equal(reloader_answer(&self, ticket), RELOAD_ACCEPTED);
    assert_false(reloader_settled(&self));
    assert_ptr_equal(now.site, before); // still
    assert_int_equal(rsu_id_of(&now), 1);
    assert_int_equal(rsu_id_of(reloader_next(&self)), 2);

    reloader_install(&self);
    assert_int_equal(rsu_id_of(&now), 2);
    assert_int_equal(now.site->planner.iterations, 99);
    assert_non_null(now.planner.helpers);
    assert_ptr_equal(now.buses.bus[0], bus); // the same URL: not opened again
    assert_null(reloader_next(&self));
    assert_true(reloader_settled(&self));
    assert_int_equal(settle(&self), 0);
    assert_int_equal(reloader_answer(&self, ticket), RELOAD_ACCEPTED);
    close_both(&now, &self);
}

static void test_a_wrong_configuration_is_refused_with_the_reason_and_changes_nothing(void** state)
{
    (void)state;
    static setup now;
    static reloader self;
    write_config(1, "loop:", false, "");
    open_both(&now, &self);
    const site* before = now.site;
    const verge_planner* planner = now.planner.planner;
    static const struct { const char *bus, *planner, *reason; } CASES[] = {
        { "loop:", "\"bogus\": 1", "bogus" },
        { "loop:", "\"vehicles_max\": 16", "restarted" },
        { "tcp:1", "", "bus" },
        { "log:/none/here", "", "/none/here" },
    };
    for (size_t i = 0; i < sizeof CASES / sizeof CASES[0]; ++i) {
        write_config(2, CASES[i].bus, false, CASES[i].planner);
        const uint64_t ticket = reloader_ask(&self);
        assert_int_equal(wait_for_result(&self), RELOAD_REFUSED);
        assert_int_equal(reloader_answer(&self, ticket), RELOAD_REFUSED);
        assert_non_null(strstr(self.error, CASES[i].reason));
        assert_null(reloader_next(&self));
        assert_true(reloader_settled(&self));
        assert_ptr_equal(now.site, before);
        assert_ptr_equal(now.planner.planner, planner);
    }
    unlink(path);
    reloader_ask(&self);
    assert_int_equal(wait_for_result(&self), RELOAD_REFUSED);
    write_config(3, "loop:", false, "");
    reloader_ask(&self);
    assert_int_equal(wait_for_result(&self), RELOAD_ACCEPTED); // it works again
    assert_int_equal(settle(&self), 1);
    assert_int_equal(rsu_id_of(&now), 3);
    close_both(&now, &self);
}

static void test_reloads_requested_during_a_reload_run_once_after_it(void** state)
{
    (void)state;
    static setup now;
    static reloader self;
    write_config(1, "loop:", false, "");
    open_both(&now, &self);
    write_config(2, "loop:", false, "");
    const uint64_t first = reloader_ask(&self);
    uint64_t second = 0;
    for (int i = 0; i < 5; ++i) {
        const uint64_t ticket = reloader_ask(&self);
        assert_true(ticket > first && (second == 0 || ticket == second));
        second = ticket;
    }
    assert_int_equal(wait_for_result(&self), RELOAD_ACCEPTED);
    assert_int_equal(reloader_answer(&self, first), RELOAD_ACCEPTED);
    assert_int_equal(reloader_answer(&self, second), RELOAD_PENDING);
    write_config(3, "loop:", false, ""); // read for the second one
    assert_int_equal(reloader_ask(&self), second);
    assert_int_equal(settle(&self), 2);
    assert_int_equal(self.ended, 2);
    assert_int_equal(reloader_answer(&self, second), RELOAD_ACCEPTED);
    assert_int_equal(rsu_id_of(&now), 3);

    write_config(4, "loop:", false, "\"bogus\": 1"); // a refused one holds up none
    reloader_ask(&self);
    reloader_ask(&self);
    assert_int_equal(wait_for_result(&self), RELOAD_REFUSED);
    assert_false(reloader_settled(&self));
    assert_int_equal(settle(&self), 0);
    assert_int_equal(self.ended, 4);
    close_both(&now, &self);
}

static void test_other_buses_go_on_counting(void** state)
{
    (void)state;
    static setup now;
    static reloader self;
    write_config(1, "loop:a", false, "");
    open_both(&now, &self);
    const verge_rsu_status_t status = { .rsu_id = 1 };
    buses_publish(&now.buses, TRANSPORT_STATUS, &status);
    write_config(1, "loop:b", false, "");
    reloader_ask(&self);
    assert_int_equal(wait_for_result(&self), RELOAD_ACCEPTED);
    assert_int_equal(settle(&self), 1);
    buses_publish(&now.buses, TRANSPORT_STATUS, &status);
    assert_int_equal(buses_statistics(&now.buses).published, 2);
    close_both(&now, &self);
}

static double processor_s(clockid_t clock)
{
    struct timespec used;
    clock_gettime(clock, &used);
    return (double)used.tv_sec + (double)used.tv_nsec * 1e-9;
}

static void test_a_reload_uses_no_processor_time_of_the_caller(void** state)
{
    (void)state;
    static setup now;
    static reloader self;
    write_config(1, "loop:", true, "");
    open_both(&now, &self);
    const double process = processor_s(CLOCK_PROCESS_CPUTIME_ID);
    const double caller = processor_s(CLOCK_THREAD_CPUTIME_ID);
    for (int i = 0; i < 5; ++i) {
        reloader_ask(&self);
        assert_int_equal(wait_for_result(&self), RELOAD_ACCEPTED);
        assert_int_equal(settle(&self), 1);
    }
    const double ours = processor_s(CLOCK_THREAD_CPUTIME_ID) - caller;
    const double all = processor_s(CLOCK_PROCESS_CPUTIME_ID) - process;
    CHECK_AT_MOST(ours, 0.1 * all);
    close_both(&now, &self);
}

static void test_closing_ends_running_and_waiting_jobs(void** state)
{
    (void)state;
    static setup now;
    static reloader self;
    write_config(1, "loop:", false, "");
    open_both(&now, &self);
    reloader_ask(&self);
    close_both(&now, &self); // under way
    open_both(&now, &self);
    reloader_ask(&self);
    assert_int_equal(wait_for_result(&self), RELOAD_ACCEPTED);
    close_both(&now, &self); // waits to be installed
    reloader_close(&self); // closed already
}

static int make_folder(void** state)
{
    (void)state;
    alarm(PATIENCE_S);
    const bool made = mkdtemp(folder) != NULL;
    snprintf(path, sizeof path, "%s/rsu.json", folder);
    return made ? 0 : -1;
}

static int remove_folder(void** state)
{
    (void)state;
    unlink(path);
    return rmdir(folder);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_a_good_configuration_takes_effect_when_it_is_installed),
        cmocka_unit_test(test_a_wrong_configuration_is_refused_with_the_reason_and_changes_nothing),
        cmocka_unit_test(test_reloads_requested_during_a_reload_run_once_after_it),
        cmocka_unit_test(test_other_buses_go_on_counting),
        cmocka_unit_test(test_a_reload_uses_no_processor_time_of_the_caller),
        cmocka_unit_test(test_closing_ends_running_and_waiting_jobs),
    };
    return cmocka_run_group_tests(tests, make_folder, remove_folder);
}
