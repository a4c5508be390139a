#!/bin/bash
# Claim: an application needs only the installed library. Programs in C and in C++ find it by
# pkg-config and by find_package(verge), build without a warning and run, in any install folder.
#
#     consumer.sh SOURCE_DIR BUILD_DIR WORK_DIR
set -euo pipefail
source_dir=$1
build_dir=$2
work=$3
consumer=$source_dir/tests/contract/consumer
rm -rf "$work"
mkdir -p "$work"
cmake --install "$build_dir" --prefix "$work/first" --component dev >"$work/install.log"
mv "$work/first" "$work/installed" # what was installed may be moved: nothing names its place
prefix=$work/installed
if grep -rIl -e "$source_dir" -e "$build_dir" -e "$work" "$prefix/lib" "$prefix/include"; then
    echo "the files above name the place they were built or first installed" >&2
    exit 1
fi
version=$(sed -n 's/^project(verge VERSION \([0-9.]*\).*/\1/p' "$source_dir/CMakeLists.txt")

# run WAY PROGRAM WORDS
run() {
    local said
    said=$("$2")
    [ "$said" = "$3, version $version" ] || { echo "$1: $2 said: $said" >&2; exit 1; }
    echo "$1: $said"
}

PKG_CONFIG_PATH=$(dirname "$(find "$prefix" -name verge.pc)")
export PKG_CONFIG_PATH
[ "$(pkg-config --modversion verge)" = "$version" ]
warnings=(-Wall -Wextra -Wpedantic -Werror)
# shellcheck disable=SC2046 # pkg-config answers with several options
gcc -std=c11 "${warnings[@]}" "$consumer/main.c" -o "$work/pc-c" \
    $(pkg-config --cflags --libs verge-transport)
# shellcheck disable=SC2046
g++ -std=c++17 "${warnings[@]}" "$consumer/main.cpp" -o "$work/pc-cxx" \
    $(pkg-config --cflags --libs verge)
run pkg-config "$work/pc-c" "planned 1, sent 1"
run pkg-config "$work/pc-cxx" "refused 1, field successors"

for language in OFF ON; do
    cmake -S "$consumer" -B "$work/cmake-$language" -DCMAKE_PREFIX_PATH="$prefix" \
        -DWITH_CXX=$language >"$work/cmake.log" 2>&1 &&
        cmake --build "$work/cmake-$language" >>"$work/cmake.log" 2>&1 ||
        { cat "$work/cmake.log"; exit 1; }
done
run find_package "$work/cmake-OFF/in-c" "planned 1, sent 1"
run find_package "$work/cmake-ON/in-cxx" "refused 1, field successors"

# A version that does not exist must not be found.
echo 'find_package(verge 9.0 REQUIRED)' >"$work/wrong.cmake"
if cmake -S "$consumer" -B "$work/wrong" -DCMAKE_PREFIX_PATH="$prefix" \
    -DCMAKE_PROJECT_INCLUDE="$work/wrong.cmake" >"$work/wrong.log" 2>&1; then
    echo "find_package(verge 9.0) was satisfied with $version" >&2
    exit 1
fi
grep -q 'considered but not accepted' "$work/wrong.log"
