#!/bin/bash
# Claim: the core compiles where there is no C library, here also 32 bits wide. All it wants beyond
# the compiler's own headers is four functions of string.h and the name static_assert.
#
# The few .cpp files need what Eigen includes, a C++ library's headers, but not the library: their
# objects, too, may ask for nothing beyond the core but the four memory functions, optimised or not.
#
#     freestanding.sh SOURCE_DIR WORK_DIR
set -euo pipefail
source_dir=$1
work=$2
mkdir -p "$work/include"
cat >"$work/include/string.h" <<'END'
#include <stddef.h>
void* memcpy(void* restrict to, const void* restrict from, size_t size);
void* memmove(void* to, const void* from, size_t size);
void* memset(void* to, int value, size_t size);
int   memcmp(const void* a, const void* b, size_t size);
END
echo '#define static_assert _Static_assert' >"$work/include/assert.h"

flags=(-std=c11 -ffreestanding -nostdinc -isystem "$(gcc -print-file-name=include)"
    -isystem "$work/include" -I "$source_dir/core/include" -I "$source_dir/core/src" -DNDEBUG
    -O1 -ffp-contract=off -fno-math-errno -fno-trapping-math -Wall -Werror)
widths=('')
[ "$(uname -m)" != x86_64 ] || widths+=('-m32 -msse2 -mfpmath=sse')
count=0
for file in "$source_dir"/core/src/*.c "$source_dir"/core/src/*/*.c; do
    for width in "${widths[@]}"; do
        # shellcheck disable=SC2086 # the width is several options
        gcc "${flags[@]}" $width -c "$file" -o "$work/object.o" || {
            echo "${file##*/} does not compile alone ($width)" >&2
            exit 1
        }
    done
    count=$((count + 1))
done
[ "$count" -gt 10 ] || { echo "only $count sources found" >&2; exit 1; }

cpp_flags=(-std=c++17 -I "$source_dir/core/include" -I "$source_dir/core/src" -isystem "${EIGEN_INCLUDE:-/usr/include/eigen3}"
    -fno-exceptions -fno-rtti -fno-threadsafe-statics -ffp-contract=off -fno-math-errno
    -fno-trapping-math -DEIGEN_DONT_VECTORIZE -DEIGEN_DONT_PARALLELIZE -DEIGEN_NO_MALLOC
    -DEIGEN_NO_DEBUG -Wall -Werror)
islands=0
for file in "$source_dir"/core/src/*/*.cpp; do
    for level in -O0 -O3; do
        g++ "${cpp_flags[@]}" $level -c "$file" -o "$work/object.o"
        # Templates that the object defines itself are not asked for.
        foreign=$(nm --undefined-only "$work/object.o" | awk '{ print $2 }' |
            grep -vE '^(vg_|verge_)|^mem(cpy|move|set|cmp)$|^_GLOBAL_OFFSET_TABLE_$' || true)
        [ -z "$foreign" ] || { echo "${file##*/} $level needs" $foreign >&2; exit 1; }
    done
    islands=$((islands + 1))
done
echo "$count sources compile without a C library (${#widths[@]} widths)," \
    "$islands C++ sources need none of theirs"
