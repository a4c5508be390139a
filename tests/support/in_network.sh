#!/bin/sh
# Runs a command in a network of its own: loopback only, multicast routed to it.
#
#     tests/support/in_network.sh COMMAND [ARGUMENT...]
#
# Tests of the bus neither hear nor disturb anyone else that way, and run in parallel.
# Exit status: the command's; 77 (skipped) where the kernel refuses a private network.
if ! unshare -rn true 2>/dev/null; then
    echo "SKIPPED: this machine refuses a private network (unshare -rn): $*" >&2
    exit 77
fi
exec unshare -rn sh -c '
    ip link set lo up && ip link set lo multicast on && ip route add 224.0.0.0/4 dev lo &&
    exec "$@"' network "$@"
