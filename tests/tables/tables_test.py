#!/usr/bin/env python3
"""The check of the documents' tables fails where a page was damaged, and --write repairs what data can make."""

import pathlib
import re
import shutil
import subprocess
import sys
import tempfile
import unittest

import markdown
import tables

PAGES = {page: (markdown.ROOT / page).read_text() for page in tables.PAGES}


def damaged(line):
    """The line with its last digit changed, behind its first cell where there is one."""
    digits = list(re.finditer("[0-9]", line))
    at = digits[-1].start()
    return line[:at] + str((int(line[at]) + 1) % 10) + line[at + 1:]


class TablesTest(unittest.TestCase):
    def assert_fails(self, page, lines, says):
        wrong, _ = tables.check("\n".join(lines) + "\n", tables.PAGES[page])
        self.assertTrue(any(says in line for line in wrong), f"{page}: {says} not in {wrong}")

    def made_rows(self):
        """Of every page its lines and each number of a line with figures, with the heading above it."""
        for page, text in PAGES.items():
            lines = text.splitlines()
            for table, (heading, made) in zip(markdown.tables_in(lines), tables.PAGES[page]):
                if callable(made):
                    for number in range(table.begin, table.end):
                        if re.search("[0-9]", lines[number]):
                            yield page, lines, number, heading

    def test_a_changed_figure_in_any_row_fails(self):
        rows = list(self.made_rows())
        self.assertGreater(len(rows), 150)
        for page, lines, number, heading in rows[::7]:
            changed = damaged(lines[number])
            self.assert_fails(page, [*lines[:number], changed, *lines[number + 1:]], f'"{heading}" has    {changed}')

    def test_a_row_that_is_missing_fails(self):
        for page, lines, number, heading in list(self.made_rows())[::13]:
            self.assert_fails(page, lines[:number] + lines[number + 1:], f'"{heading}" ')

    def test_rows_in_another_order_fail(self):
        lines = PAGES["docs/motion.md"].splitlines()
        number = next(number for number, line in enumerate(lines) if line.startswith("| kalman |"))
        lines[number], lines[number + 1] = lines[number + 1], lines[number]
        self.assert_fails("docs/motion.md", lines, "another order")

    def test_a_table_without_a_maker_fails(self):
        for added in (["| machine | ms |", "| --- | --- |", "| ours | 7 |"], ["machine | ms", "--- | ---", "ours | 7"]):
            for page, text in PAGES.items():
                self.assert_fails(page, [*text.splitlines(), "", "## Measured", "", *added, ""],
                                  '"Measured" has 1 tables, of which tests/tables makes or declares 0')

    def test_a_table_that_is_gone_fails(self):
        for page, text in PAGES.items():
            lines = text.splitlines()
            table = markdown.tables_in(lines)[0]
            self.assert_fails(page, lines[:table.begin] + lines[table.end:], f'"{table.heading}" has ')

    def test_a_table_of_words_is_compared_by_its_header(self):
        page = "docs/renderers.md"
        lines = PAGES[page].splitlines()
        begin = markdown.tables_in(lines)[0].begin
        more = [*lines[:begin + 2], "| `other` | a | b | c |", *lines[begin + 2:]]
        wrong, _ = tables.check("\n".join(more) + "\n", tables.PAGES[page])
        self.assertEqual(wrong, [])
        self.assert_fails(page, [*lines[:begin], "| name | ms | runs on | used for |", *lines[begin + 1:]], '"Renderers" ')

    def test_the_program_fails_and_writes(self):
        program = [sys.executable, "-B", pathlib.Path(tables.__file__)]
        with tempfile.TemporaryDirectory() as folder:
            shutil.copytree(markdown.ROOT / "docs", pathlib.Path(folder) / "docs")
            copy = pathlib.Path(folder) / "docs/evaluation.md"
            copy.write_text(PAGES["docs/evaluation.md"].replace("chest-still | 200/200 | 0.10 +", "chest-still | 200/200 | 0.01 +"))
            self.assertNotEqual(copy.read_text(), PAGES["docs/evaluation.md"])
            failed = subprocess.run([*program, "--root", folder], capture_output=True, text=True, check=False)
            self.assertEqual(failed.returncode, 1, failed.stderr)
            self.assertIn('docs/evaluation.md: "Preset setup" has    | chest-still | 200/200 | 0.01 ', failed.stdout)
            subprocess.run([*program, "--root", folder, "--write"], check=True)
            self.assertEqual(copy.read_text(), PAGES["docs/evaluation.md"])
            subprocess.run([*program, "--root", folder], check=True)


if __name__ == "__main__":
    unittest.main()
