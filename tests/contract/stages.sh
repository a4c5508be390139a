#!/bin/bash
# Claim: a stage can be left out. A program that brings its own decision links no search; one that
# brings its own trajectories links no sampler.
#
#     stages.sh EXAMPLES_DIRECTORY
set -euo pipefail
defines() { nm --defined-only "$1" | awk '{ print $NF }' | grep -E "^($2)\$" || true; }
faults=0
refuse() { # PROGRAM SYMBOLS
    local found
    found=$(defines "$1" "$2")
    [ -z "$found" ] || { echo "${1##*/} links $found" >&2; faults=1; }
}
for language in c11 cxx17; do
    refuse "$1/example-own_decision-$language" 'vg_search_run|vg_tree_take|vg_flow_bound|verge_planner_step_for'
    refuse "$1/example-own_trajectory-$language" 'verge_plan_vehicle_for|vg_batch_run|verge_planner_step_for'
    # The names are those of functions: the whole planner has them.
    all=$(defines "$1/example-first_plan-$language" 'vg_search_run|vg_batch_run|verge_planner_step_for' | wc -l)
    [ "$all" = 3 ] || { echo "example-first_plan-$language has $all of three stages" >&2; faults=1; }
done
exit $faults
