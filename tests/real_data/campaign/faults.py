#!/usr/bin/env python3
"""Puts faults into files of studies, registers them, and counts how many are accepted, and of the others, how many name
what was wrong. README.md beside it says how.

faults.py run --isoshift isoshift --data DATA -o FOLDER [--jobs 2] [--only REGEX]
faults.py read FAULTS_FOUND.csv
"""

import argparse
import concurrent.futures
import csv
import json
import pathlib
import re
import shutil
import subprocess
import sys

import campaign

# The words of a reason that names a fault.
CONTRADICTION = r"the views contradict each other"
OTHER_GEOMETRY = r"with .* the images match (better|as well)"
OTHER_PATIENT = r"another patient's"
ONE_DIRECTION = r"all views look along nearly the same direction"


def datasets(study):
    """The X-rays of a study in the order of their gantry angles, with their files."""
    import pydicom  # here, since what was found is read where it is not installed

    found = [(pydicom.dcmread(path), path) for path in sorted((study / "RTIMAGE").glob("*.dcm"))]
    return sorted(found, key=lambda image: float(image[0].GantryAngle))


def change_image(n, change):
    """A fault: `change` of the n-th X-ray's dataset."""

    def fault(study, _):
        image, path = datasets(study)[n]
        change(image)
        image.save_as(path)

    return fault


def turn_gantry(degrees):
    def change(image):
        image.GantryAngle = f"{(float(image.GantryAngle) + degrees) % 360:g}"

    return change


def move_panel(image):
    x, y, z = (float(value) for value in image.XRayImageReceptorTranslation)
    image.XRayImageReceptorTranslation = [x, y + 5.0, z]


def turn_receptor(degrees):
    def change(image):
        image.XRayImageReceptorAngle = f"{(float(image.XRayImageReceptorAngle) + degrees) % 360:g}"

    return change


def lengthen_distance(image):
    farther_mm = 0.02 * float(image.RTImageSID)
    x, y, z = (float(value) for value in image.XRayImageReceptorTranslation)
    image.RTImageSID = f"{float(image.RTImageSID) + farther_mm:g}"
    image.XRayImageReceptorTranslation = [x, y, z - farther_mm]


def mirror(image):
    pixels = image.pixel_array
    image.PixelData = pixels[:, ::-1].tobytes()


def exchange(study, _):
    (first, first_path), (second, second_path) = datasets(study)[:2]
    first.GantryAngle, second.GantryAngle = second.GantryAngle, first.GantryAngle
    first.save_as(first_path)
    second.save_as(second_path)


def stretch_ct(study, _):
    """Slices 3 % farther apart, about the isocenter."""
    import pydicom

    center = json.loads((study / "truth.json").read_text())["isocenter_patient_mm"][2]
    for path in (study / "CT").glob("*"):
        slice_ = pydicom.dcmread(path)
        x, y, z = (float(value) for value in slice_.ImagePositionPatient)
        slice_.ImagePositionPatient = [x, y, f"{center + 1.03 * (z - center):.4f}"]
        slice_.save_as(path)


def take_images_of(other, which):
    """The X-rays `which` of another study of phantoms take the place of this one's, and call themselves this patient's."""

    def fault(study, studies):
        for n in which:
            right, path = datasets(study)[n]
            wrong, _ = datasets(studies / other)[n]
            right.PixelData = wrong.PixelData
            right.save_as(path)

    return fault


def faults_of(base):
    """Name, what its reason must say, and the fault."""
    found = [("gantry +2 in the first view", CONTRADICTION, change_image(0, turn_gantry(2))),
             ("gantry -2 in the second view", CONTRADICTION, change_image(1, turn_gantry(-2))),
             ("gantry -3 in the first view", CONTRADICTION, change_image(0, turn_gantry(-3))),
             ("panel 5 mm along y in the second view", CONTRADICTION, change_image(1, move_panel)),
             ("receptor 2 degrees in the second view", CONTRADICTION, change_image(1, turn_receptor(2))),
             ("receptor -3 degrees in the first view", CONTRADICTION, change_image(0, turn_receptor(-3))),
             ("distance 2 % in the first view", CONTRADICTION, change_image(0, lengthen_distance)),
             ("slices 3 % apart", CONTRADICTION, stretch_ct),
             ("first view mirrored", OTHER_GEOMETRY, change_image(0, mirror)),
             ("second view mirrored", OTHER_GEOMETRY, change_image(1, mirror)),
             ("gantry angles exchanged", OTHER_GEOMETRY, exchange),
             ("first view from the other side", OTHER_GEOMETRY, change_image(0, turn_gantry(180)))]
    if base.startswith("phantom"):
        found += [("turned 2 degrees between the views", CONTRADICTION, take_images_of(base + "-turned", [1])),
                  ("moved 4 mm between the views", CONTRADICTION, take_images_of(base + "-moved", [1])),
                  ("another patient", OTHER_PATIENT, take_images_of(base + "-other", [0, 1])),
                  ("one direction", ONE_DIRECTION, None)]
    return found


PHANTOMS = [("head", 9811), ("head", 9812), ("spine", 9821), ("spine", 9822), ("thorax", 9831), ("thorax", 9832)]
REAL = [("head", "head-kv-pair"), ("head", "head-oblique"), ("chest", "chest-still")]
POSE, TURNED, MOVED = ("3,-2,2", "1,-1,1"), ("3,-2,2", "1,-1,3"), ("3,2,2", "1,-1,1")


def make_bases(options):
    """The studies that faults are put into, by name: the CT lies in each."""
    studies = options.output / "studies"
    for anatomy, name in REAL:
        folder = studies / name
        if not (folder / "truth.json").exists():
            shutil.copytree(options.data / anatomy / name, folder, dirs_exist_ok=True, ignore=shutil.ignore_patterns("truth.json"))
            shutil.copytree(options.data / anatomy / "CT", folder / "CT", dirs_exist_ok=True)
            shutil.copy(options.data / anatomy / name / "truth.json", folder)
    for anatomy, seed in PHANTOMS:
        name = f"phantom-{anatomy}-{seed}"
        variants = [("", seed, POSE, "0,90"), ("-turned", seed, TURNED, "0,90"), ("-moved", seed, MOVED, "0,90"),
                    ("-other", seed + 100, POSE, "0,90"), ("-opposed", seed, POSE, "0,180")]
        for suffix, of, (translation, rotation), angles in variants:
            if not (studies / (name + suffix) / "truth.json").exists():
                subprocess.run([options.isoshift, "phantom", "-o", studies / (name + suffix), "--anatomy", anatomy, "--seed",
                                str(of), "--translation=" + translation, "--rotation=" + rotation, "--gantry-angles", angles,
                                "--overwrite"], check=True, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    return [name for _, name in REAL] + [f"phantom-{anatomy}-{seed}" for anatomy, seed in PHANTOMS]


def found_of(options, base, name, words, fault):
    studies = options.output / "studies"
    case = f"{base} {name}".replace(" ", "_").replace("%", "percent")
    study, results = options.output / "cases" / case, options.output / "results" / case
    if not (results / "result.json").exists():
        shutil.rmtree(study, ignore_errors=True)
        shutil.copytree(studies / (base if fault or not words else base + "-opposed"), study)
        if fault:
            fault(study, studies)
        ended = subprocess.run([options.isoshift, "register", study, "-o", results, "--overwrite"], capture_output=True, text=True,
                               check=False)
        if ended.returncode == 2 or not (results / "result.json").exists():
            shutil.rmtree(study)
            return {"base": base, "fault": name, "words": words, "verdict": "error", "box_mm": None,
                    "reasons": ended.stderr.strip().replace("\n", " ")}
    result = json.loads((results / "result.json").read_text())
    errors = campaign.target_error_mm(json.loads((studies / base / "truth.json").read_text()), result)
    shutil.rmtree(study, ignore_errors=True)
    return {"base": base, "fault": name, "words": words, "verdict": result["verdict"], "box_mm": errors and errors[1],
            "reasons": "; ".join(result["reasons"])}


def run(options):
    cases = [(base, *fault) for base in make_bases(options) for fault in [("no fault", "", None), *faults_of(base)]
             if re.search(options.only, f"{base} {fault[0]}")]
    with concurrent.futures.ThreadPoolExecutor(options.jobs) as pool:
        rows = []
        for row in pool.map(lambda case: found_of(options, *case), cases):
            print(f"{row['base']}, {row['fault']}: {row['verdict']}", file=sys.stderr, flush=True)
            rows.append(row)
    with (options.output / "faults_found.csv").open("w", newline="") as file:
        writer = csv.DictWriter(file, fieldnames=list(rows[0]))
        writer.writeheader()
        writer.writerows(rows)
    print(text_of(rows), end="")
    return 0


def names_its_fault(row):
    return re.search(row["words"], row["reasons"]) is not None


def line_of(name, rows):
    refused = [row for row in rows if row["verdict"] != "accepted"]
    accepted = [row for row in rows if row["verdict"] == "accepted"]
    largest = f"{max(float(row['box_mm']) for row in accepted):.2f}" if accepted else "-"
    return f"| {name} | {len(rows)} | {len(accepted)} | {largest} | " + campaign.share_text(
        sum(names_its_fault(row) for row in refused), len(refused)) + " |"


def text_of(rows):
    rows = [row for row in rows if row["words"]]
    lines = ["| fault | studies | accepted | largest error of these, mm | named, of the others |", "| --- " * 5 + "|"]
    for name in dict.fromkeys(row["fault"] for row in rows):
        lines.append(line_of(name, [row for row in rows if row["fault"] == name]))
    lines.append(line_of("all", rows))
    return "\n".join(lines) + "\n"


def rows_from(path):
    """What run() wrote to faults_found.csv."""
    with path.open(newline="") as file:
        return list(csv.DictReader(file))


def read(options):
    print(text_of(rows_from(options.found)), end="")
    return 0


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    commands = parser.add_subparsers(required=True)
    folder = pathlib.Path
    command = commands.add_parser("run", help="make the studies with faults, register them, print the table")
    command.add_argument("--isoshift", required=True, type=folder)
    command.add_argument("--data", required=True, type=folder, help="the folder of real data")
    command.add_argument("-o", "--output", required=True, type=folder)
    command.add_argument("--jobs", type=int, default=1)
    command.add_argument("--only", default="", help="only studies and faults whose names match")
    command.set_defaults(run=run)
    command = commands.add_parser("read", help="print the table of what was once found")
    command.add_argument("found", type=folder, help="a faults_found.csv")
    command.set_defaults(run=read)
    options = parser.parse_args()
    return options.run(options)


if __name__ == "__main__":
    sys.exit(main())
