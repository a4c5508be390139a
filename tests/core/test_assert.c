/// Goal: a program that defines verge_assert_failed() is called where an assertion fails.
/// Method: this program brings one that jumps back, and lets an assertion fail.
#undef NDEBUG
#include "check.h"

#include "base/contract.h"

#include <setjmp.h>

static jmp_buf back;
static const char* failed_condition;

void verge_assert_failed(const char* condition, const char* file, int line)
{
    failed_condition = condition;
    assert_non_null(file);
    assert_true(line > 0);
    longjmp(back, 1);
}

static void a_programs_own_handler_is_called(void** state)
{
    (void)state;
    const int two = 2;
    VERGE_ASSERT(two == 2);
    assert_null(failed_condition);
    if (setjmp(back) == 0) {
        VERGE_ASSERT(two == 3);
        fail_msg("the assertion let the program go on");
    }
    assert_string_equal(failed_condition, "two == 3");
}

int main(void)
{
    const struct CMUnitTest tests[] = { cmocka_unit_test(a_programs_own_handler_is_called) };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
