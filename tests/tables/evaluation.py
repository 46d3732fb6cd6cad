"""The tables of docs/evaluation.md."""

import sys

from markdown import RESULTS, ROOT, json_of, rows_of, table

sys.path.append(str(ROOT / "tests/real_data/campaign"))
import campaign  # noqa: E402
import faults  # noqa: E402


def evaluations(part):
    """Summaries of `isoshift evaluate`, by case."""
    return json_of("evaluation.json")[part]


def share(of, runs):
    return f"{of}/{runs}"


def errors(summary):
    if summary["successes"] == 0:
        return ["-"] * 4
    mtre = summary["mtre_mm"]
    return [f"{mtre['mean']:.2f} +/- {mtre['sd']:.2f}", f"{mtre['median']:.2f}", f"{summary['mpd_mm']:.2f}",
            f"{summary['mrpd_mm']:.2f}"]


def capture(summary):
    """The capture range: a lower bound where all starts were captured, of which the farthest are in this bin."""
    farthest_mm = 20
    captured_mm = summary["capture_range_mm"]
    return f"at least {captured_mm}" if captured_mm == farthest_mm else captured_mm


def cells_of_case(case, summary):
    has_failures = summary["successes"] < summary["runs"]
    near, far = summary["within_1_mm"], summary["beyond_2_mm"]
    return [case, share(summary["successes"], summary["runs"]), *errors(summary), capture(summary),
            f"{100 * summary['rotation_share_of_failures']:.0f} %" if has_failures else "-",
            share(near["accepted"], near["runs"]), share(far["accepted"], far["runs"]), f"{summary['mean_evaluations']:.0f}"]


def cases(part):
    return table(["case", "success", "mTRE mean +/- SD mm", "median", "mPD", "mRPD", "capture mm", "rotation in failures",
                  "accepted of < 1 mm", "accepted of > 2 mm", "evaluations"],
                 [cells_of_case(*case) for case in evaluations(part).items()])


def uncertainty():
    """The share of axes, of all successes together. The shares of a summary are of its runs with a sigma, which are all
    of them here."""
    summaries = evaluations("setup").values()
    runs = sum(summary["runs"] for summary in summaries)

    def cells(number):
        axes = [sum(summary[f"share_within_{number}_sigma"][axis] * summary["runs"] for summary in summaries) / runs
                for axis in range(6)]
        return [f"within {number} sigma"] + [f"{100 * value:.0f} %" for value in axes + [sum(axes) / 6]]

    return table(["", "x", "y", "z", "about x", "about y", "about z", "all"], [cells("one"), cells("two")])


# The cases of each row of "Identity and handedness".
IDENTITY = {"their own X-rays": ["right"],
            "mirrored, turned, exchanged, gantry + 180 in one or both views":
                ["AP mirrored", "lateral mirrored", "AP turned", "angles exchanged", "gantry + 180 in view 1",
                 "gantry + 180 in view 2", "gantry + 180 in both"],
            "the lateral of another patient": ["lateral of another patient"],
            "another patient": ["another patient"]}


def identity():
    found = [case for path in (RESULTS / "identity").glob("ct-*.csv") for case in rows_of(f"identity/{path.name}")]

    def cells(words, of_cases):
        verdicts = [case["verdict"] for case in found if case["case"] in of_cases]
        accepted, *others = (verdicts.count(verdict) for verdict in ("accepted", "review", "rejected"))
        return [words, f"{accepted} of {len(verdicts)}", *(count or "-" for count in others)]

    return table(["", "accepted", "review", "rejected"], [cells(*of_row) for of_row in IDENTITY.items()])


def campaign_table(number):
    """The table of that number in what campaign.py prints."""
    text = campaign.text_of(campaign.rows_from(RESULTS / "campaign/report.csv"))
    return text.split("\n\n")[number].splitlines()


def targets():
    def cells(case, summary):
        target = summary["target"]
        return [case, summary["runs"], f"{target['median_mm']:.2f}", share(target["within_1_mm"], summary["runs"]),
                share(target["within_1_mm_accepted"], target["within_1_mm"]), target["beyond_2_mm_accepted"]]

    return table(["study, starts of 0 to 15 mm, nothing named", "starts", "median error of the target, mm", "under 1 mm",
                  "accepted, of those", "above 2 mm and accepted"], [cells(*case) for case in evaluations("targets").items()])


def faults_table():
    return faults.text_of(faults.rows_from(RESULTS / "campaign/faults.csv")).splitlines()


# The changes of each row of "Changes of intensity", as bench/intensity.py names them.
INTENSITY = {"gamma 0.5, 0.7, 1.5, 2; inverted with the sign declared":
                 ["gamma 0.5", "gamma 0.7", "gamma 1.5", "gamma 2", "inverted"],
             "a window as wide as the image": ["window 0 %"],
             "a window that cuts off 0.1 % at each end": ["window 0.1 %"],
             "a window that cuts off 1 or 2 % at each end": ["window 1 %", "window 2 %"]}


def intensity():
    found = rows_of("intensity.csv")
    as_is = {(run["study"], run["preset"]): run for run in found if run["change"] == "as it is"}

    def moved_mm(run):
        before = as_is[run["study"], run["preset"]]
        return max(abs(float(run[axis]) - float(before[axis])) for axis in ("x_mm", "y_mm", "z_mm"))

    def most(changes, preset):
        """Of the results that were not rejected; of the others their number."""
        runs = [run for run in found if run["change"] in changes and run["preset"] == preset]
        assert len(runs) == 2 * len(changes), (changes, preset)
        kept = [run for run in runs if run["verdict"] != "rejected"]
        rejected = f", {len(runs) - len(kept)} of {len(runs)} rejected" if len(kept) < len(runs) else ""
        return f"{max(map(moved_mm, kept)):.2f} mm{rejected}"

    def accepted(changes, preset):
        verdicts = [run["verdict"] for run in found if run["change"] in changes and run["preset"] == preset]
        return share(verdicts.count("accepted"), len(verdicts))

    return table(["change", "SRC", "setup", "accepted by setup"],
                 [[words, most(changes, "paper"), most(changes, "setup"), accepted(changes, "setup")]
                  for words, changes in INTENSITY.items()])


def coarse():
    rows = rows_of("coarse.csv")
    receptor_mm, magnification = 410, 1.5

    def span(of_size, column):
        values = sorted((float(row[column]) for row in of_size), key=abs)
        return f"{values[0]:.2f} to {values[-1]:.2f}"

    def cells(voxel_mm, pixels):
        of_size = [row for row in rows if (row["voxel_mm"], row["pixels"]) == (voxel_mm, pixels)]
        accepted = [row["verdict"] for row in of_size].count("accepted")
        return [f"{voxel_mm} mm ({1.5 * float(voxel_mm):.1f} mm)", f"{receptor_mm / magnification / int(pixels):.1f} mm",
                share(accepted, len(of_size)), span(of_size, "error_y_deg"), span(of_size, "sigma_y_deg")]

    sizes = dict.fromkeys((row["voxel_mm"], row["pixels"]) for row in rows)
    return table(["voxels (slices)", "pixels at the isocenter", "accepted", "error about y, degrees", "sigma about y, degrees"],
                 [cells(*size) for size in sizes])


TABLES = [("Baseline", lambda: cases("baseline")),
          ("Preset setup", lambda: cases("setup")),
          ("Uncertainty", uncertainty),
          ("Identity and handedness", identity),
          ("Bodies that bend", lambda: campaign_table(0)),
          ("Bodies that bend", lambda: campaign_table(1)),
          ("Bodies that bend", targets),
          ("Faults in files", faults_table),
          ("Changes of intensity", intensity),
          ("Coarse data", coarse),
          ("On a GPU", lambda: cases("gpu"))]
