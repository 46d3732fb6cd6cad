#!/usr/bin/python3
"""Renders the two views of head-oblique with every precision, and writes by how much the line integrals differ from those
of `trilinear`: docs/renderers.md, "Precision".

    bench/precision.py ISOSHIFT DATA > bench/results/precision-MACHINE.csv

rms_error is rms(difference) / rms(trilinear), over the pixels where trilinear is not 0; it has the same attenuation and
the precision f32.
"""
import csv
import math
import pathlib
import subprocess
import sys
import tempfile

import numpy

RENDERERS = ("cpu", "raycast", "raycast-box")
PRECISIONS = ("u8", "u16", "f32")


def line_integrals(path):
    """A MetaImage whose pixels lie in the same file, as floats."""
    header, pixels = path.read_bytes().split(b"ElementDataFile = LOCAL\n", 1)
    assert b"ElementType = MET_FLOAT" in header
    return numpy.frombuffer(pixels, "<f4").astype(float)


def main():
    isoshift, data = sys.argv[1], pathlib.Path(sys.argv[2]) / "head"
    rows = csv.writer(sys.stdout, lineterminator="\n")
    rows.writerow(["attenuation", "renderer", "precision", "view", "rms_error"])
    with tempfile.TemporaryDirectory() as folder:

        def rendered(attenuation, renderer, precision):
            flags = ["--gl", "software"] if renderer.startswith("raycast") else []
            flags += ["--precision", precision] if precision else []
            output = pathlib.Path(folder) / "drr"
            subprocess.run([isoshift, "drr", data / "head-oblique", "--ct", data / "CT", "-o", output, "--overwrite",
                            "--attenuation", attenuation, "--renderer", renderer, *flags], stdout=subprocess.DEVNULL, check=True)
            return [line_integrals(path) for path in sorted(output.glob("drr*.mha"))]

        for attenuation in ("physical", "windowed"):
            references = rendered(attenuation, "trilinear", None)
            for renderer in RENDERERS:
                for precision in PRECISIONS:
                    for view, (drr, reference) in enumerate(zip(rendered(attenuation, renderer, precision), references), 1):
                        hit = reference != 0
                        error = math.sqrt(((drr - reference)[hit] ** 2).mean() / (reference[hit] ** 2).mean())
                        rows.writerow([attenuation, renderer, precision, view, f"{error:.6g}"])
                        sys.stdout.flush()


if __name__ == "__main__":
    main()
