#!/bin/bash
# Claim: what the units take away is not missed. Each daemon runs, on every bus, with the stack, the
# locked memory and the view of /proc that its unit gives it; recording (the roadside unit), serving
# its operators and reading its configuration again, it makes no system call that the unit's filter
# refuses, opens no socket of another family, maps nothing writable and executable.
#
#     sandbox.sh SOURCE_DIR BUILD_DIR WORK_DIR
set -euo pipefail
source_dir=$1
build_dir=$2
work=$3
unit=$source_dir/apps/systemd/daemon.service.in
fail() { echo "sandbox: $*" >&2; exit 1; }
skip() { echo "SKIPPED: $*"; exit 77; }
for tool in strace systemd-analyze; do
    command -v $tool >/dev/null || skip "$tool is missing (Debian: strace, systemd)"
done
strace -o /dev/null true 2>/dev/null || skip "this machine refuses strace"
unshare -rnmpf mount -t proc proc /proc 2>/dev/null || skip "this machine refuses a private /proc"
rm -rf "$work"
mkdir -p "$work"

# calls SET: the system calls of one of systemd's sets, the sets inside it as well
calls() {
    systemd-analyze syscall-filter --no-pager "$1" | sed -n 's/^    \([a-z0-9_@-]*\)$/\1/p' |
        while read -r name; do
            case $name in @*) calls "$name" ;; *) echo "$name" ;; esac
        done
}
setting() { sed -n "s/^$1=//p" "$unit"; }
setting SystemCallFilter | while read -r line; do # a ~ turns its whole line round
    for set in ${line#\~}; do
        case $line in
        ~*) calls "$set" >>"$work/denied" ;;
        *) calls "$set" >>"$work/allowed" ;;
        esac
    done
done
sort -u "$work/allowed" | comm -23 - <(sort -u "$work/denied") >"$work/permitted"
[ "$(wc -l <"$work/permitted")" -gt 200 ] || fail "systemd's sets could not be read"

# Locked memory as far as this machine grants it; the unit's is 256 MB.
memory=$(ulimit -H -l)
lock=false
if [ "$memory" = unlimited ] || [ "$memory" -ge 262144 ]; then
    memory=262144
    lock=true
else
    echo "locked memory is not tried: this machine grants $memory kB"
fi

run=$(mktemp -d) # a socket's path is short
trap 'rm -rf "$run"' EXIT

rsu='"format": "verge-rsu/1"'
obu='"format": "verge-obu/1", "vehicle_id": 0'

# run NAME BUS KEYS DAEMON OPTION...: the keys are the daemon's own
run() {
    cat >"$work/$1.json" <<END
{ $3, "bus": "$2", "cycle_ms": 50,
  "road_file": "$source_dir/apps/site/road.json", "control": "$run/ctl.sock",
  "metrics": { "listen": "127.0.0.1:9464", "file": "$run/metrics" },
  "realtime": { "lock_memory": $lock } }
END
    unshare -rnmpf sh -c '
        mount -t proc -o subset=pid,hidepid=invisible proc /proc
        ip link set lo up && ip link set lo multicast on && ip route add 224.0.0.0/4 dev lo
        ulimit -S -s 256
        ulimit -l "$4"
        export MALLOC_ARENA_MAX=1
        (
            until "$3" --socket "$2/ctl.sock" status; do sleep 0.1; done
            "$3" --socket "$2/ctl.sock" reload
            for _ in $(seq 300); do
                ! grep -q event=config_applied "$5" || break
                sleep 0.1
            done
            kill -TERM "$(cat "$2/pid")"
        ) >/dev/null 2>&1 &
        calls=$1 run=$2
        shift 5
        exec strace -f -qq -o "$calls" sh -c "echo \$\$ >$run/pid; exec \"\$@\"" sh "$@"' sh \
        "$work/$1.calls" "$run" "$build_dir/bin/verge-ctl" "$memory" "$work/$1.log" \
        "$build_dir/bin/$4" --config "$work/$1.json" "${@:5}" 2>"$work/$1.log" ||
        { cat "$work/$1.log"; fail "$4 does not run on $2"; }
    sed -nE 's/^[0-9]+ +([a-z0-9_]+)\(.*/\1/p' "$work/$1.calls" | sort -u >"$work/$1.used"
    grep -q '^accept4\?$' "$work/$1.used" || fail "nobody was served while strace looked"
    grep -q event=config_applied "$work/$1.log" || { cat "$work/$1.log"; fail "no reload"; }
    local refused
    # What strace's own start-up does before the daemon is systemd's to do: execve is permitted.
    refused=$(comm -23 "$work/$1.used" "$work/permitted" | tr '\n' ' ')
    [ -z "$refused" ] || fail "$2: the unit's filter refuses $refused"
    for family in $(grep -oE 'socket\(AF_[A-Z0-9]+' "$work/$1.calls" | cut -d'(' -f2 | sort -u); do
        setting RestrictAddressFamilies | grep -qw "$family" || fail "$2: $family is refused"
    done
    ! grep -E '(mmap|mprotect)\(.*PROT_WRITE[^,]*PROT_EXEC' "$work/$1.calls" ||
        fail "$2: memory both writable and executable"
    echo "$4 on $2: $(wc -l <"$work/$1.used") system calls, all permitted"
}
own='"state": "unix:'$run'/own-state", "trajectory": "unix:'$run'/trajectory"'
run lcm 'lcm:udpm://239.255.76.67:7667?ttl=0' "$rsu" verge-rsu --record "$run/log"
run unit-lcm 'lcm:udpm://239.255.76.67:7667?ttl=0' "$obu, $own" verge-obu
if grep -q '^VERGE_DDS:BOOL=ON' "$build_dir/CMakeCache.txt"; then
    run dds dds:0 "$rsu" verge-rsu --record "$run/log"
    run unit-dds dds:0 "$obu" verge-obu
fi
