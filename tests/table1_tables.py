#!/usr/bin/env python3
"""Fails if docs/renderers.md lacks a row of Table 1 as bench/results/table1-*.json have it."""

import json
import sys

import documented_rows

PAPER = {  # of its Table 1, ms: the spine at thresholds 20 and 70 of 255, the pig at 10 and 60
    "wobbled splatting, basic": (58.1, 15.0, 68.9, 46.1),
    "wobbled splatting, noise texture": (57.0, 15.3, 68.0, 45.0),
    "wobbled splatting, vertex buffer objects": (29.5, 8.4, 34.5, 23.0),
    "ray casting, basic": (14.1, 13.0, 22.2, 21.8),
    "ray casting, cuberille 64 voxels": (20.9, 17.9, 24.7, 24.2),
    "ray casting, cuberille 8 voxels": (17.9, 10.0, 38.3, 20.5),
    "ray casting, sparse 50 %": (12.0, 11.0, 15.3, 15.3),
    "ray casting, sparse 25 %": (9.8, 9.0, 13.4, 13.3),
    "ray casting, cuberille 8 + sparse 25 %": (11.9, 7.3, 22.1, 12.8),
}


def milliseconds(time):
    decimals = 0 if time["mean"] >= 20 else 1 if time["mean"] >= 2 else 2
    return f"{time['mean']:.{decimals}f} +/- {time['sd']:.{decimals}f}"


def header(tables):
    cells = [f"{table['volume']} {table['threshold_hu']:+.0f} HU ({100 * table['share_above']:.1f} % above)" for table in tables]
    return "| method | " + " | ".join(f"{cell} | paper" for cell in cells) + " |"


def rows(tables):
    yield header(tables)
    for of_method in zip(*(table["rows"] for table in tables)):
        method = of_method[0]["method"]
        cells = [milliseconds(row["wall_ms"]) for row in of_method]
        paper = PAPER.get(method, ("-",) * len(cells))
        yield f"| {method} | " + " | ".join(f"{cell} | {then}" for cell, then in zip(cells, paper)) + " |"


def main():
    files = sorted((documented_rows.ROOT / "bench/results").glob("table1-*.json"))
    return documented_rows.compare("docs/renderers.md",
                                   [row for file in files for row in rows(json.loads(file.read_text())["tables"])])


if __name__ == "__main__":
    sys.exit(main())
