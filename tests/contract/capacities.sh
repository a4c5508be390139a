#!/bin/bash
# Claim: the core works with its capacities (core/include/verge/config.h) at both ends of their
# documented ranges, alone and mixed, and does not compile beyond them.
#
#     capacities.sh SOURCE_DIR WORK_DIR
set -euo pipefail
source_dir=$1
work=$2
here=$source_dir/tests/contract/capacities
flags=(-O1 -ffp-contract=off -fno-math-errno -fsanitize=undefined,bounds-strict
    -fno-sanitize-recover=all -I "$source_dir/core/include" -I "$source_dir/core/src" -Wall -Werror)
mkdir -p "$work"

# The files that do not see a capacity are compiled once.
build_cpp() {
    local file
    for file in "$source_dir"/core/src/*/*.cpp; do
        g++ -std=c++17 -O1 -ffp-contract=off -fno-math-errno \
            -fno-exceptions -fno-rtti -fno-threadsafe-statics \
            -DEIGEN_DONT_VECTORIZE -DEIGEN_DONT_PARALLELIZE -DEIGEN_NO_MALLOC -DEIGEN_NO_DEBUG \
            -I "$source_dir/core/include" -I "$source_dir/core/src" \
            -isystem "${EIGEN_INCLUDE:-/usr/include/eigen3}" -c "$file" \
            -o "$work/$(basename "$file").o"
    done
}

# plans WHAT NAME=VALUE...
plans() {
    local what=$1 directory=$work/$1 folder job jobs=()
    shift
    local macros=("${@/#/-DVERGE_}")
    rm -rf "$directory" # objects of files that are gone
    for folder in "$source_dir"/core/src "$source_dir"/core/src/*/; do # some names occur twice
        mkdir -p "$directory/$(basename "$folder")"
        (cd "$directory/$(basename "$folder")" &&
            gcc -std=gnu11 "${flags[@]}" "${macros[@]}" -c "$folder"/*.c) &
        jobs+=($!)
    done
    for job in "${jobs[@]}"; do
        wait "$job"
    done
    gcc -std=gnu11 "${flags[@]}" "${macros[@]}" "$here/main.c" "$directory"/*/*.o \
        "$work"/*.cpp.o -o "$directory/plan"
    "$directory/plan" || { echo "$what: no plan with $*" >&2; exit 1; }
    echo "$what: plans with $*"
}

# refused SENTENCE NAME=VALUE
refused() {
    if echo '#include "verge/verge.h"' |
        gcc "${flags[@]}" "-DVERGE_$2" -x c -fsyntax-only - 2>"$work/refused.txt"; then
        echo "VERGE_$2 compiles" >&2
        exit 1
    fi
    grep -q "$1" "$work/refused.txt" ||
        { echo "VERGE_$2 does not say \"$1\":" >&2; cat "$work/refused.txt" >&2; exit 1; }
}

build_cpp
plans smallest VEHICLES_MAX=8 CONTROLLED_MAX=1 STEPS_MAX=2 POINTS_MAX=11 NODES_MAX=2 \
    SUCCESSORS_MAX=1 STRETCHES_MAX=1 LANES_MAX=2 LANES_NEAR_MAX=8 CONFLICTS_MAX=1 \
    SAMPLE_SPEEDS_MAX=2 SAMPLE_OFFSETS_MAX=8
plans largest VEHICLES_MAX=64 CONTROLLED_MAX=27 STEPS_MAX=32 POINTS_MAX=64 NODES_MAX=1000000 \
    SUCCESSORS_MAX=8 STRETCHES_MAX=255 LANES_MAX=32767 LANES_NEAR_MAX=64 CONFLICTS_MAX=60000 \
    SAMPLE_SPEEDS_MAX=256 SAMPLE_OFFSETS_MAX=256
plans mixed-1 VEHICLES_MAX=8 CONTROLLED_MAX=8 STEPS_MAX=2 POINTS_MAX=64 SAMPLE_SPEEDS_MAX=8
plans mixed-2 VEHICLES_MAX=64 CONTROLLED_MAX=1 STEPS_MAX=4 POINTS_MAX=11 SAMPLE_OFFSETS_MAX=256

refused 'VERGE_VEHICLES_MAX: 8 .. 64' VEHICLES_MAX=7
refused 'VERGE_VEHICLES_MAX: 8 .. 64' VEHICLES_MAX=65
refused 'VERGE_CONTROLLED_MAX: 1 .. 27' CONTROLLED_MAX=0
refused 'VERGE_CONTROLLED_MAX: 1 .. 27' CONTROLLED_MAX=28
refused 'VERGE_CONTROLLED_MAX: at most VERGE_VEHICLES_MAX' VEHICLES_MAX=12
refused 'VERGE_STEPS_MAX: 2 .. 32' STEPS_MAX=1
refused 'VERGE_STEPS_MAX: 2 .. 32' STEPS_MAX=33
refused 'VERGE_POINTS_MAX: 11 .. 64' POINTS_MAX=10
refused 'VERGE_POINTS_MAX: 11 .. 64' POINTS_MAX=65
refused 'VERGE_SUCCESSORS_MAX: 1 .. 8' SUCCESSORS_MAX=0
refused 'VERGE_SUCCESSORS_MAX: 1 .. 8' SUCCESSORS_MAX=9
refused 'VERGE_LANES_MAX: 1 .. 32767' LANES_MAX=32768
refused 'VERGE_LANES_NEAR_MAX: 8 .. 64' LANES_NEAR_MAX=7
refused 'VERGE_CONFLICTS_MAX: 1 .. 60000' CONFLICTS_MAX=0
refused 'VERGE_STRETCHES_MAX: 1 .. 255' STRETCHES_MAX=256
refused 'VERGE_NODES_MAX: 2 .. 1000000' NODES_MAX=1
refused 'VERGE_SAMPLE_SPEEDS_MAX: 2 .. 256' SAMPLE_SPEEDS_MAX=1
refused 'VERGE_SAMPLE_OFFSETS_MAX: 8 .. 256' SAMPLE_OFFSETS_MAX=12
echo 'beyond the ranges nothing compiles, and the compiler says which capacity it is'
