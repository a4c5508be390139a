"""Claim: a reader of the pages finds what they name, and needs nothing that is not here.

    pages.py SOURCE_DIR

README.md has at most 150 lines, its program is apps/examples/first_plan.c, and each page below is
one link away from it. Every link of every page leads to an existing file and heading; every source
file that a page names exists. No file of the tree cites a document that is not part of the tree.
"""
import pathlib
import re
import sys

README_LINES_MAX = 150
ONE_CLICK = {"CONTRIBUTING.md", "CHANGES.md", "core/README.md", "transport/README.md",
             "apps/README.md", "apps/experiment/RESULTS.md", "apps/man/verge.7"}
SKIPPED = re.compile(r"^(\.git|build.*|out|__pycache__|\.venv.*|\.cache)$")
TEXT = {".md", ".c", ".h", ".cpp", ".hpp", ".py", ".sh", ".txt", ".cmake", ".in", ".json", ".lcm",
        ".idl", ".js", ".html", ".css", ".1", ".5", ".7", ".8", ""}
# Documents that the project's writers have and its readers have not.
OUTSIDE = re.compile(r"\bfindings\b|house-style|\b(the|our) contract\b|\bcontract(:|'s\b)"
                     r"|\bshared/(?!data/us101\b)", re.IGNORECASE)
SOURCE_NAME = re.compile(r"[\w./-]*\w\.(?:c|h|cpp|hpp|lcm|idl|md)\b")
LINK = re.compile(r"\[[^\]]*\]\(([^)\s]+)\)")


def files_of(root):
    for path in sorted(root.iterdir()):
        if path.is_symlink() or (path.is_dir() and SKIPPED.match(path.name)):
            continue
        if path.is_dir():
            yield from files_of(path)
        elif path.suffix in TEXT:
            yield path


def without_code(text):
    """The text outside of fenced blocks, where links are links."""
    return re.sub(r"^```.*?^```$", "", text, flags=re.MULTILINE | re.DOTALL)


def anchors(text):
    """What GitHub calls the headings of a page."""
    found = set()
    for title in re.findall(r"^#+ +(.+)$", without_code(text), re.MULTILINE):
        name = re.sub(r"[^\w\- ]", "", title.lower()).replace(" ", "-")
        found.add(name)
    return found


def link_faults(page, text):
    for target in LINK.findall(without_code(text)):
        if re.match(r"[a-z]+:", target):
            continue
        name, _, anchor = target.partition("#")
        path = (page.parent / name) if name else page
        if not path.exists():
            yield f"link to {target}: no such file"
        elif anchor and anchor not in anchors(path.read_text()):
            yield f"link to {target}: no such heading"


def source_faults(page, text, names):
    """Names of source files, in code font or in a diagram; a name may begin below its folder."""
    for code in re.findall(r"```.*?```|`[^`]+`", text, re.DOTALL):
        for name in SOURCE_NAME.findall(code):
            found = (page.parent / name).exists() or any(
                path == name or path.endswith("/" + name) for path in names)
            if not found and "*" not in code:
                yield f"names {name}, which does not exist"


def readme_faults(root):
    text = (root / "README.md").read_text()
    if text.count("\n") > README_LINES_MAX:
        yield f"{text.count(chr(10))} lines, more than {README_LINES_MAX}"
    programs = re.findall(r"^```c\n(.*?)^```$", text, re.MULTILINE | re.DOTALL)
    if programs != [(root / "apps/examples/first_plan.c").read_text()]:
        yield "its C program is not apps/examples/first_plan.c"
    linked = {target.partition("#")[0] for target in LINK.findall(without_code(text))}
    for page in sorted(ONE_CLICK - linked):
        yield f"no link to {page}"


def main():
    root = pathlib.Path(sys.argv[1]).resolve()
    files = list(files_of(root))
    names = {str(path.relative_to(root)) for path in files}
    faults = [f"README.md: {fault}" for fault in readme_faults(root)]
    pages = 0
    for path in files:
        text, here = path.read_text(), path.relative_to(root)
        if path.suffix == ".md":
            pages += 1
            faults += [f"{here}: {fault}" for fault in link_faults(path, text)]
            faults += [f"{here}: {fault}" for fault in source_faults(path, text, names)]
        if path != pathlib.Path(__file__).resolve():
            faults += [f"{here}:{number}: cites what is not in the tree: {line.strip()}"
                       for number, line in enumerate(text.splitlines(), 1) if OUTSIDE.search(line)]
    for fault in faults:
        print(fault, file=sys.stderr)
    print(f"{pages} pages among {len(files)} files read, {len(faults)} faults")
    return 1 if faults or pages < 5 or len(files) < 200 else 0


sys.exit(main())
