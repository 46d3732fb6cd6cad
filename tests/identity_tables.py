#!/usr/bin/env python3
"""Fails if docs/evaluation.md lacks a row of what `identity_check` found as bench/results/identity has it."""

import csv
import sys

import documented_rows

# The cases of each row of "Identity and handedness".
ROWS = {"their own X-rays": ["right"],
        "mirrored, turned, exchanged, gantry + 180 in one or both views":
            ["AP mirrored", "lateral mirrored", "AP turned", "angles exchanged", "gantry + 180 in view 1",
             "gantry + 180 in view 2", "gantry + 180 in both"],
        "the lateral of another patient": ["lateral of another patient"],
        "another patient": ["another patient"]}


def row(words, verdicts):
    accepted, *others = (verdicts.count(verdict) for verdict in ("accepted", "review", "rejected"))
    return f"| {words} | {accepted} of {len(verdicts)} | " + " | ".join(str(count or "-") for count in others) + " |"


def main():
    found = [case for path in sorted((documented_rows.ROOT / "bench/results/identity").glob("ct-*.csv"))
             for case in csv.DictReader(path.open(newline=""))]
    rows = [row(words, [case["verdict"] for case in found if case["case"] in cases]) for words, cases in ROWS.items()]
    return documented_rows.compare("docs/evaluation.md", rows)


if __name__ == "__main__":
    sys.exit(main())
