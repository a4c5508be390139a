/// Assertions: conditions that hold unless the caller or the library has a defect. Wrong input data
/// never fails an assertion; it gives a status or a counter.
#ifndef VG_CONTRACT_H
#define VG_CONTRACT_H

#include "verge/assert.h"

#ifndef VERGE_ASSERT
#if defined(NDEBUG)
#define VERGE_ASSERT(condition) ((void)0)
#else
#define VERGE_ASSERT(condition) \
    ((condition) ? (void)0 : verge_assert_failed(#condition, __FILE__, __LINE__))
#endif
#endif

#endif
