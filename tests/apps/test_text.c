/// Goal: a text is built without the heap, is valid JSON for any content, and is marked where it
/// did not fit. A message in JSON has every field and fits its buffer.
/// Method: texts of every length around the size of the buffer, all characters, the largest
/// messages; the JSON reader of the programs parses them.
#include "check.h"

#include "common/json.h"
#include "common/message_json.h"
#include "verge/message.h"
#include "common/text.h"

#include <float.h>
#include <math.h>
#include <stdio.h>

static void test_text_that_does_not_fit_is_left_out_and_marked(void** state)
{
    (void)state;
    char buffer[16];
    for (int length = 0; length < 40; ++length) {
        memset(buffer, 'x', sizeof buffer);
        text out = text_in(buffer, sizeof buffer);
        text_add(&out, "%.*s", length, "0123456789012345678901234567890123456789");
        assert_int_equal(out.cut, length > 15);
        assert_int_equal(out.size, length > 15 ? 0 : length);
        assert_int_equal(strlen(buffer), out.size);
        text_add(&out, "!");
        assert_true(out.size <= 15 && buffer[out.size] == '\0');
        assert_int_equal(out.cut, length >= 15);
    }
}

static void test_any_words_come_back_from_json(void** state)
{
    (void)state;
    char words[256], buffer[2048];
    for (int i = 0; i < 255; ++i) {
        words[i] = (char)(i < 126 ? i + 1 : 'a' + i % 26);
    }
    words[255] = '\0';
    text out = text_in(buffer, sizeof buffer);
    text_add(&out, "{\"words\":");
    text_add_string(&out, words);
    text_add(&out, ",\"numbers\":[");
    text_add_double(&out, -0.0);
    text_add(&out, ",");
    text_add_double(&out, 0.1);
    text_add(&out, ",");
    text_add_double(&out, NAN);
    text_add(&out, ",");
    text_add_float(&out, 0.1f);
    text_add(&out, ",");
    text_add_float(&out, -INFINITY);
    text_add(&out, "]}");
    assert_false(out.cut);
    json_file file;
    if (!json_file_parse(&file, "text", out.bytes, out.size)) {
        fail_msg("%s", file.error);
    }
    const json_at root = json_root(&file);
    assert_string_equal(json_string(&root, "words"), words);
    json_file_free(&file);
    assert_non_null(strstr(buffer, "[0,0.1,null,0.1,null]"));
}

/// Parses a message and returns how many fields it has.
static int fields_of(const text* out)
{
    assert_false(out->cut);
    json_file file;
    if (!json_file_parse(&file, "message", out->bytes, out->size)) {
        fail_msg("%s", file.error);
    }
    const int count = cJSON_GetArraySize(file.document);
    json_file_free(&file);
    return count;
}

static void test_every_message_has_all_its_fields_and_fits(void** state)
{
    (void)state;
    static char buffer[MESSAGE_JSON_MAX];
    verge_vehicle_plan_t plan;
    memset(&plan, 0x80, sizeof plan); // the longest numbers: negative, of many digits
    plan.action_count = 7;
    plan.pass_count = 4;
    plan.stop_count = 3;
    plan.point_count = 31;
    for (int i = 0; i < 31; ++i) {
        plan.points[i] = (verge_plan_point_t){ -DBL_MAX / 3.0, -DBL_MIN / 3.0, -FLT_MIN / 3.0f,
                                               -FLT_MAX / 3.0f, -FLT_MIN / 3.0f, -FLT_MAX / 3.0f };
    }
    for (int i = 0; i < 7; ++i) {
        plan.actions[i].s = plan.actions[i].speed = plan.actions[i].distance = -FLT_MIN / 3.0f;
    }
    for (int i = 0; i < 3; ++i) {
        plan.stops[i] = (verge_plan_stop_t){ -FLT_MIN / 3.0f, -FLT_MAX / 3.0f };
    }
    text out = text_in(buffer, sizeof buffer);
    message_json(&out, TRANSPORT_PLAN, &plan);
    const int fields = (int)message_of(TRANSPORT_PLAN)->field_count;
    assert_int_equal(fields_of(&out), fields - 4); // the counts are the arrays' lengths
    assert_non_null(strstr(buffer, "\"crc32\":\"80808080\""));
    plan.crc32 = 0; // not sent yet
    out = text_in(buffer, sizeof buffer);
    message_json(&out, TRANSPORT_PLAN, &plan);
    assert_int_equal(fields_of(&out), fields - 5);
    assert_null(strstr(buffer, "\"crc32\""));

    verge_vehicle_state_t vehicle;
    memset(&vehicle, 0x80, sizeof vehicle);
    out = text_in(buffer, sizeof buffer);
    message_json(&out, TRANSPORT_STATE, &vehicle);
    assert_int_equal(fields_of(&out), message_of(TRANSPORT_STATE)->field_count);

    verge_rsu_status_t status;
    memset(&status, 0x80, sizeof status);
    out = text_in(buffer, sizeof buffer);
    message_json(&out, TRANSPORT_STATUS, &status);
    assert_int_equal(fields_of(&out), message_of(TRANSPORT_STATUS)->field_count);

    verge_lane_signal_t signal;
    memset(&signal, 0x80, sizeof signal);
    out = text_in(buffer, sizeof buffer);
    message_json(&out, TRANSPORT_SIGNAL, &signal);
    assert_int_equal(fields_of(&out), message_of(TRANSPORT_SIGNAL)->field_count);
}

static void test_codes_have_names_and_others_are_unknown(void** state)
{
    (void)state;
    assert_string_equal(message_plan_status(3), "cancelled");
    assert_string_equal(message_rsu_state(4), "stopping");
    assert_string_equal(message_rsu_fault(8), "other_rsu");
    for (int32_t code = 9; code < 13; ++code) {
        assert_string_equal(message_rsu_fault(code), "unknown");
        assert_string_equal(message_rsu_state(-code), "unknown");
        assert_string_equal(message_plan_status(code), "unknown");
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_text_that_does_not_fit_is_left_out_and_marked),
        cmocka_unit_test(test_any_words_come_back_from_json),
        cmocka_unit_test(test_every_message_has_all_its_fields_and_fits),
        cmocka_unit_test(test_codes_have_names_and_others_are_unknown),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
