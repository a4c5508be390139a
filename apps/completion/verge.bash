# Completion of all programs of verge in bash. The programs themselves say what there is: the
# options and the kinds of their values come from --help.
_verge() {
    local program=$1 current=$2 previous=$3 help kind words=
    COMPREPLY=()
    help=$("$program" --help 2>/dev/null) || return 0
    # "  --option VALUE   text": what VALUE of the option before the cursor is called, if it has one
    kind=$(printf '%s\n' "$help" | sed -n "s/^  $previous \([A-Z][A-Za-z.-]*\) .*/\1/p")
    if [[ $previous != --* || -z $kind ]]; then
        kind=$(printf '%s\n' "$help" | sed -n '1s/.*\] //p') # the argument
        if [[ $current == -* || -z $kind || $kind == usage:* ]]; then
            kind=OPTION
        fi
    fi
    case $kind in
    OPTION) words=$(printf '%s\n' "$help" | sed -n 's/^  \(--[a-z-]*\).*/\1/p') ;;
    LEVEL) words='error warning info debug' ;;
    FORMAT) words='text json' ;;
    URL) words='lcm:udpm:// dds:0 unix: log:' ;;
    *\|*) words=${kind//|/ } ;;
    N | K | S | SHARE | FROM-TO | LIST | NAME) return 0 ;;
    DIR) mapfile -t COMPREPLY < <(compgen -d -- "$current"); return 0 ;;
    *) mapfile -t COMPREPLY < <(compgen -f -- "$current"); return 0 ;;
    esac
    mapfile -t COMPREPLY < <(compgen -W "$words" -- "$current")
}
complete -o filenames -o bashdefault -F _verge verge-rsu verge-obu verge-ctl verge-echo verge-plan \
    verge-sim verge-publish verge-replay verge-plot verge-replay-html verge-bench verge-experiment
