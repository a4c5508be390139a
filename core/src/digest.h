/// Digest of a plan: FNV-1a over the values of its fields, so padding and byte order do not matter.
#ifndef VG_DIGEST_H
#define VG_DIGEST_H

#include "verge/plan.h"

#ifdef __cplusplus
extern "C" {
#endif

/// The digest covers utime, all fields of all vehicle plans, and the predictions; not the search
/// report.
uint64_t vg_digest_plan(const verge_plan* plan);

#ifdef __cplusplus
}
#endif

#endif
