#include "base/contract.h"

// Weak: a program that wants the sentence brings its own handler.
__attribute__((weak)) void verge_assert_failed(const char* condition, const char* file, int line)
{
    (void)condition;
    (void)file;
    (void)line;
    __builtin_trap();
}
