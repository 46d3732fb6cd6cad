"""The tables of docs/founding-paper.md."""

import math
import statistics

from evaluation import evaluations
from markdown import RESULTS, json_of, rows_of, table, words

PAPER = {  # of its Table 1, ms: the spine at thresholds 20 and 70 of 255, the pig at 10 and 60
    "wobbled splatting, basic": (58.1, 15.0, 68.9, 46.1),
    "wobbled splatting, noise texture": (57.0, 15.3, 68.0, 45.0),
    "wobbled splatting, vertex buffer objects": (29.5, 8.4, 34.5, 23.0),
    "ray casting, basic": (14.1, 13.0, 22.2, 21.8),
    "ray casting, cuberille 64 voxels": (20.9, 17.9, 24.7, 24.2),
    "ray casting, cuberille 8 voxels": (17.9, 10.0, 38.3, 20.5),
    "ray casting, sparse 50 %": (12.0, 11.0, 15.3, 15.3),
    "ray casting, sparse 25 %": (9.8, 9.0, 13.4, 13.3),
    "ray casting, cuberille 8 + sparse 25 %": (11.9, 7.3, 22.1, 12.8),
}
PAPER_THRESHOLDS = {"spine; here a phantom": (20, 70), "pig; here a plastic head": (10, 60)}
WINDOW_BEGINS_HU, STEP_HU = -540, 8
SUCCESS_MM = 2.0


def table1_of(file):
    """The cells of `isoshift bench drr`: a volume at a threshold each."""
    return json_of(file)["tables"]


def thresholds():
    cells = iter(table1_of("table1-h200.json"))

    def of_threshold(step):
        cell, hu = next(cells), WINDOW_BEGINS_HU + STEP_HU * step
        assert cell["threshold_hu"] == hu
        return [step, f"{hu:+}", f"{100 * cell['share_above']:.1f} %"]

    return table(["", *["8 bit", "HU", "voxels above, here"] * 2],
                 [[volume, *(cell for step in steps for cell in of_threshold(step))] for volume, steps in PAPER_THRESHOLDS.items()])


def milliseconds(time):
    decimals = 0 if time["mean"] >= 20 else 1 if time["mean"] >= 2 else 2
    return f"{time['mean']:.{decimals}f} +/- {time['sd']:.{decimals}f}"


def by_method(tables):
    """The rows of every method that was measured in all cells."""
    for first in tables[0]["rows"]:
        of_method = [row for cell in tables for row in cell["rows"] if row["method"] == first["method"]]
        if len(of_method) == len(tables):
            yield of_method


def times(file):
    tables = table1_of(file)
    header = ["method"]
    for cell in tables:
        header += [f"{cell['volume']} {cell['threshold_hu']:+.0f} HU ({100 * cell['share_above']:.1f} % above)", "paper"]

    def cells(of_method):
        method = of_method[0]["method"]
        paper = PAPER.get(method, ("-",) * len(tables))
        return [method] + [cell for row, then in zip(of_method, paper) for cell in (milliseconds(row["wall_ms"]), then)]

    return table(header, map(cells, by_method(tables)))


def errors(file):
    """The rms difference from `trilinear`."""
    tables = table1_of(file)
    return table(["error, poses timed"] + [f"{cell['volume']} {cell['threshold_hu']:+.0f} HU" for cell in tables],
                 [[f"{of_method[0]['method']}, {of_method[0]['poses']} poses"]
                  + [f"{100 * row['rms_error']:.2g} %" for row in of_method] for of_method in by_method(tables)])


def start_in_words(configuration):
    series, turned = configuration["series"], configuration["max_rotation_deg"] > 0
    return {("paper", False): "25 mm without rotation", ("mtre", True): "mTRE 25 mm",
            ("bins", True): "mTRE up to 25 mm"}[series, turned]


def optimizer(configuration):
    searches = configuration["searches"]
    return configuration["optimizer"] + (f", {searches} searches" if searches > 1 else "")


def mean_and_sd(values, decimals):
    sd = statistics.stdev(values) if len(values) > 1 else 0.0
    return f"{statistics.fmean(values):.{decimals}f} +/- {sd:.{decimals}f}"


def cells_of_configuration(folder):
    configuration, runs = json_of(folder / "evaluation.json"), rows_of(folder / "runs.csv")
    judged_by = "mrpd_mm" if configuration["success_by"] == "mRPD" else "mtre_mm"
    failures = sum(not float(run[judged_by]) < SUCCESS_MM for run in runs)
    runs_with_pose = [run for run in runs if math.isfinite(float(run["mtre_mm"]))]

    def column(name):
        return [float(run[name]) for run in runs_with_pose]

    rendering = column("seconds_rendering")
    search = [a + b for a, b in zip(rendering, column("seconds_similarity"))]
    return [folder.name, start_in_words(configuration), len(configuration["images"]), configuration["renderer"],
            configuration["similarity"], optimizer(configuration), len(runs), failures,
            *(mean_and_sd(column(name), 2) for name in ("mtre_mm", "mpd_mm", "mrpd_mm")), mean_and_sd(search, 2),
            mean_and_sd(column("evaluations"), 0), f"{100 * sum(rendering) / sum(search):.1f} %"]


# Table 2 lists its configurations in this order.
CONFIGURATIONS = [
    "cpu-mi", "cpu-src", "cpu-mi-mtre", "cpu-src-mtre", "cpu-mi-up-to", "cpu-src-up-to", "cpu-mi-one-view", "cpu-src-one-view",
    "cpu-mi-restarts", "cpu-mi-bobyqa", "cpu-mi-newuoa", "cpu-mi-sbplx", "cpu-src-restarts", "cpu-src-bobyqa", "cpu-src-newuoa",
    "cpu-src-sbplx", "cpu-src-levenberg-marquardt", "raycast-mi", "raycast-src", "raycast-mi-one-view", "cuberille-mi",
    "cuberille-mi-one-view", "splat-mi", "splat-mi-one-view"]


def table2(machine):
    folders = [path.parent for path in (RESULTS / "table2" / machine).glob("*/runs.csv")]
    folders.sort(key=lambda folder: CONFIGURATIONS.index(folder.name))
    return table(["configuration", "start", "views", "renderer", "similarity", "optimizer", "starts", "failures", "mTRE mm",
                  "mPD mm", "mRPD mm", "time s", "iterations", "rendering"], map(cells_of_configuration, folders))


def earlier_evaluations():
    """Their starts were also turned; the errors are those of the successes."""
    def cells(case, summary):
        mtre, iteration = summary["mtre_mm"], summary["rendering_share"] + summary["similarity_share"]
        return [case, f"{summary['successes']}/{summary['runs']}",
                f"{mtre['mean']:.2f} +/- {mtre['sd']:.2f}" if summary["successes"] else "-", f"{summary['mean_evaluations']:.0f}",
                f"{100 * summary['rotation_share_of_failures']:.0f} %", f"{100 * summary['rendering_share'] / iteration:.1f} %"]

    return table(["case", "success", "mTRE mean +/- SD mm", "evaluations", "rotation in failures", "rendering of an iteration"],
                 [cells(*case) for case in evaluations("paper").items()])


TABLES = [("What holds, what does not, what is open", words("| finding of the paper | here | evidence |")),
          ("Its thresholds", thresholds),
          ("On two cores", lambda: times("table1-2-cores-2.4GHz-llvmpipe.json")),
          ("On two cores", lambda: errors("table1-2-cores-2.4GHz-llvmpipe.json")),
          ("On two cores", lambda: times("table1-2-cores-2.1GHz-cpu.json")),
          ("On two cores", lambda: errors("table1-2-cores-2.1GHz-cpu.json")),
          ("On a GPU of today", lambda: times("table1-h200.json")),
          ("On a GPU of today", lambda: errors("table1-h200.json")),
          ("On a GPU and the 16 cores beside it", lambda: table2("h200")),
          ("On two cores", lambda: table2("2-cores-2.4GHz")),
          ("On two cores", lambda: table2("2-cores-2.6GHz")),
          ("On two cores", lambda: table2("2-cores-2.6GHz-whole-image")),
          ("On two cores", lambda: table2("2-cores-2.6GHz-llvmpipe")),
          ("Earlier, turned by up to 5 degrees", earlier_evaluations)]
