#!/bin/bash
# Claim: the same digests from every compiler, optimisation and machine, whether subnormal numbers
# are flushed to zero or not.
#
#     run.sh VARIANT SOURCE_DIR WORK_DIR            compare with tests/golden.txt
#     run.sh VARIANT SOURCE_DIR WORK_DIR --print    print the digests only
#
# VARIANT: gcc-O0 (asserts on), gcc-native (-O3, this machine's instructions), clang (-O2),
# aarch64 and riscv64 (-O2, run by qemu), gcc-small (-O3, the capacities of support/small_config.h),
# cortex-m7 (the same capacities, 32 bits, no operating system, on a board that qemu emulates; two
# cycles of each scenario instead of four). Exit 77 where the compiler or emulator is not installed.
set -euo pipefail
variant=$1
source_dir=$2
build=$3/$variant
golden=$source_dir/tests/golden.txt
small=$source_dir/tests/support/small_config.h
embedded=$source_dir/apps/embedded
runner=()
cycles=4
flushes=true # there is a mode that flushes subnormal numbers to zero

need() {
    command -v "$1" >/dev/null || { echo "SKIPPED: $1 is not installed (tools/setup)"; exit 77; }
}

# linux MACHINE: compiled for Linux on another machine, and run by qemu
linux() {
    need "$1-linux-gnu-g++"
    need "qemu-$1"
    runner=("qemu-$1" -L "/usr/$1-linux-gnu")
    arguments=(-DCMAKE_BUILD_TYPE=RelWithDebInfo
        -DCMAKE_SYSTEM_NAME=Linux -DCMAKE_SYSTEM_PROCESSOR="$1"
        -DCMAKE_C_COMPILER="$1-linux-gnu-gcc" -DCMAKE_CXX_COMPILER="$1-linux-gnu-g++")
}

case $variant in
gcc-O0) arguments=(-DCMAKE_BUILD_TYPE=Debug -DCMAKE_C_COMPILER=gcc -DCMAKE_CXX_COMPILER=g++) ;;
gcc-native)
    arguments=(-DCMAKE_BUILD_TYPE=Release -DCMAKE_C_COMPILER=gcc -DCMAKE_CXX_COMPILER=g++
        -DCMAKE_C_FLAGS=-march=native -DCMAKE_CXX_FLAGS=-march=native)
    ;;
gcc-small)
    arguments=(-DCMAKE_BUILD_TYPE=Release -DCMAKE_C_COMPILER=gcc -DCMAKE_CXX_COMPILER=g++
        -DVERGE_CONFIG_HEADER="$small")
    ;;
clang)
    need clang-14
    arguments=(-DCMAKE_BUILD_TYPE=RelWithDebInfo
        -DCMAKE_C_COMPILER=clang-14 -DCMAKE_CXX_COMPILER=clang++-14)
    ;;
aarch64) linux aarch64 ;;
riscv64)
    linux riscv64
    flushes=false
    ;;
cortex-m7)
    need arm-none-eabi-g++
    need qemu-system-arm
    runner=("$embedded/emulate")
    cycles=2
    flushes=false # the program takes no arguments there
    arguments=(-DCMAKE_BUILD_TYPE=Release -DVERGE_CONFIG_HEADER="$small"
        -DCMAKE_TOOLCHAIN_FILE="$embedded/arm-none-eabi.cmake")
    ;;
*) echo "unknown variant $variant" >&2; exit 2 ;;
esac

mkdir -p "$build"
{ cmake -S "$source_dir/tests/determinism" -B "$build" -DVERGE_DIGEST_CYCLES="$cycles" \
    "${arguments[@]}" &&
    cmake --build "$build" --target verge_digest; } >"$build/log.txt" 2>&1 ||
    { grep -E -A3 'error|undefined' "$build/log.txt" >&2 || tail -20 "$build/log.txt" >&2; exit 1; }

program=$build/verge_digest
[ -x "$program" ] || program=$program.elf
actual=$build/digests.txt
started=$SECONDS
"${runner[@]}" "$program" >"$actual"
if [ "${4:-}" = --print ]; then
    cat "$actual"
    exit 0
fi
if ! awk -v n="$cycles" '!/^#/ && $2 < n' "$golden" |
    diff - "$actual" >"$build/difference.txt"; then
    echo "$variant: digests differ from tests/golden.txt (<), actual values (>):" >&2
    cat "$build/difference.txt" >&2
    echo "If the change of behaviour is meant: tools/check --accept-golden, then commit." >&2
    exit 1
fi
if $flushes; then
    "${runner[@]}" "$program" --flush-subnormals >"$build/flushed.txt"
    diff "$actual" "$build/flushed.txt" || {
        echo "$variant: digests differ where subnormal numbers are flushed to zero (>)" >&2
        exit 1
    }
fi
echo "$variant: $(wc -l <"$actual") digests as in tests/golden.txt, $((SECONDS - started)) s"
