/// FNV-1a over values, field by field, so that padding and byte order do not count.
#ifndef VG_DIGEST_H
#define VG_DIGEST_H

#include "verge/plan.h"

#ifdef __cplusplus
extern "C" {
#endif

/// Of every field of every vehicle plan, the predictions and the utime; not of the search report.
uint64_t vg_digest_plan(const verge_plan* plan);

#ifdef __cplusplus
}
#endif

#endif
