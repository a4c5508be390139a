#!/bin/bash
# Claim: on a fresh Debian 12 the packages install with all they need, the daemon plans there under
# its own user, and removing and purging them takes everything away again.
#
#     package_root.sh SOURCE_DIR BUILD_DIR WORK_DIR
#
# For tools/check --long (VERGE_TEST_LONG=1): it fetches a Debian system. Needs root, debootstrap
# and Debian's archive; without one of them it says so and is skipped.
set -euo pipefail
source_dir=$1
build_dir=$2
work=$3
fail() { echo "package_root: $*" >&2; exit 1; }
skip() { echo "SKIPPED: $*"; exit 77; }
[ -n "${VERGE_TEST_LONG:-}" ] || skip "only tools/check --long fetches a fresh Debian"
[ "$(id -u)" = 0 ] || skip "debootstrap wants root"
command -v debootstrap >/dev/null || skip "debootstrap is missing"
unshare -n true 2>/dev/null || skip "this machine refuses a private network"

root=$work/root
# debootstrap mounts /proc in there, and a run that was killed leaves it mounted.
remove() {
    umount "$root/proc" "$root/sys" 2>/dev/null || true
    rm -rf --one-file-system "$@"
}
remove "$work"
mkdir -p "$work"
mirror=$(awk '/^URIs:/ { print $2; exit } /^deb / { for (i = 2; i <= NF; i++)
    if ($i ~ /^http/) { print $i; exit } }' /etc/apt/sources.list.d/*.sources \
    /etc/apt/sources.list 2>/dev/null || true)
debootstrap --variant=minbase bookworm "$root" "${mirror:-http://deb.debian.org/debian}" \
    >"$work/debootstrap.log" 2>&1 ||
    skip "no fresh Debian to be had: $(tail -1 "$work/debootstrap.log")"
trap 'remove "$root"' EXIT

cpack --config "$build_dir/CPackConfig.cmake" -B "$root/packages" >"$work/cpack.log" 2>&1 ||
    { cat "$work/cpack.log"; exit 1; }
inside() { DEBIAN_FRONTEND=noninteractive LC_ALL=C chroot "$root" "$@"; }
find "$root/etc" "$root/usr/bin" "$root/usr/lib" "$root/var/lib" -name '*verge*' >"$work/before"
[ ! -s "$work/before" ] || fail "the fresh system knows verge: $(cat "$work/before")"

inside sh -c 'apt-get update -qq && apt-get install -qq --no-install-recommends \
    /packages/verge-common_*.deb /packages/verge-rsu_*.deb /packages/verge-obu_*.deb \
    /packages/verge-tools_*.deb' >"$work/install.log" 2>&1 ||
    { tail -20 "$work/install.log"; fail "does not install"; }
for user in verge verge-obu; do
    inside getent passwd $user | grep -q ":/var/lib/$user:/usr/sbin/nologin$" ||
        fail "no user $user"
    [ "$(inside stat -c '%U:%G %a' /etc/$user/keys)" = "root:$user 750" ] ||
        fail "/etc/$user/keys: $(inside stat -c '%U:%G %a' /etc/$user/keys)"
done
inside chroot --userspec=verge-obu:verge-obu / /usr/bin/verge-obu \
    --config /etc/verge-obu/obu.json --check-config >"$work/check.log" 2>&1 ||
    { cat "$work/check.log"; fail "the on-vehicle unit refuses the configuration it comes with"; }

inside install -d -o verge -g verge -m 0750 /run/verge # as systemd would, RuntimeDirectory

# site CONFIG BUS PUBLISH_OPTION...: the daemon as its user beside vehicles, both in the fresh
# system and in a network of their own
site() {
    inside chroot --userspec=verge:verge / /usr/bin/verge-rsu --config "$1" --check-config \
        >"$work/check.log" 2>&1 || { cat "$work/check.log"; fail "$1 is refused"; }
    unshare -n bash -s "$root" "$work" "$@" <<'END'
set -euo pipefail
root=$1 work=$2 config=$3 bus=$4
shift 4
ip link set lo up && ip link set lo multicast on && ip route add 224.0.0.0/4 dev lo
chroot --userspec=verge:verge "$root" /usr/bin/verge-rsu --config "$config" 2>"$work/rsu.log" &
daemon=$!
trap 'kill -9 $daemon 2>/dev/null || true' EXIT
for _ in $(seq 300); do
    ! grep -q event=READY "$work/rsu.log" || break
    sleep 0.1
done
chroot "$root" verge-publish /usr/share/verge/scenarios/ramp-case1.json --bus "$bus" \
    --duration 5 "$@" >"$work/publish.log"
chroot "$root" verge-ctl status >"$work/status.log"
kill -TERM $daemon
wait $daemon
trap - EXIT
END
    grep -q planned "$work/publish.log" ||
        { cat "$work/rsu.log" "$work/publish.log"; fail "no plans on $2"; }
}
site /etc/verge/rsu.json 'lcm:udpm://239.255.76.67:7667?ttl=0'
if grep -q '^VERGE_DDS:BOOL=ON' "$build_dir/CMakeCache.txt"; then
    "$source_dir/tools/certs" --out "$root/root/certs" rsu car7 >"$work/certs.log"
    # As the site's README has it.
    inside sh -e -c 'cd /root/certs
        install -o root -g verge -m 0640 identity_ca.crt.pem permissions_ca.crt.pem \
            governance.p7s rsu.crt.pem rsu.permissions.p7s /etc/verge/keys
        install -o verge -g verge -m 0600 rsu.key.pem /etc/verge/keys
        install -m 0644 /usr/share/doc/verge-rsu/examples/rsu-dds-secured.json \
            /etc/verge/secured.json'
    site /etc/verge/secured.json dds:0 --bus-options /root/certs/car7.options.json
    rm "$root/etc/verge/secured.json" # not the package's: it would outlive it
fi

# An upgrade keeps what the site changed; a purge leaves nothing but the user.
echo '{ "changed": "by the site" }' >"$root/etc/verge/rsu.json"
inside sh -c 'dpkg --force-confdef --force-confold -i /packages/verge-rsu_*.deb' \
    >"$work/upgrade.log" 2>&1
grep -q 'by the site' "$root/etc/verge/rsu.json" || fail "an upgrade overwrote the configuration"
inside dpkg --remove verge-rsu verge-obu verge-common verge-tools >"$work/remove.log" 2>&1
[ -f "$root/etc/verge/rsu.json" ] || fail "removing took the configuration away"
inside dpkg --purge verge-rsu verge-obu verge-common verge-tools >"$work/purge.log" 2>&1
# Names that begin with ours: libraries of others have files on convergence and divergence.
find "$root/etc" "$root/usr/bin" "$root/usr/lib" "$root/var/lib" \
    \( -name 'verge*' -o -name 'libverge*' \) >"$work/after"
[ ! -s "$work/after" ] || fail "purged, and yet there: $(tr '\n' ' ' <"$work/after")"
echo "installed, planned, upgraded, removed and purged on a fresh Debian"
