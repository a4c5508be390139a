/// Assertions: what must hold if caller and library keep their contracts. Input from the world
/// never ends here; it gets a status or a counter.
#ifndef VG_CONTRACT_H
#define VG_CONTRACT_H

#ifdef __cplusplus
extern "C" {
#endif

#ifndef VERGE_ASSERT
#if defined(NDEBUG)
#define VERGE_ASSERT(condition) ((void)0)
#else
/// The handler is the library's only way out; a program may bring its own.
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
