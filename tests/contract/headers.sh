#!/bin/bash
# Claim: each public header compiles alone, first, without a warning, as C11 and as C++17.
#
#     headers.sh SOURCE_DIR GENERATED_DIR...
#
# GENERATED_DIR: where the message types made from the schema lie; their makers, not we, answer for
# their warnings.
set -euo pipefail
cd "$1"
shift
generated=()
for folder in "$@"; do
    generated+=(-isystem "$folder")
done
failed=0
count=0
for header in core/include/verge/*.h transport/include/verge/*.h; do
    name=${header#*/include/}
    for language in "gcc -x c -std=c11" "g++ -x c++ -std=c++17"; do
        count=$((count + 1))
        printf '#include "%s"\n#include "%s"\nint main(void);\n' "$name" "$name" |
            $language -Wall -Wextra -Wpedantic -Werror -fsyntax-only \
                -Icore/include -Itransport/include "${generated[@]}" - ||
            { echo "$header: $language" >&2; failed=1; }
    done
done
echo "$count compilations of public headers"
exit $failed
