/// Goal: every active fault is listed, the worst first, in the status message, in the metrics and
/// in the text. A fault ends when its time is over, a lasting one when it is cleared. Every counter
/// without a field in the status message is in the answers for operators.
/// Method: all 256 sets of faults; the test supplies the time.
#include "check.h"

#include "rsu/report.h"
#include "rsu/status.h"

#include "common/json.h"
#include "common/message_json.h"
#include "daemon/operators.h"

#include <stdio.h>

enum { SETS = 1 << (RSU_FAULT_COUNT - 1) };

/// Faults 1, 2, ... of the bits 0, 1, ... of set.
static status with_faults(unsigned set, int64_t now)
{
    status self = { .start_utime = 1 };
    for (int fault = 1; fault < RSU_FAULT_COUNT; ++fault) {
        if ((set >> (fault - 1) & 1) != 0) {
            status_fault(&self, (rsu_fault)fault, now, false);
        }
    }
    return self;
}

static void test_every_active_fault_is_listed_the_worst_first(void** state)
{
    (void)state;
    for (unsigned set = 0; set < SETS; ++set) {
        const status self = with_faults(set, 1000);
        const uint32_t faults = status_faults(&self, 2000);
        assert_int_equal(faults, set << 1);
        char names[RSU_FAULTS_SIZE], expected[RSU_FAULTS_SIZE] = "";
        rsu_fault_names(faults, names);
        rsu_fault worst = RSU_FAULT_NONE;
        for (int fault = RSU_FAULT_COUNT - 1; fault > 0; --fault) {
            if ((faults >> fault & 1) != 0) {
                worst = worst == RSU_FAULT_NONE ? (rsu_fault)fault : worst;
                strcat(expected, expected[0] != '\0' ? "," : "");
                strcat(expected, rsu_fault_name((rsu_fault)fault));
            }
        }
        assert_string_equal(names, set == 0 ? "none" : expected);
        assert_int_equal(status_worst(&self, 2000), worst);
        assert_int_equal(status_state(&self, 2000), set == 0 ? RSU_WAITING : RSU_DEGRADED);
    }
}

static void test_programs_get_the_same_list(void** state)
{
    (void)state;
    static config config = { .site = { .cycle_ms = 500 } };
    static cycle  cycle;
    static peers  peers;
    static char   bytes[REPORT_SIZE];
    for (unsigned set = 0; set < SETS; ++set) {
        const status self = with_faults(set, 0);
        report_input from = { .config = &config, .cycle = &cycle, .peers = &peers,
                              .log_dropped = 7, .record_dropped = 8, .faults = status_faults(&self, 1) };
        from.status = status_message(&self, &config, &cycle, &from.bus, 1, 1);
        text out = text_in(bytes, sizeof bytes);
        report_status(&out, &from);
        json_file file;
        assert_true(json_file_parse(&file, "status", out.bytes, out.size));
        const json_at root = json_root(&file);
        const json_at faults = json_member(&root, "faults");
        assert_string_equal(json_string(&root, "fault"), message_rsu_fault(from.status.fault));
        assert_int_equal(json_integer(&root, "log_dropped", 0, 100), 7);
        assert_int_equal(json_integer(&root, "record_dropped", 0, 100), 8);
        const cJSON* name = faults.node->child;
        for (int fault = RSU_FAULT_COUNT - 1; fault > 0; --fault) {
            if ((set >> (fault - 1) & 1) != 0) {
                assert_string_equal(name->valuestring, message_rsu_fault(fault));
                name = name->next;
            }
        }
        assert_null(name);
        json_file_free(&file);

        out = text_in(bytes, OPERATORS_PAGE_SIZE);
        report_metrics(&out, &from);
        assert_false(out.cut);
        for (int fault = 1; fault < RSU_FAULT_COUNT; ++fault) {
            char line[80];
            snprintf(line, sizeof line, "\nverge_fault_active{fault=\"%s\"} %u\n",
                     message_rsu_fault(fault), set >> (fault - 1) & 1);
            assert_non_null(strstr(bytes, line));
        }
        assert_non_null(strstr(bytes, "\nverge_log_dropped_total 7\n"));
        assert_non_null(strstr(bytes, "\nverge_record_dropped_total 8\n"));
    }
}

static void test_counters_without_a_field_in_the_message_are_in_the_answers(void** state)
{
    (void)state;
    static config config = { .site = { .cycle_ms = 500 } };
    static cycle  cycle;
    static peers  peers;
    static char   bytes[REPORT_SIZE];
    report_input from = { .config = &config, .cycle = &cycle, .peers = &peers };
    const struct { const char* name; uint64_t* value; } counters[] = {
        { "cycles_planned", &cycle.counters.planned },
        { "cycles_refused", &cycle.counters.refused },
        { "overruns", &cycle.counters.overruns },
        { "plans_cancelled", &cycle.counters.cancelled },
        { "messages_withheld", &cycle.counters.withheld },
        { "vehicles_unusable", &cycle.counters.unusable },
        { "reordered", &cycle.counters.reordered },
        { "unstuck", &cycle.counters.unstuck },
        { "states_unknown_target", &cycle.inbox.counters.unknown_target },
        { "states_incomplete", &cycle.inbox.counters.incomplete },
        { "candidates", &cycle.counters.candidates },
        { "unexpanded", &cycle.counters.unexpanded },
        { "bus_received", &from.bus.received },
        { "bus_published", &from.bus.published },
        { "bus_foreign", &from.bus.foreign },
        { "bus_errors", &from.bus.errors },
        { "bus_lost", &from.bus.lost },
    };
    enum { COUNT = sizeof counters / sizeof counters[0] };
    for (uint64_t i = 0; i < COUNT; ++i) {
        *counters[i].value = 5000000000u + i; // more than 32 bits
    }
    from.bus.refused[TRANSPORT_REPLAYED] = 3;

    text out = text_in(bytes, sizeof bytes);
    report_status(&out, &from);
    json_file file;
    assert_true(json_file_parse(&file, "status", out.bytes, out.size));
    const json_at root = json_root(&file);
    const json_at told = json_member(&root, "counters");
    assert_int_equal(cJSON_GetArraySize(told.node), COUNT);
    for (uint64_t i = 0; i < COUNT; ++i) {
        assert_int_equal(json_integer(&told, counters[i].name, 0, INT64_MAX / 2), 5000000000u + i);
    }
    const json_at strangers = json_member(&root, "strangers");
    assert_int_equal(json_integer(&strangers, transport_refusal_name(TRANSPORT_REPLAYED), 0, 9), 3);
    json_file_free(&file);

    out = text_in(bytes, OPERATORS_PAGE_SIZE);
    report_metrics(&out, &from);
    assert_false(out.cut);
    for (uint64_t i = 0; i < COUNT; ++i) {
        char line[100];
        snprintf(line, sizeof line, "\nverge_%s_total %llu\n", counters[i].name,
                 5000000000llu + i);
        assert_non_null(strstr(bytes, line));
        snprintf(line, sizeof line, "\n# TYPE verge_%s_total counter\n", counters[i].name);
        assert_non_null(strstr(bytes, line));
    }
}

static void test_operators_see_other_units_and_whether_this_one_stands_by(void** state)
{
    (void)state;
    static config config = { .site = { .cycle_ms = 500 }, .rsu_id = 4 };
    static cycle  cycle;
    static peers  peers;
    static char   bytes[REPORT_SIZE];
    const peers_def def = { .rsu_id = 4, .start_utime = 90, .period_us = 500000 };
    peers_init(&peers, &def);
    static transport_message message = { .kind = TRANSPORT_STATUS };
    const verge_rsu_status_t others[] = { { .rsu_id = 4, .start_utime = 80, .utime = 1000 },
                                          { .rsu_id = 6, .start_utime = 70, .utime = 1000 } };
    for (int i = 0; i < 2; ++i) {
        message.as.status = others[i];
        assert_non_null(peers_offer(&peers, &message, 1000));
    }
    peers_begin(&peers, 1000);
    const report_input from = { .config = &config, .cycle = &cycle, .peers = &peers, .now = 1000 };
    text out = text_in(bytes, sizeof bytes);
    report_status(&out, &from);
    assert_non_null(strstr(bytes, "\"standby\":true,\"others\":["
                                  "{\"rsu_id\":4,\"start_utime\":80,\"leads\":true},"
                                  "{\"rsu_id\":6,\"start_utime\":70,\"leads\":false}],"));
    out = text_in(bytes, OPERATORS_PAGE_SIZE);
    report_metrics(&out, &from);
    assert_non_null(strstr(bytes, "\nverge_standby 1\n"));
}

static void test_a_fault_ends_with_its_time_and_a_lasting_one_when_cleared(void** state)
{
    (void)state;
    status self = { .start_utime = 1 };
    status_fault(&self, RSU_FAULT_DEADLINE, 100, false);
    status_fault(&self, RSU_FAULT_RECORD, 100, true);
    status_fault(&self, RSU_FAULT_RECORD, 200, false); // does not shorten it
    const int64_t over = 100 + STATUS_FAULT_HOLD_US;
    assert_int_equal(status_worst(&self, over - 1), RSU_FAULT_DEADLINE);
    assert_int_equal(status_worst(&self, over), RSU_FAULT_RECORD);
    status_fault(&self, RSU_FAULT_DEADLINE, over, false);
    assert_int_equal(status_worst(&self, over), RSU_FAULT_DEADLINE);
    assert_int_equal(status_faults(&self, INT64_MAX - 1), 1u << RSU_FAULT_RECORD);
    status_fault_clear(&self, RSU_FAULT_RECORD);
    assert_int_equal(status_faults(&self, INT64_MAX - 1), 0);
    status_fault(&self, RSU_FAULT_RECORD, 0, false);
    assert_int_equal(status_faults(&self, over + STATUS_FAULT_HOLD_US), 0); // it lasts no more
}

static void test_stopping_goes_before_faults(void** state)
{
    (void)state;
    status self = with_faults(SETS - 1, 0);
    self.stopping = true;
    assert_int_equal(status_state(&self, 1), RSU_STOPPING);
    self = with_faults(0, 0);
    self.has_vehicles = true;
    assert_int_equal(status_state(&self, 1), RSU_RUNNING);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_every_active_fault_is_listed_the_worst_first),
        cmocka_unit_test(test_programs_get_the_same_list),
        cmocka_unit_test(test_counters_without_a_field_in_the_message_are_in_the_answers),
        cmocka_unit_test(test_operators_see_other_units_and_whether_this_one_stands_by),
        cmocka_unit_test(test_a_fault_ends_with_its_time_and_a_lasting_one_when_cleared),
        cmocka_unit_test(test_stopping_goes_before_faults),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
