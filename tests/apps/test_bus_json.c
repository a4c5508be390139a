/// Goal: bus options are read as written, and a fault in them is reported with its place.
/// Method: whole documents in memory and in files; printed options are read again.
#include "check.h"
#include "common/bus_json.h"

#include <stdlib.h>
#include <unistd.h>

static json_file file;

static bool read_text(bus_options* options, const char* text)
{
    assert_true(json_file_parse(&file, "/etc/site/rsu.json", text, strlen(text)));
    const json_at root = json_root(&file);
    const bool good = bus_options_read(options, &root);
    json_file_free(&file);
    return good;
}

static bool dds_is_built_in(void)
{
    return transport_url_fault("dds:0") == NULL;
}

static const char whole[] =
    "{ \"dds\": { \"interfaces\": [\"lo\", \"eth1\"], \"peers\": [\"10.1.0.7\"],"
    "\"deadline_ms\": 400, \"security\": {"
    "\"identity_ca\": \"a.pem\", \"certificate\": \"/b.pem\", \"key\": \"c\","
    "\"permissions_ca\": \"d\", \"governance\": \"e\", \"permissions\": \"f\" } },"
    "\"lcm\": { \"allow\": [\"10.1.0.0/16\"], \"keys\": [{ \"id\": 3, \"file\": \"g\" },"
    "{ \"file\": \"/h\", \"id\": 4 }],"
    "\"sign_with\": 3, \"window_ms\": 250 } }";

static void test_names_and_paths_are_read_and_paths_start_in_the_files_folder(void** state)
{
    (void)state;
    bus_options options;
    if (!read_text(&options, whole)) {
        fail_msg("%s", file.error);
    }
    static const transport_setting expected[] = {
        { "lcm.allow", "10.1.0.0/16" },
        { "lcm.keys.id", "3" },
        { "lcm.keys.file", "/etc/site/g" },
        { "lcm.keys.id", "4" },
        { "lcm.keys.file", "/h" },
        { "lcm.sign_with", "3" },
        { "lcm.window_ms", "250" },
        { "dds.interfaces", "lo" },
        { "dds.interfaces", "eth1" },
        { "dds.peers", "10.1.0.7" },
        { "dds.deadline_ms", "400" },
        { "dds.security.identity_ca", "/etc/site/a.pem" },
        { "dds.security.certificate", "/b.pem" },
        { "dds.security.key", "/etc/site/c" },
        { "dds.security.permissions_ca", "/etc/site/d" },
        { "dds.security.governance", "/etc/site/e" },
        { "dds.security.permissions", "/etc/site/f" },
    };
    const transport_options* t = &options.transport;
    assert_int_equal(t->setting_count, dds_is_built_in() ? 17 : 7);
    for (uint32_t i = 0; i < t->setting_count; ++i) {
        assert_string_equal(t->settings[i].name, expected[i].name);
        assert_string_equal(t->settings[i].value, expected[i].value);
    }
    bus_options_free(&options);
}

static void test_an_absent_field_has_its_default(void** state)
{
    (void)state;
    bus_options options;
    assert_true(read_text(&options, "{ \"rsu_id\": 1 }"));
    assert_int_equal(options.transport.setting_count, 0);
    bus_options_free(&options);
    // Who asks for something of a bus gets its presets with it.
    assert_true(read_text(&options, "{ \"lcm\": {} }"));
    assert_int_equal(options.transport.setting_count, 1);
    assert_string_equal(options.transport.settings[0].name, "lcm.window_ms");
    assert_string_equal(options.transport.settings[0].value, "1000");
    bus_options_free(&options);
}

static void test_faults_are_reported_with_their_place(void** state)
{
    (void)state;
    static const char* const wrong[][2] = {
        { "{ \"dds\": 1 }", "rsu.json:dds: " },
        { "{ \"dds\": { \"domain\": 1 } }", "domain" },
        { "{ \"dds\": { \"deadline_ms\": -1 } }", "dds.deadline_ms: " },
        { "{ \"lcm\": { \"secret\": 1 } }", "secret" },
        { "{ \"lcm\": { \"allow\": [7] } }", "lcm.allow[0]: " },
        { "{ \"lcm\": { \"keys\": {} } }", "lcm.keys: " },
        { "{ \"lcm\": { \"keys\": [3] } }", "lcm.keys[0]: " },
        { "{ \"lcm\": { \"keys\": [{ \"file\": \"g\" }] } }", "lcm.keys[0].id: " },
        { "{ \"lcm\": { \"keys\": [{ \"id\": 0, \"file\": \"g\" }] } }", "lcm.keys[0].id: " },
        { "{ \"lcm\": { \"keys\": [{ \"id\": 1 }] } }", "lcm.keys[0].file: " },
        { "{ \"lcm\": { \"sign_with\": 0 } }", "lcm.sign_with: " },
        { "{ \"lcm\": { \"window_ms\": 9 } }", "lcm.window_ms: " },
        { "{ \"dds\": { \"interfaces\": \"lo\" } }", "dds.interfaces: " },
        { "{ \"dds\": { \"interfaces\": [\"lo\", 3] } }", "dds.interfaces[1]: " },
        { "{ \"dds\": { \"interfaces\": [\"1\",\"2\",\"3\",\"4\",\"5\",\"6\",\"7\",\"8\",\"9\"] } }",
          "dds.interfaces: " },
        { "{ \"dds\": { \"peers\": [\"\"] } }", "dds.peers[0]: " },
        { "{ \"dds\": { \"security\": { \"key\": \"a\" } } }", "dds.security.identity_ca: " },
    };
    for (size_t i = 0; i < sizeof wrong / sizeof wrong[0]; ++i) {
        bus_options options;
        if (strstr(wrong[i][0], "dds") != NULL && !dds_is_built_in()) {
            continue;
        }
        assert_false(read_text(&options, wrong[i][0]));
        if (strstr(file.error, wrong[i][1]) == NULL) {
            fail_msg("%s is told as %s", wrong[i][0], file.error);
        }
        bus_options_free(&options);
    }
}

static void test_options_that_are_printed_read_back_the_same(void** state)
{
    (void)state;
    bus_options options, again, other;
    assert_true(read_text(&options, whole));
    char*  text = NULL;
    size_t size = 0;
    FILE*  memory = open_memstream(&text, &size);
    fputs("{ \"x\": 1", memory);
    bus_options_write(memory, &options);
    fputs(" }", memory);
    fclose(memory);
    assert_true(read_text(&again, text));
    assert_true(bus_options_same(&options, &again));
    assert_true(read_text(&other, "{ \"lcm\": { \"allow\": [\"10.1.0.0/16\"] } }"));
    assert_false(bus_options_same(&options, &other));
    bus_options_free(&other);
    assert_true(read_text(&other, "{ \"lcm\": { \"window_ms\": 999 } }"));
    assert_false(bus_options_same(&options, &other));
    free(text);
    bus_options_free(&options);
    bus_options_free(&again);
    bus_options_free(&other);
}

static void test_a_replaced_key_file_is_another_configuration(void** state)
{
    (void)state;
    char path[] = "/tmp/verge_test_bus_XXXXXX";
    close(mkstemp(path));
    char text[256];
    snprintf(text, sizeof text, "{ \"lcm\": { \"keys\": [{ \"id\": 1, \"file\": \"%s\" }] } }",
             path);
    bus_options before, same, after;
    assert_true(read_text(&before, text));
    assert_true(read_text(&same, text));
    FILE* key = fopen(path, "w");
    fputs("another", key);
    fclose(key);
    assert_true(read_text(&after, text));
    assert_true(bus_options_same(&before, &same));
    assert_false(bus_options_same(&before, &after));
    bus_options_free(&before);
    bus_options_free(&same);
    bus_options_free(&after);
    remove(path);
}

static void test_a_file_of_options_holds_nothing_else(void** state)
{
    (void)state;
    char path[] = "/tmp/verge_test_bus_XXXXXX";
    const int fd = mkstemp(path);
    static const char text[] = "{ \"lcm\": { \"allow\": [] }, \"rsu_id\": 1 }";
    assert_int_equal(write(fd, text, strlen(text)), strlen(text));
    close(fd);
    bus_options options;
    assert_false(bus_options_load(&options, path, &file));
    assert_non_null(strstr(file.error, "rsu_id"));
    bus_options_free(&options);
    assert_false(bus_options_load(&options, "/nowhere/at/all", &file));
    assert_true(file.missing);
    bus_options_free(&options);
    remove(path);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_names_and_paths_are_read_and_paths_start_in_the_files_folder),
        cmocka_unit_test(test_an_absent_field_has_its_default),
        cmocka_unit_test(test_faults_are_reported_with_their_place),
        cmocka_unit_test(test_options_that_are_printed_read_back_the_same),
        cmocka_unit_test(test_a_replaced_key_file_is_another_configuration),
        cmocka_unit_test(test_a_file_of_options_holds_nothing_else),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
