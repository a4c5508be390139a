/// Assertions: conditions that hold unless the caller or the library has a defect. Wrong input data
/// never fails an assertion; it gives a status or a counter.
#ifndef VG_CONTRACT_H
#define VG_CONTRACT_H

#ifdef __cplusplus
extern "C" {
#endif

#ifndef VERGE_ASSERT
#if defined(NDEBUG)
#define VERGE_ASSERT(condition) ((void)0)
#else
/// Called when an assertion fails. A program may define its own handler.
void verge_assert_failed(const char* condition, const char* file, int line)
    __attribute__((noreturn));
#define VERGE_ASSERT(condition) \
    ((condition) ? (void)0 : verge_assert_failed(#condition, __FILE__, __LINE__))
#endif
#endif

#ifdef __cplusplus
}
#endif

#endif
