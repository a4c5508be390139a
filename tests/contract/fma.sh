#!/bin/bash
# Claim: no fused multiply-add in the core, on machines that have one.
#
#     fma.sh SOURCE_DIR WORK_DIR
#
# A fused multiply-add rounds once instead of twice; one of them is enough to change a decision on
# one machine and not on another. The core is compiled for x86-64-v3 (which has it) and, where the
# cross compiler is present, for aarch64 (which always has it), and its machine code is read.
# The reader is tried on a function that must contain one first.
set -euo pipefail
source_dir=$1
work_dir=$2
instructions='\b(vfn?m(add|sub)[0-9a-z]*|fn?m(add|sub)|fml[as])\b'
failed=0

# look NAME OBJDUMP FLAGS CMAKE_ARGUMENT...
look() {
    local name=$1 objdump=$2 flags=$3 compiler=$4
    shift 4
    local build=$work_dir/$name
    mkdir -p "$build"
    echo 'double f(double a, double b, double c) { return a * b + c; }' >"$build/control.c"
    "$compiler" -O2 -ffp-contract=fast $flags -c "$build/control.c" -o "$build/control.o"
    if ! "$objdump" -d "$build/control.o" | grep -qE "$instructions"; then
        echo "$name: the reader does not find a multiply-add that is there" >&2
        exit 1
    fi
    cmake -S "$source_dir/tests/determinism" -B "$build" -DCMAKE_BUILD_TYPE=Release \
        -DCMAKE_C_FLAGS="$flags" -DCMAKE_CXX_FLAGS="$flags" "$@" >"$build/log.txt" 2>&1 &&
        cmake --build "$build" --target verge_core >>"$build/log.txt" 2>&1 ||
        { cat "$build/log.txt"; exit 1; }
    local archive
    archive=$(find "$build" -name libverge_core.a)
    local listing=$build/core.asm
    "$objdump" -d --no-show-raw-insn "$archive" >"$listing"
    if grep -nE "$instructions" "$listing" >"$build/found.txt"; then
        echo "$name: fused multiply-adds in the core:" >&2
        head -5 "$build/found.txt" >&2
        failed=1
    else
        echo "$name: $(grep -c $'^ .*:\t' "$listing") instructions, no fused multiply-add"
    fi
}

look x86-64-v3 objdump -march=x86-64-v3 gcc -DCMAKE_C_COMPILER=gcc -DCMAKE_CXX_COMPILER=g++
if command -v aarch64-linux-gnu-g++ >/dev/null; then
    look aarch64 aarch64-linux-gnu-objdump "" aarch64-linux-gnu-gcc \
        -DCMAKE_SYSTEM_NAME=Linux -DCMAKE_SYSTEM_PROCESSOR=aarch64 \
        -DCMAKE_C_COMPILER=aarch64-linux-gnu-gcc -DCMAKE_CXX_COMPILER=aarch64-linux-gnu-g++
else
    echo "aarch64: not looked at, g++-aarch64-linux-gnu is not installed"
fi
exit $failed
