#!/bin/sh
# Runs a command in a network of its own: loopback only, multicast routed to it.
#
#     tests/support/in_network.sh COMMAND [ARGUMENT...]
#     tests/support/in_network.sh --possible            exit 0 where that works on this machine
#
# Tests of the bus are isolated from other traffic by it, and can run in parallel.
# Exit status: the command's; 77 (skipped) where the kernel refuses a private network.
if unshare -rn true 2>/dev/null; then
    private='unshare -rn'
elif unshare -n true 2>/dev/null; then # root where user namespaces are refused: a chroot
    private='unshare -n'
else
    echo "SKIPPED: this machine refuses a private network (unshare -rn): $*" >&2
    exit 77
fi
[ "$1" != --possible ] || exit 0
exec $private sh -c '
    ip link set lo up && ip link set lo multicast on && ip route add 224.0.0.0/4 dev lo &&
    exec "$@"' network "$@"
