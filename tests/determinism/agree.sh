#!/bin/bash
# Claim: the variants that run.sh built agree with each other, independently of the golden digests.
#
#     agree.sh WORK_DIR
#
# Where this passes and run.sh fails, the planner's behaviour changed, everywhere alike. Where this
# fails, one machine plans something else than another: a defect.
set -euo pipefail
cd "$1"
first=gcc-native/digests.txt
count=0
failed=0
for other in */digests.txt; do
    count=$((count + 1))
    last=$(awk 'END { print $2 }' "$other") # cycle; some variants make fewer
    [ -n "$last" ] || { echo "${other%/*} printed no digest" >&2; exit 1; }
    if ! awk -v last="$last" '$2 <= last' "$first" | diff - "$other" >difference.txt; then
        echo "${first%/*} (<) and ${other%/*} (>) plan differently:" >&2
        head -10 difference.txt >&2
        failed=1
    fi
done
echo "$count variants compared, $(wc -l <"$first") digests each"
[ "$count" -ge 2 ] || { echo "only $count variant was built" >&2; exit 1; }
exit $failed
