#!/usr/bin/env python3
"""What README.md shows of the program: its example, and the pictures of the demo. Made, or compared with what is there.

  docs/make.py PROGRAM --check     # exits with 1 where the README says something that the program does not print
  docs/make.py PROGRAM --write     # writes what the program prints, and docs/pictures/{demo-view1,report-pdf,report-html}.png

Needs pdftoppm (poppler-utils) and chromium. Run --write with a program that was built from a clean commit: the report names it.
"""

import pathlib
import re
import shlex
import struct
import subprocess
import sys
import tempfile

ROOT = pathlib.Path(__file__).resolve().parents[1]
README = ROOT / "README.md"
PICTURES = ROOT / "docs" / "pictures"
NUMBER = re.compile(r"[+-]?\d+(?:\.\d+)?")
# Processors round differently (AVX2, AVX-512), and a search then ends a few hundredths of a millimeter elsewhere.
ROUNDING = 0.1


def frame_of(line):
    """A line without its numbers and the width of its columns."""
    return " ".join(NUMBER.sub("#", line).split())


def examples(text):
    """(command, lines) of every block that begins with `$ isoshift`."""
    for block in re.findall(r"^```\n\$ (isoshift .*?)^```", text, re.MULTILINE | re.DOTALL):
        command, *lines = block.rstrip("\n").split("\n")
        yield command, [line for line in lines if line.strip()]


def output_of(program, command, folder):
    words = shlex.split(command)
    done = subprocess.run([program, *words[1:]], cwd=folder, capture_output=True, text=True, check=False)
    if done.returncode != 0:
        sys.exit(f"README.md: {command} ended with status {done.returncode}: {done.stderr}")
    return (done.stdout + done.stderr).split("\n")


def run_examples(program, folder, write):
    text, wrong = README.read_text(), []
    for command, lines in examples(text):
        printed = {frame_of(line): line for line in output_of(program, command, folder)}
        for line in lines:
            found = printed.get(frame_of(line))
            if found is None:
                wrong.append(f"README.md: {command} does not print\n  {line}")
            elif any(abs(float(a) - float(b)) > ROUNDING for a, b in zip(NUMBER.findall(line), NUMBER.findall(found))):
                wrong.append(f"README.md: {command} prints\n  {found}\ninstead of\n  {line}")
            if write and found is not None:
                text = text.replace(line + "\n", found + "\n", 1)
    if write:
        README.write_text(text)
    return wrong


def make_pictures(result, to):
    """The pictures of the demo's result, from its folder."""
    (to / "demo-view1.png").write_bytes((result / "view1.png").read_bytes())
    subprocess.run(["pdftoppm", "-png", "-r", "75", "-f", "1", "-l", "1", "-singlefile", result / "report.pdf", to / "report-pdf"], check=True)
    subprocess.run(["chromium", "--headless", "--no-sandbox", "--disable-gpu", "--hide-scrollbars", "--disable-background-networking",
                    f"--user-data-dir={to / 'chromium'}", f"--screenshot={to / 'report-html.png'}", "--window-size=1100,1357", "--force-device-scale-factor=0.72727",
                    (result / "report.html").resolve().as_uri()], check=True, capture_output=True, timeout=120)


def size_of(png):
    return struct.unpack(">II", png.read_bytes()[16:24])


def main(program, what):
    if what not in ("--check", "--write"):
        sys.exit(__doc__)
    with tempfile.TemporaryDirectory() as folder:
        folder = pathlib.Path(folder)
        wrong = run_examples(str(pathlib.Path(program).resolve()), folder, what == "--write")
        made = folder / "pictures"
        made.mkdir()
        make_pictures(folder / "result", made)
        for picture in sorted(made.glob("*.png")):
            committed = PICTURES / picture.name
            if what == "--write":
                committed.write_bytes(picture.read_bytes())
            elif not committed.exists() or size_of(committed) != size_of(picture):
                wrong.append(f"{committed.relative_to(ROOT)}: expected a picture of {size_of(picture)} pixels")
    if what == "--check" and wrong:
        sys.exit("\n".join(wrong) + "\ndocs/make.py PROGRAM --write mends it.")


if __name__ == "__main__":
    main(*sys.argv[1:])
