#!/bin/bash
# Claim: the firmware of apps/embedded plans the same on a Cortex-M7 without an operating system as
# on this computer, and its longest cycle is short enough for ten a second on a part of 200 MHz,
# with a margin of four. Its memory besides the road is small.
#
#     firmware.sh SOURCE_DIR WORK_DIR
#
# Exit 77 where the compiler or emulator is not installed.
set -euo pipefail
instructions_most=5000000 # a cycle
arena_most=98304          # [B]
embedded=$1/apps/embedded
build=$2/firmware

for tool in arm-none-eabi-g++ qemu-system-arm; do
    command -v $tool >/dev/null ||
        { echo "SKIPPED: $tool is not installed (tools/setup)"; exit 77; }
done

# build DIRECTORY CMAKE_ARGUMENT...
build() {
    local directory=$1
    shift
    mkdir -p "$directory"
    { cmake -S "$embedded" -B "$directory" "$@" && cmake --build "$directory"; } \
        >"$directory/log.txt" 2>&1 ||
        { grep -E -A3 'error|undefined' "$directory/log.txt" >&2; exit 1; }
}

build "$build/desktop"
build "$build/board" -DCMAKE_TOOLCHAIN_FILE="$embedded/arm-none-eabi.cmake"
"$build/desktop/firmware" >"$build/desktop.txt"
timeout 120 "$embedded/emulate" "$build/board/firmware.elf" >"$build/board.txt"

arena=$(arm-none-eabi-size -A "$build/board/firmware.elf" | awk '$1 == ".arena" { print $2 }')
[ "$arena" -gt 0 ] && [ "$arena" -le $arena_most ] ||
    { echo "the arena has $arena B, at most $arena_most are allowed" >&2; exit 1; }

plans() { sed -n 's/^\(plan .*\) ticks .*/\1/p' "$1"; } # the desktop has no clock
count=$(plans "$build/board.txt" | wc -l)
[ "$count" = 150 ] || { echo "the firmware made $count plans, expected 150" >&2; exit 1; }
diff <(plans "$build/desktop.txt") <(plans "$build/board.txt") ||
    { echo "this computer (<) and the board (>) plan differently" >&2; exit 1; }
longest=0
for ticks in $(sed -n 's/.* ticks //p' "$build/board.txt"); do
    instructions=$((16#$ticks * 40)) # the board's clock
    longest=$((instructions > longest ? instructions : longest))
done
if [ $longest = 0 ] || [ $longest -gt $instructions_most ]; then
    echo "the longest cycle took $longest instructions, at most $instructions_most are allowed" >&2
    exit 1
fi
echo "the longest cycle took $longest instructions, the arena has $arena B"
echo "$count plans of the firmware are the same on this computer and on a Cortex-M7"
