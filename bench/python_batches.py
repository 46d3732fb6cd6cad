#!/usr/bin/env python3
"""DRRs in batches of poses, from Python and from C++ by turns: what does the Python module cost?

  PYTHONPATH=build/release/python bench/python_batches.py build/release/bench/study_batches STUDY OUTPUT.json
"""

import json
import statistics
import subprocess
import sys
import time

import numpy as np

import isoshift

BATCHES = (1, 4, 16, 64)
ROUNDS = 7
CALLS = 5  # of each round; their median counts

program, folder, output = sys.argv[1:]
study = isoshift.load_study(folder)
renderer = isoshift.Renderer(study.ct)


def poses_of(count):
    """Those of study_batches.cc."""
    poses = np.tile(np.eye(4), (count, 1, 1))
    poses[:, 0, 3] = 0.1 * np.arange(count)
    return poses @ study.planned_room_from_patient


def in_python():
    times = []
    renderer.render(study.views, poses_of(1))
    for count in BATCHES:
        poses = poses_of(count)
        seconds = []
        for _ in range(CALLS):
            begin = time.perf_counter()
            renderer.render(study.views, poses)
            seconds.append(time.perf_counter() - begin)
        times.append(statistics.median(seconds))
    return times


def in_cpp():
    counts = [str(count) for count in BATCHES for _ in range(CALLS)]
    lines = subprocess.run([program, folder, *counts], check=True, capture_output=True, text=True).stdout
    seconds = [float(line.split()[1]) for line in lines.splitlines()]
    return [statistics.median(seconds[n:n + CALLS]) for n in range(0, len(seconds), CALLS)]


rounds = [(in_cpp(), in_python()) for _ in range(ROUNDS)]
rows = []
for n, count in enumerate(BATCHES):
    ratios = [python[n] / cpp[n] for cpp, python in rounds]
    rows.append({"poses": count, "cpp_s": statistics.median(cpp[n] for cpp, _ in rounds),
                 "python_s": statistics.median(python[n] for _, python in rounds),
                 "ratio": statistics.median(ratios), "ratios": ratios})
    print(f"{count:3} poses: C++ {rows[-1]['cpp_s'] * 1e3:8.2f} ms, Python {rows[-1]['python_s'] * 1e3:8.2f} ms, "
          f"ratio {rows[-1]['ratio']:.3f}")
views = [{"columns": view.columns, "rows": view.rows} for view in study.views]
with open(output, "w", encoding="utf-8") as file:
    json.dump({"views": views, "rounds": ROUNDS, "calls": CALLS, "batches": rows}, file, indent=1)
    file.write("\n")
