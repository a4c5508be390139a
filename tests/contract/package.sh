#!/bin/bash
# Claim: the Debian packages hold what they should, and the daemons run from them. Unpacked into an
# empty folder, each checks the configuration it came with and obeys SIGTERM; the roadside unit
# plans for the vehicles of a scenario of verge-tools, the on-vehicle unit makes trajectories for
# one of them, over local sockets; the same with the examples of a secured site.
#
#     package.sh SOURCE_DIR BUILD_DIR WORK_DIR
set -euo pipefail
source_dir=$1
build_dir=$2
work=$3
fail() { echo "package: $*" >&2; exit 1; }
command -v dpkg-deb >/dev/null || { echo "SKIPPED: dpkg-deb is missing"; exit 77; }
command -v dpkg-shlibdeps >/dev/null ||
    { echo "SKIPPED: dpkg-shlibdeps is missing (Debian: dpkg-dev)"; exit 77; }

rm -rf "$work"
mkdir -p "$work"
cpack --config "$build_dir/CPackConfig.cmake" -B "$work/made" >"$work/cpack.log" 2>&1 ||
    { cat "$work/cpack.log"; exit 1; }
version=$(sed -n 's/^project(verge VERSION \([0-9.]*\).*/\1/p' "$source_dir/CMakeLists.txt")-1
architecture=$(dpkg --print-architecture)
for package in libverge-dev verge-common verge-rsu verge-obu verge-tools; do
    deb=$work/made/${package}_${version}_$architecture.deb
    [ -f "$deb" ] || fail "$deb is missing: $(ls "$work/made")"
    dpkg-deb -x "$deb" "$work/root"
done

# Whoever packages the same again gets the same bytes.
export SOURCE_DATE_EPOCH=1700000000
for again in first second; do
    cpack --config "$build_dir/CPackConfig.cmake" -B "$work/$again" >"$work/cpack.log" 2>&1
    (cd "$work/$again" && sha256sum ./*.deb) >"$work/$again.sums"
done
diff "$work/first.sums" "$work/second.sums" || fail "packaged twice, the packages differ"

# control DAEMON: dependencies, configuration files and scripts of its package
control() {
    local deb=$work/made/$1_${version}_$architecture.deb control=$work/control-$1
    dpkg-deb -e "$deb" "$control"
    grep -qE "^Depends: .*adduser, verge-common \(= $version\).*libc6 .*libcjson1" \
        "$control/control" || fail "$1: $(grep Depends "$control/control")"
    dpkg-deb --fsys-tarfile "$deb" | tar -t | sed -n 's#^\.\(/etc/.*[^/]\)$#\1#p' | sort |
        diff - <(sort "$control/conffiles") || fail "$1: conffiles does not list what lies in /etc"
    for script in postinst prerm postrm; do
        sh -n "$control/$script"
        [ -x "$control/$script" ] || fail "$1: $script cannot be run"
        ! grep -q '@[A-Z_]*@' "$control/$script" || fail "$1: $script has a place left open"
    done
    dpkg-deb -c "$deb" |
        awk '$2 != "root/root" || $1 ~ /^.....w|^........w|^-..s/ { print; bad = 1 }
        END { exit bad }' || fail "the files above belong to others or may be written by others"
    grep -qF "ExecStart=/usr/bin/$1 --config $2" \
        "$work/root/usr/lib/systemd/system/$1.service" || fail "the unit starts something else"
}
control verge-rsu /etc/verge/rsu.json
control verge-obu /etc/verge-obu/obu.json
[ "$(cd "$work/made" && for deb in ./*.deb; do dpkg-deb -c "$deb"; done |
    awk '$6 !~ /\/$/ { print $6 }' | sort | uniq -d)" = "" ] || fail "a file is in two packages"
if grep -rlF -e "$source_dir" -e "$work" "$work/root"; then
    fail "the files above name the place they were built at"
fi

for program in "$work"/root/usr/bin/*; do
    name=${program##*/}
    page=$(find "$work/root/usr/share/man" -name "$name.[18].gz")
    [ -n "$page" ] && gzip -t "$page" || fail "$name has no manual page"
    [ -f "$work/root/usr/share/bash-completion/completions/$name" ] || fail "$name: no completion"
    programs="${programs:-} $name"
done
# Every program that is built is in a package.
(cd "$build_dir/bin" && printf ' %s' verge-*) | diff - <(printf '%s' "$programs") ||
    fail "built and packaged programs differ"

# What draws a run, from there: with the packages it asks for and nothing of the sources.
dpkg-deb -f "$work/made/verge-tools_${version}_$architecture.deb" Depends |
    grep -qE 'python3, .*python3-matplotlib' || fail "verge-tools does not ask for what it draws with"
"$work/root/usr/bin/verge-sim" "$work/root/usr/share/verge/scenarios/ramp-case1.json" \
    --out "$work/run.jsonl" >"$work/sim.log"
if /usr/bin/python3 -c 'import matplotlib' 2>/dev/null; then
    for pair in plot:png replay-html:html; do
        program=$work/root/usr/bin/verge-${pair%:*}
        (cd / && "$program" "$work/run.jsonl" "$work/run.${pair#*:}") || fail "$program fails"
        [ -s "$work/run.${pair#*:}" ] || fail "$program writes nothing"
        [ "$("$program" --version)" = "${program##*/} ${version%-1}" ] || fail "$program: version"
    done
    [ -z "$(find "$work/root" -name __pycache__)" ] || fail "what runs leaves files in its folder"
else
    echo "python3-matplotlib is missing: what draws runs is not run"
fi

# The daemon from there, as a unit would run it: the site it comes with, then the secured one.
etc=$work/root/etc/verge
bin=$work/root/usr/bin
scenario=$work/root/usr/share/verge/scenarios/ramp-case1.json
ulimit -S -s 256 # the unit's
run=$(mktemp -d) # for /run/verge: a socket's path is short
trap 'rm -rf "$run"' EXIT

# site CONFIG BUS PUBLISH_OPTION...: vehicles get plans from the daemon at this site
site() {
    grep -q '"/run/verge/rsu.sock"' "$1" || fail "$1 has no control socket"
    sed -i "s#/run/verge#$run#" "$1"
    "$bin/verge-rsu" --config "$1" --check-config >"$work/check.log" 2>&1 ||
        fail "$(cat "$work/check.log")"
    grep -q 'planner, all together' "$work/check.log"
    "$source_dir/tests/support/in_network.sh" bash -s "$bin" "$work" "$run" "$scenario" "$@" \
        <<'END'
set -euo pipefail
bin=$1 work=$2 run=$3 scenario=$4 config=$5 bus=$6
shift 6
"$bin/verge-rsu" --config "$config" 2>"$work/rsu.log" &
daemon=$!
trap 'kill -9 $daemon 2>/dev/null || true' EXIT
for _ in $(seq 300); do
    ! grep -q event=READY "$work/rsu.log" || break
    sleep 0.1
done
"$bin/verge-publish" "$scenario" --bus "$bus" --duration 5 "$@" >"$work/publish.log"
"$bin/verge-ctl" --socket "$run/rsu.sock" --json status >"$work/status.json"
kill -TERM $daemon
wait $daemon
trap - EXIT
END
    grep -q planned "$work/publish.log" ||
        { cat "$work/rsu.log" "$work/publish.log"; fail "no plans on $2"; }
    grep -q '"fault":"none"' "$work/status.json" || fail "$(cat "$work/status.json")"
}

site "$etc/rsu.json" 'lcm:udpm://239.255.76.67:7667?ttl=0'
if "$bin/verge-rsu" --config "$source_dir/apps/site/rsu-dds-secured.json" --check-config \
    >/dev/null 2>&1; then
    fail "a secured site without keys is accepted"
fi
if grep -q '^VERGE_DDS:BOOL=ON' "$build_dir/CMakeCache.txt"; then
    "$work/root/usr/share/doc/verge-rsu/examples/certs" --out "$etc/keys" rsu car7 >"$work/certs.log"
    cp "$work/root/usr/share/doc/verge-rsu/examples/rsu-dds-secured.json" "$etc/rsu.json"
    site "$etc/rsu.json" dds:0 --bus-options "$etc/keys/car7.options.json"
fi

# The on-vehicle unit from there. verge-publish is its localisation, verge-echo its controller.
# unit CONFIG
unit() {
    grep -q '"/run/verge-obu/obu.sock"' "$1" || fail "$1 has no control socket"
    sed -i "s#/run/verge-obu#$run#; s#/run/vehicle#$run#; s#\(\"vehicle_id\":\) 7#\1 0#" "$1"
    "$bin/verge-obu" --config "$1" --check-config >"$work/check.log" 2>&1 ||
        fail "$(cat "$work/check.log")"
    grep -q 'on-vehicle unit, all together' "$work/check.log"
    "$source_dir/tests/support/in_network.sh" bash -s "$bin" "$work" "$run" "$scenario" "$1" <<'END'
set -euo pipefail
bin=$1 work=$2 run=$3 scenario=$4 config=$5
"$bin/verge-obu" --config "$config" 2>"$work/obu.log" &
daemon=$!
trap 'kill -9 $daemon $(jobs -p) 2>/dev/null || true' EXIT
for _ in $(seq 300); do
    ! grep -q event=READY "$work/obu.log" || break
    sleep 0.1
done
"$bin/verge-publish" "$scenario" --bus "unix:$run/own-state" --send-only --duration 20 \
    >"$work/publish.log" 2>&1 &
timeout 20 "$bin/verge-echo" "unix:$run/trajectory" --count 10 >"$work/echo.log"
"$bin/verge-ctl" --socket "$run/obu.sock" status >"$work/unit.log"
kill -TERM $daemon
wait $daemon
END
    grep -q '^trajectory ' "$work/echo.log" ||
        { cat "$work/obu.log"; fail "no trajectories of $1"; }
    grep -q 'vehicle 0: alone, never_heard' "$work/unit.log" || fail "$(cat "$work/unit.log")"
}
obu=$work/root/etc/verge-obu
unit "$obu/obu.json"
if grep -q '^VERGE_DDS:BOOL=ON' "$build_dir/CMakeCache.txt"; then
    cp -r "$etc/keys" "$obu"
    cp "$work/root/usr/share/doc/verge-obu/examples/obu-dds-secured.json" "$obu/obu.json"
    unit "$obu/obu.json"
fi
echo "packages of $version: $(cd "$work/made" && ls ./*.deb | tr '\n' ' ')"
