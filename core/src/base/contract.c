#include "base/contract.h"

// Weak: a program that reports failed assertions defines its own handler.
__attribute__((weak)) void verge_assert_failed(const char* condition, const char* file, int line)
{
    (void)condition;
    (void)file;
    (void)line;
    __builtin_trap();
}
