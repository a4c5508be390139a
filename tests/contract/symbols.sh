#!/bin/bash
# Claim: the planner core stands alone. The archive asks the outside for nothing but the four
# memory functions every compiler may call on its own.
#
#     symbols.sh libverge_core.a
#
# No heap, clock, file, thread, libm or libstdc++ can hide from this. Exit 1 names what it found.
set -euo pipefail
archive=$1
allowed='memcpy memmove memset memcmp'

defined=$(nm --defined-only --extern-only "$archive" 2>/dev/null |
    awk 'NF == 3 { print $3 }' | sort -u)
undefined=$(nm --undefined-only "$archive" 2>/dev/null | awk 'NF == 2 { print $2 }' | sort -u)
if [ -z "$defined" ]; then
    echo "no symbols in $archive" >&2
    exit 1
fi
foreign=$(comm -23 <(printf '%s\n' $undefined | sort -u) \
    <(printf '%s\n' $defined $allowed | sort -u))
if [ -n "$foreign" ]; then
    echo "the core needs symbols it must not need:" >&2
    for symbol in $foreign; do
        where=$(nm -A --undefined-only "$archive" 2>/dev/null |
            awk -v s="$symbol" '$NF == s { print $1 }' |
            sed 's/.*[:]\([^:]*\.o\):.*/\1/' | sort -u | tr '\n' ' ')
        echo "    $symbol    in $where" >&2
    done
    exit 1
fi

# Names of the archive that any program linking it will see: ours carry their prefix.
alien=$(printf '%s\n' $defined | grep -v -E '^(verge_|vg_)' || true)
if [ -n "$alien" ]; then
    echo "the core puts names without its prefix into other people's programs:" >&2
    printf '    %s\n' $alien >&2
    exit 1
fi
echo "$(printf '%s\n' $defined | wc -l) names defined, needs only: $(
    comm -12 <(printf '%s\n' $undefined | sort -u) <(printf '%s\n' $allowed | sort) | tr '\n' ' ')"
