#!/usr/bin/python3
"""Changes the pixels of X-rays, registers them, and writes where each registration ended: docs/evaluation.md, "Changes of
intensity".

    bench/intensity.py ISOSHIFT DATA > bench/results/intensity.csv
"""
import csv
import json
import pathlib
import shutil
import subprocess
import sys
import tempfile

import numpy
import pydicom

STUDIES = ("head-kv-pair", "head-kv-mv")
PRESETS = {"paper": ["--preset", "paper", "--similarity", "src", "--pixel-fraction", "1"], "setup": ["--preset", "setup"]}
LARGEST = 65535  # that can be stored


def gamma(power):
    return lambda image, pixels: pixels.max() * (pixels / pixels.max()) ** power


def window(percent):
    """A display window that cuts off that share of the pixels at each end, stretched to all values."""
    def change(image, pixels):
        low, high = numpy.percentile(pixels, [percent, 100 - percent])
        return LARGEST * (pixels - low) / (high - low)
    return change


def inverted(image, pixels):
    image.PixelIntensityRelationshipSign = -image.PixelIntensityRelationshipSign
    return LARGEST - pixels


CHANGES = {"as it is": lambda image, pixels: pixels,
           **{f"gamma {power:g}": gamma(power) for power in (0.5, 0.7, 1.5, 2)},
           "inverted": inverted,
           **{f"window {percent:g} %": window(percent) for percent in (0, 0.1, 1, 2)}}


def change_images(study, change):
    for path in (study / "RTIMAGE").glob("*.dcm"):
        image = pydicom.dcmread(path)
        assert image.BitsStored == 16 and image.PixelRepresentation == 0
        pixels = change(image, image.pixel_array.astype(float))
        image.PixelData = numpy.clip(numpy.rint(pixels), 0, LARGEST).astype("<u2").tobytes()
        image.save_as(path)


def main():
    isoshift, data = sys.argv[1], pathlib.Path(sys.argv[2]) / "head"
    rows = csv.writer(sys.stdout, lineterminator="\n")
    rows.writerow(["study", "change", "preset", "verdict", "x_mm", "y_mm", "z_mm"])
    with tempfile.TemporaryDirectory() as folder:
        for study in STUDIES:
            for name, change in CHANGES.items():
                changed, output = pathlib.Path(folder) / "study", pathlib.Path(folder) / "result"
                shutil.copytree(data / study, changed, dirs_exist_ok=True)
                change_images(changed, change)
                for preset, flags in PRESETS.items():
                    shutil.rmtree(output, ignore_errors=True)
                    subprocess.run([isoshift, "register", changed, "--ct", data / "CT", "-o", output, "--renderer", "cpu", *flags],
                                   stdout=subprocess.DEVNULL, check=False)
                    result = json.loads((output / "result.json").read_text())
                    found = result["setup_error"]["translation_mm"]
                    rows.writerow([study, name, preset, result["verdict"], *(f"{value:.5f}" for value in found)])
                    sys.stdout.flush()
                shutil.rmtree(changed)


if __name__ == "__main__":
    main()
