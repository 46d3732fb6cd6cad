#!/usr/bin/env python3
"""Fails if docs/evaluation.md holds other tables of the campaign than those of the committed results."""

import pathlib
import sys

import campaign

ROOT = pathlib.Path(__file__).resolve().parents[3]


def main():
    document = (ROOT / "docs/evaluation.md").read_text()
    table = campaign.text_of(campaign.rows_from(ROOT / "bench/results/campaign/report.csv"))
    if table in document:
        return 0
    print("docs/evaluation.md: the table of bench/results/campaign/report.csv is another one (campaign.py read prints it)")
    return 1


if __name__ == "__main__":
    sys.exit(main())
