#!/usr/bin/env python3
"""Registers head phantoms with coarse voxels and pixels, and writes by how much the rotations found are off:
docs/evaluation.md, "Coarse data".

    bench/coarse.py ISOSHIFT > bench/results/coarse.csv
"""
import csv
import json
import math
import pathlib
import subprocess
import sys
import tempfile

# Edge of the CT's pixels (its slices are 1.5 times as thick), pixels along an edge of an X-ray of 410 mm.
SIZES = (("1", "512"), ("1", "256"), ("2", "256"), ("2", "128"), ("4", "256"), ("4", "128"))
SEEDS = range(1, 5)


def rotation_vector_deg(found, true):
    """Of found * true^-1: matrices to degrees about x, y, z."""
    error = [[sum(found[i][k] * true[j][k] for k in range(3)) for j in range(3)] for i in range(3)]
    angle = math.acos(max(-1.0, min(1.0, (error[0][0] + error[1][1] + error[2][2] - 1.0) / 2.0)))
    scale = angle / (2.0 * math.sin(angle)) if angle > 1e-9 else 0.5
    return [math.degrees(scale * (error[i][j] - error[j][i])) for i, j in ((2, 1), (0, 2), (1, 0))]


def main():
    isoshift = sys.argv[1]
    rows = csv.writer(sys.stdout, lineterminator="\n")
    rows.writerow(["voxel_mm", "pixels", "seed", "verdict"] + [f"{what}_{axis}_deg" for what in ("error", "sigma") for axis in "xyz"])
    with tempfile.TemporaryDirectory() as folder:
        for voxel_mm, pixels in SIZES:
            for seed in SEEDS:
                study, result = (pathlib.Path(folder) / f"{name}-{voxel_mm}-{pixels}-{seed}" for name in ("study", "result"))
                subprocess.run([isoshift, "phantom", "-o", study, "--voxel-mm", voxel_mm, "--image-pixels", pixels, "--seed",
                                str(seed)], stdout=subprocess.DEVNULL, check=True)
                subprocess.run([isoshift, "register", study, "-o", result], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
                               check=False)
                found, true = (json.loads((path / name).read_text()) for path, name in ((result, "result.json"), (study, "truth.json")))
                errors = rotation_vector_deg(found["setup_error"]["rotation_matrix"], true["setup_error_room"]["rotation_matrix"])
                rows.writerow([voxel_mm, pixels, seed, found["verdict"]] +
                              [f"{value:.3f}" for value in errors + found["uncertainty"]["rotation_deg"]])
                sys.stdout.flush()


if __name__ == "__main__":
    main()
