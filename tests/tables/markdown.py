"""Tables of Markdown pages, written and found, and the data that they are made from."""

import csv
import functools
import json
import pathlib
import re

ROOT = pathlib.Path(__file__).resolve().parents[2]
RESULTS = ROOT / "bench/results"

_DELIMITER = re.compile(r"\s*\|?(\s*:?-+:?\s*\|)+(\s*:?-+:?\s*)?")


@functools.cache
def json_of(name):
    """A JSON file of bench/results. Callers leave it as it is."""
    return json.loads((RESULTS / name).read_text())


@functools.cache
def rows_of(name):
    """The rows of a CSV file of bench/results, by the names of their columns. Callers leave them as they are."""
    with (RESULTS / name).open(newline="") as file:
        return list(csv.DictReader(file))


def row(cells):
    return ("| " + " | ".join(str(cell) for cell in cells) + " |").replace("|  |", "| |")


def table(header, rows):
    """The lines of a table; header and rows are lists of cells."""
    rows = [list(cells) for cells in rows]
    assert all(len(cells) == len(header) for cells in rows), (header, rows)
    return [row(header), "| --- " * len(header) + "|", *map(row, rows)]


def words(header):
    """Declares a table of words: no program makes it, and only its header is compared."""
    return header


class Found:
    """A table of a page: lines[begin:end], under a heading."""

    def __init__(self, heading, begin, end):
        self.heading, self.begin, self.end = heading, begin, end


def tables_in(lines):
    found, heading, is_code, begin = [], None, False, None
    for number, line in enumerate([*lines, ""]):
        is_code ^= line.lstrip().startswith("```")
        is_row = not is_code and (line.lstrip().startswith("|") or _DELIMITER.fullmatch(line) is not None)
        if is_row and begin is None:
            begin = number
        if not is_row and begin is not None:
            found.append(Found(heading, begin, number))
            begin = None
        if not is_code and re.match("#+ ", line):
            heading = line.lstrip("#").strip()
    return found
