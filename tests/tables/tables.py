#!/usr/bin/env python3
"""Makes the tables of documents that hold figures from committed data, and compares the documents with them.

    tables.py            fails if a table of a page in PAGES is not the table that the data make, or has no maker
    tables.py --write    writes the tables that the data make into the pages
"""

import argparse
import collections
import pathlib
import sys

import commission
import console_shifts
import evaluation
import founding_paper
import markdown
import motion
import python_module
import renderers
import scout
import stereoscopic

# Of each page all tables in their order: the heading above a table, and the function that makes its lines. A table of
# words is declared by its header.
PAGES = {"docs/commands/commission.md": commission.TABLES,
         "docs/commands/scout.md": scout.TABLES,
         "docs/console-shifts.md": console_shifts.TABLES,
         "docs/evaluation.md": evaluation.TABLES,
         "docs/founding-paper.md": founding_paper.TABLES,
         "docs/motion.md": motion.TABLES,
         "docs/python.md": python_module.TABLES,
         "docs/renderers.md": renderers.TABLES,
         "docs/stereoscopic.md": stereoscopic.TABLES}


def wrong_headings(found, tables):
    """Says under which headings the page has more or fewer tables than makers."""
    in_page, made = collections.Counter(table.heading for table in found), collections.Counter(heading for heading, _ in tables)
    wrong = [f'"{heading}" has {in_page[heading]} tables, of which tests/tables makes or declares {made[heading]}'
             for heading in in_page | made if in_page[heading] != made[heading]]
    if not wrong and [table.heading for table in found] != [heading for heading, _ in tables]:
        wrong = ["the tables stand in another order than in tests/tables"]
    return wrong


def difference(lines, expected):
    """Says how the lines of a table differ from those expected."""
    said = [f"has    {line}" for line in lines if line not in expected]
    said += [f"should {line}" for line in expected if line not in lines]
    return said or ["has its rows in another order, or some twice"]


def check(text, tables):
    """What is wrong with a page, as lines; and the page as it should be."""
    lines = text.splitlines()
    found = markdown.tables_in(lines)
    wrong = wrong_headings(found, tables)
    if wrong:
        return wrong, text
    for table, (heading, made) in reversed(list(zip(found, tables))):  # from the end: earlier places stay
        old = lines[table.begin:table.end]
        new = made() if callable(made) else [made, *old[1:]]
        if old != new:
            wrong = [f'"{heading}" {line}' for line in difference(old, new)] + wrong
            lines[table.begin:table.end] = new
    return wrong, "\n".join(lines) + "\n"


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--write", action="store_true", help="write the tables into the pages")
    parser.add_argument("--root", type=pathlib.Path, default=markdown.ROOT, help="folder with the pages' docs/")
    options = parser.parse_args()
    is_right = True
    for page, tables in PAGES.items():
        path = options.root / page
        text = path.read_text()
        wrong, right = check(text, tables)
        if options.write and right != text:
            path.write_text(right)
            wrong, _ = check(right, tables)
        for line in wrong:
            print(f"{page}: {line}")
        is_right &= not wrong
    return 0 if is_right else 1


if __name__ == "__main__":
    sys.exit(main())
