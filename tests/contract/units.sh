#!/bin/bash
# Claim: the systemd units are understood and take from the daemons what these do not need:
# systemd's own judge gives an exposure of at most 2.0 of 10.
#
#     units.sh BUILD_DIR WORK_DIR
set -euo pipefail
build_dir=$1
work=$2
if ! command -v systemd-analyze >/dev/null; then
    echo "SKIPPED: systemd-analyze is missing (Debian: systemd)"
    exit 77
fi
rm -rf "$work"
mkdir -p "$work"
# installed COMPONENT CONFIG: a second installation keeps what the site has changed
installed() {
    cmake --install "$build_dir" --prefix "$work/usr" --component "$1" >"$work/install.log"
    echo '{ "changed": "by the site" }' >"$work/usr/etc/$2"
    cmake --install "$build_dir" --prefix "$work/usr" --component "$1" >"$work/install.log"
    grep -q 'by the site' "$work/usr/etc/$2" ||
        { echo "installing again overwrote the configuration" >&2; exit 1; }
}
installed rsu verge/rsu.json
installed obu verge-obu/obu.json
units=$work/usr/lib/systemd/system
for daemon in verge-rsu verge-obu; do # a template is judged by an instance
    cp "$units/$daemon@.service" "$work/$daemon@east.service"
done

# score UNIT: its exposure; says nothing where the judge could not be asked
score() {
    systemd-analyze security --offline=true --no-pager "$1" 2>"$work/score.log" |
        sed -n 's/.*Overall exposure level for .*: \([0-9.]*\) .*/\1/p'
}

for unit in "$units"/verge-{rsu,obu}.service "$work"/verge-{rsu,obu}@east.service; do
    if ! systemd-analyze verify --man=no "$unit" >"$work/verify.log" 2>&1 ||
        [ -s "$work/verify.log" ]; then
        cat "$work/verify.log"
        exit 1
    fi
    got=$(score "$unit")
    if [ -z "$got" ]; then
        echo "SKIPPED: systemd-analyze does not judge here: $(tail -1 "$work/score.log")"
        exit 77
    fi
    echo "${unit##*/}: exposure $got"
    awk -v got="$got" 'BEGIN { exit !(got <= 2.0) }' || { echo "more than 2.0" >&2; exit 1; }
done

# The judge notices when something is missing.
grep -v -e '^SystemCallFilter' -e '^CapabilityBoundingSet' "$units/verge-rsu.service" \
    >"$work/weak.service"
awk -v got="$(score "$work/weak.service")" 'BEGIN { exit !(got > 2.0) }'
sed 's/^WatchdogSec=.*/WatchdogSec=often/' "$units/verge-rsu.service" >"$work/wrong.service"
systemd-analyze verify --man=no "$work/wrong.service" >"$work/verify.log" 2>&1 || true
grep -q often "$work/verify.log"
