#!/usr/bin/env python3
"""Fails if docs/evaluation.md holds other tables of the campaign and of faults than those of the committed results."""

import pathlib
import sys

import campaign
import faults

ROOT = pathlib.Path(__file__).resolve().parents[3]


def main():
    document = (ROOT / "docs/evaluation.md").read_text()
    results = ROOT / "bench/results/campaign"
    tables = {"report.csv": campaign.text_of(campaign.rows_from(results / "report.csv")),
              "faults.csv": faults.text_of(faults.rows_from(results / "faults.csv"))}
    wrong = [name for name, table in tables.items() if table not in document]
    for name in wrong:
        print(f"docs/evaluation.md: the table of bench/results/campaign/{name} is another one (campaign.py or faults.py read "
              "prints it)")
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
