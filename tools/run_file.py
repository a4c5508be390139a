"""Reading a run file: format verge-run/1, JSON Lines, as verge-sim and verge-publish write it."""
import json
import math
import sys

from one_line import BadInput, read_text

EXPECTED = "a run file (format verge-run/1)"


def read_lines(path):
    """[(line number, document)]. A last line that was cut off is left out, which is said."""
    found = []
    texts = read_text(path, EXPECTED).splitlines()
    for number, text in enumerate(texts, 1):
        if not text.strip():
            continue
        try:
            document = json.loads(text)
        except (ValueError, RecursionError):
            if found and number == len(texts):
                print(f"{path}:{number}: cut off; the run is read up to there", file=sys.stderr)
                break
            raise BadInput(f"{path}:{number}: is not JSON, expected {EXPECTED}") from None
        if not isinstance(document, dict):
            raise BadInput(f"{path}:{number}: is not an object, expected {EXPECTED}")
        found.append((number, document))
    if not found:
        raise BadInput(f"{path}:1: is empty, expected {EXPECTED}")
    if found[0][1].get("format") != "verge-run/1":
        raise BadInput(f"{path}:1: is not a run file, expected format verge-run/1")
    return found


def check_row(row):
    """A vehicle at a tick, [id, x, y, heading, speed, acceleration, lane, action, brake, turn]."""
    if len(row) != 10 or not all(math.isfinite(value) for value in row[1:6]):
        raise ValueError(f"row of vehicle {row[0]}")


def read_run(path, begin, add):
    """Hands the scenario of a run to begin() and every other line to add(). What these do not
    understand is a fault of the file, named by its line."""
    number = 1
    try:
        for number, document in read_lines(path):
            if number == 1:
                begin(document["scenario"])
            else:
                add(document)
    except (ArithmeticError, AttributeError, KeyError, IndexError, TypeError,
            ValueError) as error:
        raise BadInput(f"{path}:{number}: unexpected or missing {error}, "
                       f"expected {EXPECTED}") from None
