"""How the tools say what they cannot use: one line on standard error, and exit status 2.

    def main():
        data = read_json(path)
        ...
        raise BadInput(f"{path}:3: what is wrong, what was expected")

    sys.exit(told_in_one_line(main))
"""
import json
import os
import pathlib
import re
import sys

HERE = pathlib.Path(__file__).resolve().parent


class BadInput(Exception):
    """The one line that says where something is wrong, what it is, and what was expected."""


def read_text(path, expected):
    """The text of a file; `expected` says in words what it should be."""
    path = pathlib.Path(path)
    if path.exists() and not path.is_file():
        what = "a directory" if path.is_dir() else "no regular file"
        raise BadInput(f"{path}:file: is {what}, expected {expected}")
    try:
        return path.read_text(encoding="utf-8")
    except UnicodeDecodeError as error:
        line = error.object[:error.start].count(b"\n") + 1
        raise BadInput(f"{path}:{line}: is not text, expected {expected}") from None
    except OSError as error:
        raise BadInput(f"{path}:file: cannot be read ({error.strerror}), "
                       f"expected {expected}") from None


def read_json(path, expected):
    """The JSON document of a file."""
    text = read_text(path, expected)
    if not text.strip():
        raise BadInput(f"{path}:1: is empty, expected {expected}")
    try:
        return json.loads(text)
    except json.JSONDecodeError as error:
        raise BadInput(f"{path}:{error.lineno}: is not JSON ({error.msg}), "
                       f"expected {expected}") from None
    except (ValueError, RecursionError) as error:
        raise BadInput(f"{path}:file: is not JSON ({error}), expected {expected}") from None


def version():
    """Of verge: written beside the tools where they are installed, else that of the sources."""
    beside = HERE / "version"
    if beside.exists():
        return beside.read_text(encoding="utf-8").strip()
    project = (HERE.parent / "CMakeLists.txt").read_text(encoding="utf-8")
    return re.search(r"^project\(verge VERSION ([0-9.]+)", project, re.MULTILINE)[1]


def two_files(about, names, more=""):
    """The two paths of a command line. --help and --version print and end the program.

    more: lines of the help on options that the program has taken out of sys.argv before.
    """
    program, given = pathlib.Path(sys.argv[0]).name, sys.argv[1:]
    if given == ["--version"]:
        print(f"{program} {version()}", flush=True)
        sys.exit(0)
    if given == ["--help"]:
        print(f"usage: {program} [options] {names}\n\n{about.strip()}\n\noptions:\n{more}"
              f"  {'--help':18} prints this and ends\n  {'--version':18} prints the version and ends",
              flush=True)
        sys.exit(0)
    if len(given) != 2 or any(word.startswith("--") for word in given):
        raise BadInput(f"{program}:arguments: expected {names}, see --help")
    return map(pathlib.Path, given)


def told_in_one_line(work):
    """Runs work(); returns the exit status of the program: what work returns, else 0 or 2."""
    try:
        status = work()
        sys.stdout.flush()
        return status or 0
    except BadInput as error:
        print(" ".join(str(error).split()), file=sys.stderr)
    except BrokenPipeError:  # whoever read us has seen enough
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 1
    except OSError as error:
        if error.filename is None:  # a stream
            print(f"{pathlib.Path(sys.argv[0]).name}:standard output: cannot be written "
                  f"({error.strerror}), expected an open stream with free space", file=sys.stderr)
            os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
            return 1
        print(f"{error.filename}:file: cannot be written ({error.strerror}), expected a file in an "
              "existing folder", file=sys.stderr)
    except KeyboardInterrupt:
        return 130
    return 2
