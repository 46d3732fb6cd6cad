#!/usr/bin/python3
"""What the documents show of the program: the README's example, and pictures. Made, or compared with what is there.

  docs/make.py PROGRAM --check     # exits with 1 where the README says something that the program does not print, where a
                                   # picture cannot be made, and where nobody knows what made one
  docs/make.py PROGRAM --write     # writes what the program prints, and all pictures that show it

PROGRAM lies where it was built, and the Python module beside it; --write needs a clean commit, which the report names.
Needs pdftoppm (poppler-utils), chromium and what the tests of the screen need.
"""

import pathlib
import re
import shlex
import subprocess
import sys
import tempfile
from concurrent.futures import ThreadPoolExecutor

import make_pictures

ROOT = pathlib.Path(__file__).resolve().parents[1]
README = ROOT / "README.md"
PICTURES = ROOT / "docs" / "pictures"
# The pictures that are not made here.
ORIGINS = {"bounding_structures.png": "isoshift bench figures, of a real CT (docs/renderers.md)",
           "renderers.png": "isoshift bench figures, of a real CT",
           "sparse_pixels.png": "isoshift bench figures, of a real CT",
           "registration-frames.svg": "drawn by hand",
           "scaling-cpu.svg": "bench/plot_scaling.py (bench/results/README.md)",
           "scaling-raycast-llvmpipe.svg": "bench/plot_scaling.py"}
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
            elif not write and any(abs(float(a) - float(b)) > ROUNDING for a, b in zip(NUMBER.findall(line), NUMBER.findall(found))):
                wrong.append(f"README.md: {command} prints\n  {found}\ninstead of\n  {line}")
            if write and found is not None:
                text = text.replace(line + "\n", found + "\n", 1)
    if write:
        README.write_text(text)
    return wrong


def compare_pictures(made):
    """What is wrong with the pictures of docs, beside those made now."""
    committed = {path.name for path in PICTURES.iterdir()}
    text = "".join(page.read_text() for page in [README, *(ROOT / "docs").rglob("*.md")])
    shown = set(re.findall(r"pictures/([\w-]+\.\w+)", text))
    new = {path.name for path in made.glob("*.png")}
    wrong = [f"docs/pictures/{name}: no document shows it" for name in committed - shown]
    wrong += [f"docs/pictures/{name}: a document shows it, and it is not there" for name in shown - committed]
    wrong += [f"docs/pictures/{name}: neither made by docs/make.py nor named in its ORIGINS" for name in committed - new - ORIGINS.keys()]
    wrong += [f"docs/pictures/{name}: made, and not committed" for name in new - committed]
    return wrong


def main(program, what):
    if what not in ("--check", "--write"):
        sys.exit(__doc__)
    write = what == "--write"
    program = pathlib.Path(program).resolve()
    version = subprocess.run([program, "--version"], check=True, capture_output=True, text=True).stdout
    if write and "-dirty" in version:
        sys.exit(f"--write needs a program of a clean commit, not {version}")
    with tempfile.TemporaryDirectory() as folder:
        readme, room, made = (pathlib.Path(folder) / name for name in ("readme", "room", "pictures"))
        for one in (readme, room, made):
            one.mkdir()

        def show_readme():
            wrong = run_examples(program, readme, write)
            make_pictures.pictures_of_result(readme / "result", made)
            make_pictures.pictures_by_hand(program, readme, made)
            return wrong

        with ThreadPoolExecutor() as pool:
            of_readme = pool.submit(show_readme)
            others = [pool.submit(make_pictures.pictures_of_room, program, room, made),
                      pool.submit(make_pictures.pictures_of_python, program.parents[1] / "python", program, made)]
            wrong = of_readme.result()
            for one in others:
                one.result()
        if write:
            for picture in made.iterdir():
                (PICTURES / picture.name).write_bytes(picture.read_bytes())
        wrong += compare_pictures(made)
    if wrong:
        sys.exit("\n".join(wrong) + ("" if write else "\ndocs/make.py PROGRAM --write mends what it makes."))


if __name__ == "__main__":
    main(*sys.argv[1:])
