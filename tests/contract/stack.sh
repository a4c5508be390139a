#!/bin/bash
# Claim: the stack that core needs is bounded, and small enough for a microcontroller.
#
#     stack.sh SOURCE_DIR WORK_DIR
#
# tools/stack adds the frames up, here and for a Cortex-M7 where its compiler is present. First it
# is tried on a function that calls itself, one with a frame of any size, and a call of malloc().
set -euo pipefail
source_dir=$1
planted=$2/planted
most=16384 # [B]

# refused WORD SOURCE: tools/stack refuses a core that consists of this source
refused() {
    rm -rf "$planted"
    mkdir -p "$planted/core/src" "$planted/tools"
    cp "$source_dir/tools/stack" "$planted/tools/stack"
    echo "$2" >"$planted/core/src/planted.c"
    if "$planted/tools/stack" >/dev/null 2>"$planted/refused.txt"; then
        echo "tools/stack accepts: $2" >&2
        exit 1
    fi
    grep -q "$1" "$planted/refused.txt" ||
        { echo "tools/stack does not say \"$1\" of: $2" >&2; exit 1; }
}

refused 'calls itself' 'int other(int); int verge_a(int n) { return n > 0 ? other(n - 1) + n : 0; }
__attribute__((noinline)) int other(int n) { volatile int m = verge_a(n); return m; }'
refused 'has no bound' 'int use(char*); int verge_a(int n) { char text[n]; return text[use(text)]; }
int use(char* text) { return text[0]; }'
refused 'is not part of core' 'void* malloc(unsigned long);
void* verge_a(void) { return malloc(9); }'

for machine in x86-64 cortex-m7; do
    if [ $machine = cortex-m7 ] && ! command -v arm-none-eabi-g++ >/dev/null; then
        echo "$machine: not looked at, gcc-arm-none-eabi is not installed"
        continue
    fi
    echo "on vehicle, $machine:"
    "$source_dir/tools/stack" --machine $machine --config "$source_dir/apps/embedded/config.h" \
        --most $most verge_scene_place verge_decide_for verge_predict_for \
        verge_plan_vehicle_for
done
echo "roadside unit, x86-64:"
"$source_dir/tools/stack" --most $most verge_planner_step_for
