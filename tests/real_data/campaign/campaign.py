#!/usr/bin/env python3
"""The campaign: makes its cases, registers them, and counts by stratum. README.md beside it says how.

campaign.py make --tool make_cases --ct-root DATA -o CASES --seeds 1000-1019
campaign.py run CASES --isoshift isoshift --ct-root DATA -o RESULTS [--jobs 2] [-- FLAG...]
campaign.py table CASES RESULTS
campaign.py read CASES_FOUND.csv
"""

import argparse
import csv
import json
import math
import pathlib
import subprocess
import sys

# Of tuning, of breathing in steps of 1 mm, of patients who lie a vertebra off, and of three reports.
KINDS = [range(first, first + 1000) for first in (1000, 2000, 3000, 5000, 6000, 7000)]
BOX_EDGE_MM = 15.0  # about the target's center
STRATA = ["undisturbed", "bent", "breathing", "tissue", "small-field", "low-dose", "metal", "kv-mv", "view-angle"]


def seeds_of(text):
    """Seeds of "1000-1019,1050": all of one kind."""
    seeds = []
    for part in text.split(","):
        first, _, last = part.partition("-")
        seeds += range(int(first), int(last or first) + 1)
    if not any(all(seed in kind for seed in seeds) for kind in KINDS):
        raise argparse.ArgumentTypeError(f"{text}: seeds are 1000 to 1999 (tuning), 2000 to 2999 (breathing), 3000 to "
                                         "3999 (a vertebra off), or 5000 to 5999, 6000 to 6999 or 7000 to 7999 "
                                         "(reports), of one kind in a call")
    return seeds


def make(options):
    missing = [seed for seed in options.seeds if not (options.output / str(seed) / "truth.json").exists()]
    options.output.mkdir(parents=True, exist_ok=True)
    shares = [missing[n::options.jobs] for n in range(options.jobs)]
    running = [
        subprocess.Popen([options.tool, options.ct_root, options.output] + [str(seed) for seed in share])
        for share in shares if share
    ]
    return max([process.wait() for process in running], default=0)


def truths(cases):
    """Truth by the name of the case, in the order of the seeds."""
    found = {path.parent.name: json.loads(path.read_text()) for path in cases.glob("*/truth.json")}
    return dict(sorted(found.items(), key=lambda item: item[1]["seed"]))


def run(options):
    options.output.mkdir(parents=True, exist_ok=True)
    manifest = options.output / "cases.csv"
    with manifest.open("w", newline="") as file:
        rows = csv.writer(file)
        rows.writerow(["case", "ct", "images", "plan", "structures"])
        for name, truth in truths(options.cases).items():
            folder = (options.cases / name).resolve()
            images = sorted(str(path) for path in (folder / "RTIMAGE").glob("*.dcm"))
            rows.writerow([name, str((options.ct_root / truth["anatomy"] / "CT").resolve()), ";".join(images),
                           folder / "RTPLAN.dcm", folder / "RTSTRUCT.dcm"])
    command = [options.isoshift, "batch", manifest, "-o", options.output / "batch", "--jobs", str(options.jobs)]
    status = subprocess.run(command + options.flags, check=False).returncode
    if status in (1, 2):
        print("isoshift batch did not end well; the table counts what there is", file=sys.stderr)
    return table(options) or (1 if status == 2 else 0)


def motion_of(error):
    """R and t of truth.json or result.json: planned x is found at R x + t. None where a part was not determined."""
    if error is None or any(value is None for value in error["translation_mm"]):
        return None
    return error["rotation_matrix"], error["translation_mm"]


def distance_mm(a, b, x):
    """How far the two motions take a point apart.

    >>> turned = [[0, -1, 0], [1, 0, 0], [0, 0, 1]], [0, 0, 3]
    >>> distance_mm(([[1, 0, 0], [0, 1, 0], [0, 0, 1]], [0, 0, 0]), turned, (2, 2, 0))
    5.0
    """
    found = [[sum(m[0][row][k] * x[k] for k in range(3)) + m[1][row] for row in range(3)] for m in (a, b)]
    return math.dist(*found)


def target_error_mm(truth, result):
    """Error at the target's center, and the largest at the corners of a box about it. The target is the isocenter's
    surroundings in every case, so that its center is the origin."""
    right, found = motion_of(truth["setup_error_room"]), motion_of(result.get("setup_error"))
    if found is None:
        return None
    half = 0.5 * BOX_EDGE_MM
    corners = [(x, y, z) for x in (-half, half) for y in (-half, half) for z in (-half, half)]
    return distance_mm(right, found, (0, 0, 0)), max(distance_mm(right, found, corner) for corner in corners)


def sigmas_off(truth, result):
    """How many sigmas the target's center lies off, per axis. None where the images do not determine that."""
    sigma, found = result["uncertainty"]["translation_mm"], motion_of(result.get("setup_error"))
    if found is None or sigma is None or not all(sigma):
        return None
    return [(there - here) / one
            for here, there, one in zip(truth["setup_error_room"]["translation_mm"], found[1], sigma)]


def row_of(name, truth, results):
    path = results / "batch" / "cases" / name / "result.json"
    row = {"case": name, "anatomy": truth["anatomy"], "stratum": truth["stratum"],
           "disturbances": "; ".join(truth.get("disturbances") or []), "verdict": "failed", "determined": False,
           "center_mm": None, "box_mm": None, "is_bodies": False, "sigmas_off": None, "reasons": ""}
    if not path.exists():
        return row
    result = json.loads(path.read_text())
    errors = target_error_mm(truth, result)
    row.update(verdict=result["verdict"], reasons="; ".join(result["reasons"]))
    # A rejected result answers nothing; a target of which a direction was not measured, or that no bone carries, is not
    # determined.
    row["determined"] = (result["verdict"] != "rejected" and errors is not None
                         and result["target"]["surrogate"] != "none")
    if errors is not None:
        row.update(center_mm=errors[0], box_mm=errors[1], is_bodies=bool(result.get("bodies")),
                   sigmas_off=sigmas_off(truth, result))
    return row


def tail(successes, trials, share, upper):
    """P(X >= successes), or P(X <= successes) if `upper`, of a binomial distribution."""
    if share <= 0.0 or share >= 1.0:
        return float((successes == 0 or share >= 1.0) if not upper else (successes == trials or share <= 0.0))
    terms = range(0, successes + 1) if upper else range(successes, trials + 1)
    return sum(math.exp(math.lgamma(trials + 1) - math.lgamma(k + 1) - math.lgamma(trials - k + 1) +
                        k * math.log(share) + (trials - k) * math.log1p(-share)) for k in terms)


def clopper_pearson(successes, trials, confidence=0.95):
    """The exact interval of a share: Clopper and Pearson, Biometrika 26 (1934).

    >>> ["%.4f" % bound for bound in clopper_pearson(0, 10) + clopper_pearson(7, 20) + clopper_pearson(95, 100)]
    ['0.0000', '0.3085', '0.1539', '0.5922', '0.8872', '0.9836']
    """
    if trials == 0:
        return 0.0, 1.0
    alpha = 0.5 * (1.0 - confidence)

    def solve(upper):
        low, high = 0.0, 1.0
        for _ in range(60):
            middle = 0.5 * (low + high)
            # The lower bound's tail grows with the share, the upper bound's falls.
            if (tail(successes, trials, middle, upper) < alpha) != upper:
                low = middle
            else:
                high = middle
        return 0.5 * (low + high)

    return (0.0 if successes == 0 else solve(False)), (1.0 if successes == trials else solve(True))


def share_text(successes, trials):
    if trials == 0:
        return "-"
    low, high = clopper_pearson(successes, trials)
    return f"{successes}/{trials} {100 * successes / trials:.0f} % ({100 * low:.0f}-{100 * high:.0f})"


def summary_line(name, rows):
    determined = [row for row in rows if row["determined"]]
    right = [row for row in determined if row["box_mm"] < 1.0]
    accepted = [row for row in rows if row["verdict"] == "accepted"]
    median = sorted(row["box_mm"] for row in determined)[len(determined) // 2] if determined else float("nan")
    return "| " + " | ".join([
        name, share_text(len(determined), len(rows)), share_text(len(right), len(determined)),
        share_text(sum(row["verdict"] == "accepted" for row in right), len(right)), f"{median:.2f}",
        share_text(sum(row["box_mm"] > 1.5 for row in accepted), len(accepted)),
        share_text(sum(row["box_mm"] > 2.0 for row in accepted), len(accepted))]) + " |"


def coverage_line(name, rows):
    """The shares of axes of the determined cases within one and two sigma: 68 % and 95 % if sigmas are right."""
    off = [abs(axis) for row in rows if row["determined"] and row["sigmas_off"] for axis in row["sigmas_off"]]
    within = [share_text(sum(z <= sigmas for z in off), len(off)) for sigmas in (1, 2)]
    return f"| {name} | {within[0]} | {within[1]} |"


def rows_from(path):
    """What table() wrote to cases_found.csv."""
    with path.open(newline="") as file:
        rows = list(csv.DictReader(file))
    for row in rows:
        row.update({name: row[name] == "True" for name in ("determined", "is_bodies")})
        row.update({name: float(row[name]) if row[name] else None for name in ("center_mm", "box_mm")})
        row["sigmas_off"] = json.loads(row["sigmas_off"]) if row["sigmas_off"] else None
    return rows


def table(options):
    rows = [row_of(name, truth, options.output) for name, truth in truths(options.cases).items()]
    if not rows:
        print(f"{options.cases}: no case", file=sys.stderr)
        return 1
    with (options.output / "cases_found.csv").open("w", newline="") as file:
        writer = csv.DictWriter(file, fieldnames=list(rows[0]))
        writer.writeheader()
        writer.writerows(rows)
    text = text_of(rows)
    (options.output / "table.md").write_text(text)
    print(text, end="")
    return 0


def read(options):
    print(text_of(rows_from(options.found)), end="")
    return 0


def text_of(rows):
    strata = [name for name in STRATA if any(row["stratum"] == name for row in rows)]
    lines = ["| stratum | determined | under 1 mm, of these | accepted, of those under 1 mm | median mm | "
             "accepted above 1.5 mm | accepted above 2 mm |", "| --- " * 7 + "|"]
    lines += [summary_line(name, [row for row in rows if row["stratum"] == name]) for name in strata]
    lines += [summary_line(name, [row for row in rows if row["anatomy"] == name]) for name in ("head", "chest")]
    lines.append(summary_line("all", rows))
    lines += ["", "| answer of | axes within one sigma | within two sigma |", "| --- | --- | --- |",
              coverage_line("bodies", [row for row in rows if row["is_bodies"]]),
              coverage_line("the whole", [row for row in rows if not row["is_bodies"]])]
    return "\n".join(lines) + "\n"


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    commands = parser.add_subparsers(required=True)
    folder = pathlib.Path
    command = commands.add_parser("make", help="make cases")
    command.add_argument("--tool", required=True, type=folder, help="the program make_cases")
    command.add_argument("--ct-root", required=True, type=folder, help="folder with head/CT and chest/CT")
    command.add_argument("-o", "--output", required=True, type=folder)
    command.add_argument("--seeds", required=True, type=seeds_of, help="such as 1000-1019")
    command.add_argument("--jobs", type=int, default=1)
    command.set_defaults(run=make)
    command = commands.add_parser("run", help="register cases, then print the table")
    command.add_argument("cases", type=folder)
    command.add_argument("--isoshift", required=True, type=folder)
    command.add_argument("--ct-root", required=True, type=folder)
    command.add_argument("-o", "--output", required=True, type=folder)
    command.add_argument("--jobs", type=int, default=1)
    command.add_argument("flags", nargs="*", help="flags of isoshift batch, behind --")
    command.set_defaults(run=run)
    command = commands.add_parser("table", help="print the table of what was registered")
    command.add_argument("cases", type=folder)
    command.add_argument("output", type=folder, help="what `run` wrote")
    command.set_defaults(run=table)
    command = commands.add_parser("read", help="print the table of what was once found")
    command.add_argument("found", type=folder, help="a cases_found.csv")
    command.set_defaults(run=read)
    options = parser.parse_args()
    return options.run(options)


if __name__ == "__main__":
    sys.exit(main())
