"""Claim: arrows point one way, apps -> transport -> core, and core includes next to nothing.

    layers.py SOURCE_DIR

Reads every #include of the three layers. Exit 1 names each line that points the wrong way.
"""
import pathlib
import re
import sys

# What core may know of the outside: freestanding C headers and string.h for the memory functions.
# The mathematics of Eigen comes through linear.hpp, which says how it may be used, into a .cpp.
CORE_SYSTEM = {
    "stdint.h", "stddef.h", "stdbool.h", "limits.h", "float.h", "string.h", "assert.h",
    "cstdint", "cstddef", "cstring", "climits", "cfloat",
}
CORE_EIGEN = re.compile(r"^Eigen/")
# Folders of core/src and what each may include of the others.
ROOMS = {"base": {"base"}}
ROOMS["geometry"] = ROOMS["base"] | {"geometry"}
ROOMS["road"] = ROOMS["geometry"] | {"road"}
ROOMS["traffic"] = ROOMS["road"] | {"traffic"}
ROOMS["decide"] = ROOMS["traffic"] | {"decide"}
ROOMS["motion"] = ROOMS["traffic"] | {"motion"}  # not decide: a decision comes as a public struct
INCLUDE = re.compile(r'^\s*#\s*include\s+([<"])([^>"]+)[>"]')
SOURCES = {".h", ".c", ".cpp", ".hpp", ".cc", ".inc"}


def includes(folder):
    for path in sorted(folder.rglob("*")):
        if path.suffix in SOURCES:
            for number, line in enumerate(path.read_text().splitlines(), 1):
                match = INCLUDE.match(line)
                if match:
                    yield path, number, match.group(1), match.group(2)


def names_of(folder):
    """Header names as they are written in an #include: relative to their folder or to include/."""
    found = set()
    for path in folder.rglob("*.h"):
        found.add(path.name)
        parts = path.parts
        for root in ("include", "src"):
            if root in parts:
                found.add("/".join(parts[parts.index(root) + 1:]))
    return found


def core_faults(root, own, foreign):
    for path, number, bracket, name in includes(root / "core"):
        eigen = CORE_EIGEN.match(name) or name.endswith(".hpp")
        if bracket == '"' and name in own and name not in foreign - own:
            continue
        if bracket == "<" and name in CORE_SYSTEM:
            continue
        if CORE_EIGEN.match(name) and path.name == "linear.hpp":
            continue
        if name == "geometry/linear.hpp" and path.suffix == ".cpp":
            continue
        why = "Eigen goes through linear.hpp into a .cpp" if eigen else "core may not include this"
        yield f"{path.relative_to(root)}:{number}: {name}: {why}"


def room_faults(root):
    """Inside core a folder includes itself and folders named before it, and no file includes,
    through others, itself."""
    source = root / "core" / "src"
    graph = {}
    for path, number, bracket, name in includes(source):
        target = source / name
        if bracket != '"' or not target.exists():
            continue
        graph.setdefault(path, []).append(target)
        own = path.relative_to(source).parts
        other = target.relative_to(source).parts
        if len(own) > 1 and (len(other) == 1 or other[0] not in ROOMS[own[0]]):
            yield f"{path.relative_to(root)}:{number}: {name}: {own[0]}/ may not include it"
    state = {}

    def visit(path):
        if state.get(path) == "open":
            return True
        if path not in state:
            state[path] = "open"
            circle = any([visit(target) for target in graph.get(path, [])])
            state[path] = "done"
            return circle
        return False

    for path in sorted(graph):
        if visit(path):
            yield f"{path.relative_to(root)}: includes itself through others"


def transport_faults(root, apps, allowed):
    for path, number, bracket, name in includes(root / "transport"):
        if bracket == '"' and name in apps - allowed:
            yield f"{path.relative_to(root)}:{number}: {name}: transport may not include apps"
        if "cJSON" in name or "Eigen" in name:
            yield f"{path.relative_to(root)}:{number}: {name}: not for transport"


def main():
    root = pathlib.Path(sys.argv[1]).resolve()
    core, transport, apps = (names_of(root / name) for name in ("core", "transport", "apps"))
    faults = list(core_faults(root, core, transport | apps))
    faults += room_faults(root)
    faults += transport_faults(root, apps, core | transport)
    for fault in faults:
        print(fault, file=sys.stderr)
    count = sum(1 for layer in ("core", "transport", "apps") for _ in includes(root / layer))
    print(f"{count} includes read, {len(faults)} point the wrong way")
    return 1 if faults or count < 50 else 0


sys.exit(main())
