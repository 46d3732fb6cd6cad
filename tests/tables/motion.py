"""The tables of docs/motion.md."""

import re
import statistics

from markdown import ROOT, json_of, rows_of, table

NAMES = {"hold-last": "hold-last", "kalman": "kalman", "rls": "rls", "model": "model, from the first breaths"}


def defaults():
    """The numbers that the members of the predictors' and the score's options begin with, by name, as written there."""
    text = "".join((ROOT / "registration/motion" / name).read_text() for name in ("predictor.h", "score.h"))
    return {name: number.removesuffix(".0") for name, number in re.findall(r"(?:double|int) (\w+) = ([0-9.]+);", text)}


def predictors():
    rows = [["`hold-last`", "the last position", ""],
            ["`kalman`", "constant velocity, white acceleration",
             "{acceleration_noise} mm²/s³, against a measurement noise of {measurement_sigma_mm} mm"],
            ["`rls` (default)",
             "the position one latency ahead is a weighted sum of the last {taps} positions, {tap_s} s apart, of all axes; the "
             "weights by recursive least squares",
             "forgetting {forgetting} per measurement, regularization {regularization}"],
            ["`model`",
             "the founding paper's: a periodic trajectory, from 4D CT phases (`--phases`) or from the first {learning_s} s, "
             "predicts; an extended Kalman filter corrects phase, speed, depth and place",
             "noise per square root of a second: {phase_noise} rad, {speed_noise} rad/s, {depth_noise} of the depth, "
             "{offset_noise} mm"]]
    return table(["`--predictor`", "how", "constants"], [[cell.format(**defaults()) for cell in row] for row in rows])


def recorded():
    """Mean RMSE over the traces; of all but hold-last as a share of hold-last's."""
    traces = json_of("predict-recorded.json")
    latencies = ["100", "200", "300", "400", "500", "600"]

    def rmse_mm(method, latency):
        return statistics.fmean(trace[method][latency]["rmse_mm"] for trace in traces.values())

    def cells(method, name):
        if method == "hold-last":
            return ["hold-last, mm"] + [f"{rmse_mm(method, latency):.2f}" for latency in latencies]
        return [name] + [f"{rmse_mm(method, latency) / rmse_mm('hold-last', latency):.2f}" for latency in latencies]

    return table(["", *(f"{latency} ms" for latency in latencies)], [cells(*method) for method in NAMES.items()])


def breathing_phantom():
    return table(["", "median", "RMSE", "95th percentile"],
                 [[row["what"], f"{row['median_mm']} mm", row["rmse_mm"], row["p95_mm"]]
                  for row in rows_of("breathing-phantom.csv")])


TABLES = [("Predictors", predictors),
          ("On recorded breathing", recorded),
          ("On a breathing phantom", breathing_phantom)]
