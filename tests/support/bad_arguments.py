#!/usr/bin/python3
"""Writes a test that calls every public function of the core with bad arguments.

    bad_arguments.py HEADER... > test_bad_arguments.c

The functions are read from the headers, so a new one is tested without being listed. Each argument
in turn takes each bad value of its type, while all others are valid; in the last call all pointers
are null. No call may crash. A status must be an error where a pointer is null that may not be.
A type that is not in VALID ends this script: add a valid value to it and to bad_arguments.h.
"""
import re
import sys

# A valid value of each type; a name after the type goes before the type alone.
VALID = {
    "verge_body_kind": "VERGE_BODY_CAR", "verge_action": "VERGE_KEEP_SPEED",
    "verge_status": "VERGE_OK", "verge_reason": "VERGE_REASON_NONE",
    "verge_habit_kind": "VERGE_NORMAL", "verge_why": "VERGE_WHY_LEADER",
    "verge_priority": "VERGE_PRIORITY_STOP", "verge_signal_state": "VERGE_SIGNAL_RED",
    "verge_hypothesis": "VERGE_YIELDS",
    "const verge_human_rules*": "&human_rules",
    "const verge_signal*": "traffic_signals", "verge_signal_fault*": "&signal_fault",
    "double": "1.0", "double dt": "0.1", "int32_t": "1", "uint32_t": "2", "uint32_t k": "3",
    "int64_t": "200000", "uint64_t": "VERGE_CONFIG", "size_t": "ROOM", "size_t text": "sizeof text",
    "char*": "text", "const char*": '"speed"', "const char**": "&words", "uint32_t*": "&count32",
    "size_t*": "&a_size", "void*": "room",
    "double*": "&out_x", "double* y": "&out_y", "double* cosine": "&out_y",
    "double* heading": "&out_heading",
    "const verge_body*": "&body", "verge_body_fault*": "&body_fault",
    "const verge_action_step*": "&action_step",
    "verge_vehicle_decision*": "decided", "const verge_vehicle_decision*": "decided",
    "const verge_decision*": "&decision", "verge_decision*": "&decision",
    "verge_commitment*": "&commitment",
    "const verge_planner_def*": "&def",
    "const verge_cause*": "&decided[0].why",
    "verge_decider**": "&made_decider", "verge_decider*": "decider", "const verge_decider*": "decider",
    "verge_planner**": "&made_planner", "verge_planner*": "planner", "const verge_planner*": "planner",
    "verge_predictor**": "&made_predictor", "verge_predictor*": "predictor",
    "verge_sampler**": "&made_sampler", "verge_sampler*": "sampler", "const verge_sampler*": "sampler",
    "verge_humans**": "&made_humans", "verge_humans*": "humans",
    "const verge_road**": "&made_road", "const verge_road*": "road",
    "const verge_road_def*": "&road_def", "verge_road_fault*": "&road_fault",
    "verge_lane_report*": "&lane_report",
    "verge_memory_term*": "terms", "verge_plan*": "&plan",
    "const verge_vehicle*": "vehicles", "verge_vehicle*": "vehicles",
    "verge_vehicle* room": "placed", "verge_lane_position*": "positions",
    "verge_vehicle_fault*": "&vehicle_fault",
    "verge_scene*": "&scene", "const verge_scene*": "&scene", "const verge_scene* before": "&scene_before",
    "verge_track*": "&track", "verge_tracks*": "&tracks", "const verge_tracks*": "&tracks",
    "const verge_vehicle_plan* last": "last_plans",
    "const verge_vehicle_plan*": "&vehicle_plan_before", "verge_vehicle_plan*": "&vehicle_plan",
}
BAD = {
    "double": ["NAN", "INFINITY", "-INFINITY", "1e300", "-1e300", "0.0"],
    "int32_t": ["-1", "99", "INT32_MIN", "INT32_MAX"],
    "int64_t": ["INT64_MIN", "INT64_MAX"],
    "uint64_t": ["0", "UINT64_MAX"],
    "uint32_t k": ["UINT32_MAX"],
    "uint32_t": ["0"],
    "size_t": ["0", "1"],
}
ENUMS = ("verge_body_kind", "verge_action", "verge_status", "verge_reason", "verge_habit_kind", "verge_why",
         "verge_priority", "verge_signal_state")
MAY_BE_NULL = {
    "fault", "before", "rules", "road_size", "verge_predict.decision", "verge_predict_for.decision",
}


def functions(paths):
    found = {}
    for path in paths:
        text = re.sub(r"//.*", "", open(path, encoding="utf-8").read())
        text = re.sub(r"^#(.*\\\n)*.*", "", text, flags=re.M)
        for match in re.finditer(r"^(?!\s)(?!typedef)([\w \*]*?)\b(verge_\w+)\(([^;{)]*)\)\s*[;{]",
                                 text, re.M):
            result, name, parameters = match.groups()
            result = result.replace("static inline", "").strip()
            if result and not re.search(r"\bvoid verge_executor", match.group(0)):
                found[name] = (result, [p.strip() for p in " ".join(parameters.split()).split(",")
                                        if p.strip() != "void"])
    return found


def split(parameter):
    """Type and name; an array is a pointer."""
    array = parameter.endswith("]")
    parameter = re.sub(r"\[.*\]", "", parameter)
    kind, name = re.fullmatch(r"(.*?)(\w+)", parameter).groups()
    return re.sub(r" \*", "*", kind.strip()) + ("*" if array else ""), name


def valid(function, kind, name, names):
    if kind == "size_t" and "text" in names:
        return VALID["size_t text"]
    if kind == "verge_vehicle*" and function == "verge_scene_make":
        return VALID["verge_vehicle* room"]
    if kind == "const verge_scene*" and function.startswith("verge_planner_repeat"):
        return "&scene_of_planner"
    value = VALID.get(f"{kind} {name}", VALID.get(kind))
    if value is None:
        sys.exit(f"bad_arguments.py: no valid {kind} for {name} of {function}(), add one to VALID")
    return value


def bad_values(kind, name):
    if kind.endswith("*"):
        return ["NULL"]
    if kind in ENUMS:
        return [f"({kind})-1", f"({kind})1000"]
    return BAD.get(f"{kind} {name}", BAD.get(kind, []))


def calls(name, result, parameters):
    typed = [split(p) for p in parameters]
    names = [n for _, n in typed]
    good = [valid(name, kind, n, names) for kind, n in typed]
    variants = [(good, None)]
    for i, (kind, n) in enumerate(typed):
        for value in bad_values(kind, n):
            must = None
            if value == "NULL" and result == "verge_status":
                must = n not in MAY_BE_NULL and f"{name}.{n}" not in MAY_BE_NULL
            variants.append((good[:i] + [value] + good[i + 1:], must))
    nulls = ["NULL" if kind.endswith("*") else value for (kind, _), value in zip(typed, good)]
    variants.append((nulls, None))
    for arguments, must in variants:
        call = f"{name}({', '.join(arguments)})"
        label = call.replace('"', "'")
        yield "    fresh();"
        yield f'    under_way = "{label}";'
        if must is None:
            yield f"    (void){call};"
        else:
            sign = "<" if must else "=="
            yield f"    if (!({call} {sign} VERGE_OK)) {{"
            yield f'        fail_msg("%s must be {"refused" if must else "accepted"}", under_way);'
            yield "    }"


def main():
    found = functions(sys.argv[1:])
    if len(found) < 60:
        sys.exit(f"bad_arguments.py: only {len(found)} functions found")
    print('// Made by bad_arguments.py.\n#include "bad_arguments.h"\n')
    tests = []
    for name, (result, parameters) in sorted(found.items()):
        tests.append(f"{name}_takes_any_argument")
        print(f"static void {tests[-1]}(void** state)\n{{\n    (void)state;")
        print("\n".join(calls(name, result, parameters)))
        print("}\n")
    tests += ["a_scene_that_does_not_hold_is_refused_by_every_stage",
              "a_decision_that_is_not_finite_or_names_what_is_unknown_is_refused",
              "tracks_that_are_not_finite_are_refused",
              "whatever_stands_in_the_last_plan_a_plan_is_made",
              "the_clock_may_jump_by_any_amount"]
    print("int main(void)\n{\n    const struct CMUnitTest tests[] = {")
    print("\n".join(f"        cmocka_unit_test({test})," for test in tests))
    print("    };\n    return cmocka_run_group_tests(tests, NULL, NULL);\n}")


if __name__ == "__main__":
    main()
