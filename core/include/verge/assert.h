/// Assertions of the library, and the handler that a program or a firmware may bring.
///
/// In a build without NDEBUG the library checks what must hold if it has no defect. Input from
/// outside never ends in an assertion: it gets a status. A failed assertion calls
/// verge_assert_failed(). The library's own one executes a trap; it is a weak symbol, so a program
/// that defines the function replaces it, without a setting:
///
///     void verge_assert_failed(const char* condition, const char* file, int line)
///     {
///         log_fault(file, line, condition);
///         reset();
///     }
///
/// A build with NDEBUG has no assertions. To keep them in a Release build, or to use a macro of
/// one's own, define VERGE_ASSERT(condition) on the compiler's command line.
#ifndef VERGE_ASSERT_H
#define VERGE_ASSERT_H

#ifdef __cplusplus
extern "C" {
#endif

/// Must not return. condition and file are texts of static lifetime.
void verge_assert_failed(const char* condition, const char* file, int line)
    __attribute__((noreturn));

#ifdef __cplusplus
}
#endif

#endif
