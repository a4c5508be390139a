#!/bin/bash
# Claim: the Debian packages hold what they should, and the daemon runs from them: unpacked into an
# empty folder it checks the configuration it came with, plans for the vehicles of a scenario of
# verge-tools, and obeys SIGTERM; the same with the example of a secured site.
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
for package in libverge-dev verge-rsu verge-tools; do
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

deb=$work/made/verge-rsu_${version}_$architecture.deb
dpkg-deb -e "$deb" "$work/control"
grep -qE '^Depends: .*adduser.*libc6 .*libcjson1' "$work/control/control" ||
    fail "$(grep Depends "$work/control/control")"
while read -r file; do
    [ -f "$work/root$file" ] || fail "conffile $file is not in the package"
done <"$work/control/conffiles"
(cd "$work/root" && find etc -type f | sed 's#^#/#' | sort) | diff - "$work/control/conffiles" ||
    fail "what lies in /etc is not what conffiles lists"
for script in postinst prerm postrm; do
    sh -n "$work/control/$script"
    [ -x "$work/control/$script" ] || fail "$script cannot be run"
done
dpkg-deb -c "$deb" | awk '$2 != "root/root" || $1 ~ /^.....w|^........w|^-..s/ { print; bad = 1 }
    END { exit bad }' || fail "the files above belong to others or may be written by others"
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
grep -qF "ExecStart=/usr/bin/verge-rsu --config /etc/verge/rsu.json" \
    "$work/root/usr/lib/systemd/system/verge-rsu.service" || fail "the unit starts something else"
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
echo "packages of $version: $(cd "$work/made" && ls ./*.deb | tr '\n' ' ')"
