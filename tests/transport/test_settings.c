/// Goal: settings that no bus has, or that cannot work, are refused at open with their name.
/// Method: each rule broken once in options that are good otherwise.
#include "check.h"
#include "settings.h"

static char error[256];

static bool opens(const transport_setting* settings, uint32_t count)
{
    const transport_options options = { .settings = settings, .setting_count = count };
    transport*              bus = NULL;
    const int result = transport_open_with(&bus, "loop:settings", 0, &options, error, sizeof error);
    transport_close(bus);
    assert_true(result == TRANSPORT_OK || result == TRANSPORT_BAD_URL);
    return result == TRANSPORT_OK;
}

static void test_each_table_row_is_named_after_its_bus_and_has_a_sentence(void** state)
{
    (void)state;
    const transport_setting_def* def;
    uint32_t count = 0;
    for (; (def = transport_setting_at(count)) != NULL; ++count) {
        const char* dot = strchr(def->name, '.');
        assert_non_null(dot);
        char url[64];
        snprintf(url, sizeof url, "%.*s:x", (int)(dot - def->name), def->name);
        assert_null(transport_url_fault(url));
        assert_true(strlen(def->text) > 10);
        assert_true(def->min <= def->max);
    }
    assert_true(count >= 6);
}

static void test_a_bus_takes_its_own_settings_and_leaves_those_of_others(void** state)
{
    (void)state;
    const transport_setting good[] = { { "lcm.allow", "10.1.0.0/16" }, { "lcm.window_ms", "250" } };
    const transport_options options = { .settings = good, .setting_count = 2 };
    assert_true(opens(good, 2));
    assert_int_equal(setting_number(&options, "lcm.window_ms", 0), 250);
    assert_int_equal(setting_number(&(transport_options){ 0 }, "lcm.window_ms", 0), 1000);
    assert_null(setting_text(&options, "lcm.allow", 1));
    assert_int_equal(setting_count(&options, "lcm.allow"), 1);
}

static void test_settings_that_cannot_work_are_refused_by_name(void** state)
{
    (void)state;
    static const struct {
        transport_setting settings[3];
        uint32_t          count;
        const char*       name;
    } wrong[] = {
        { { { "lcm.secret", "1" } }, 1, "lcm.secret: unknown" },
        { { { "keys", "1" } }, 1, "keys: unknown" },
        { { { "lcm.keys", "1" } }, 1, "lcm.keys: unknown" }, // an object has no value
        { { { "lcm.window_ms", "9" } }, 1, "lcm.window_ms: is 9, expected 10 to 60000" },
        { { { "lcm.window_ms", "60001" } }, 1, "lcm.window_ms: " },
        { { { "lcm.window_ms", "" } }, 1, "lcm.window_ms: " },
        { { { "lcm.window_ms", "-20" } }, 1, "lcm.window_ms: " },
        { { { "lcm.window_ms", "20ms" } }, 1, "lcm.window_ms: " },
        { { { "lcm.window_ms", "4294967316" } }, 1, "lcm.window_ms: " }, // 2^32 + 20
        { { { "lcm.window_ms", "20" }, { "lcm.window_ms", "20" } }, 2,
          "lcm.window_ms: is given 2 times" },
        { { { "lcm.keys.id", "1" } }, 1, "lcm.keys.file: is given 0 times, expected 1" },
        { { { "lcm.keys.id", "1" }, { "lcm.keys.file", "a" }, { "lcm.keys.file", "b" } }, 3,
          "lcm.keys.file: is given 2 times" },
    };
    for (size_t i = 0; i < sizeof wrong / sizeof wrong[0]; ++i) {
        if (opens(wrong[i].settings, wrong[i].count) ||
            strncmp(error, wrong[i].name, strlen(wrong[i].name)) != 0) {
            fail_msg("%s is reported as: %s", wrong[i].name, error);
        }
    }
}

static void test_a_list_holds_as_many_as_its_row_says(void** state)
{
    (void)state;
    transport_setting many[33];
    for (int i = 0; i < 33; ++i) {
        many[i] = (transport_setting){ "lcm.allow", "10.1.0.0/16" };
    }
    assert_true(opens(many, 32));
    assert_false(opens(many, 33));
    assert_non_null(strstr(error, "at most 32"));
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_each_table_row_is_named_after_its_bus_and_has_a_sentence),
        cmocka_unit_test(test_a_bus_takes_its_own_settings_and_leaves_those_of_others),
        cmocka_unit_test(test_settings_that_cannot_work_are_refused_by_name),
        cmocka_unit_test(test_a_list_holds_as_many_as_its_row_says),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
