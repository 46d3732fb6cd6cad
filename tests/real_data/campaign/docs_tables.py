#!/usr/bin/env python3
"""Fails if docs/evaluation.md holds other tables of the campaign than those of the committed results."""

import pathlib
import sys

import campaign

ROOT = pathlib.Path(__file__).resolve().parents[3]


def main():
    document = (ROOT / "docs/evaluation.md").read_text()
    wrong = [name for name in ("report.csv", "small-field.csv")
             if campaign.text_of(campaign.rows_from(ROOT / "bench/results/campaign" / name)) not in document]
    for name in wrong:
        print(f"docs/evaluation.md: the table of bench/results/campaign/{name} is another one (campaign.py read prints it)")
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
