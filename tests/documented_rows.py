"""Tables of docs that hold what was measured."""

import pathlib
import sys

ROOT = pathlib.Path(__file__).resolve().parents[1]


def compare(document, rows):
    """The exit status: 1 if the document (a path from ROOT) lacks one of the rows. With --print, prints the rows instead."""
    if "--print" in sys.argv:
        print("\n".join(rows))
        return 0
    lines = (ROOT / document).read_text().splitlines()
    missing = [row for row in rows if row not in lines]
    for row in missing:
        print(f"{document} lacks the row {row}")
    return 1 if missing else 0
