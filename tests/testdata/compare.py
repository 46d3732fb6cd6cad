"""Compares the files of testdata/ with those that testdata/make.sh has made again: compare.py COMMITTED REMADE

Fails if a file is missing, extra, or differs. Most files must be equal byte for byte; only the release number that DCMTK writes
into the header of every file is ignored, since it differs between Debian 12 and 13. What `isoshift register` and `isoshift track`
write cannot be equal byte for byte:

- new UIDs are random, so that no two objects of the world share one: they are compared by where the same one occurs again;
- dates and times are those of the run;
- the commit, the processor's instruction set and the SHA-256 of inputs differ between builds, machines and Debian releases;
- the search ends at slightly different places on processors with different SIMD instructions: translations may differ by 0.2 mm,
  angles by 0.2 degrees. Where the verdict is "rejected" the search has found nothing: its pose may be any, and so may the
  reasons and the parts of views that follow from it. Numbers that describe the search and how many steps it took may differ at
  will; texts are compared without their numbers;
- drawn pages and pictures (PDF, HTML, SVG, PNG) depend on fonts and libraries: they must be there and not empty.
"""
import json
import pathlib
import re
import sys

import pydicom

# Not made by a program, or made by an earlier version of isoshift.
BY_HAND = re.compile(r"(.*/)?README\.md|make\.sh|[a-z_]+\.py|config/.*|results/(?!VERSION/).*")
DCMTK_RELEASE = re.compile(rb"(OFFIS_DCMTK_|1\.2\.276\.0\.7230010\.3\.0\.3\.)\d[.\d]*")
RUN_DEPENDENT = re.compile(r"(results/.*|registrations/.*/spatial_registration\.dcm|breathing/tracked\.csv|"
                           r"damaged/(result/.*|spatial-registration\.dcm))")
DRAWN = (".pdf", ".html", ".svg", ".png")
TOLERANCE = 0.2  # mm and degrees
IGNORED_KEYS = {"made_on", "commit", "program", "device", "sha256", "ct_sha256", "plan_sha256", "termination", "seconds", "picture",
                "best"}
KEYS_OF_NOTHING = {"reasons", "findings", "parts"}  # that follow from a pose at which nothing was found
POSE_KEYS = {"setup_error", "couch_shift", "couch_target_deg"}
IGNORED_KEYWORDS = {"EncapsulatedDocument", "EncapsulatedDocumentLength", "InstanceCreationDate", "InstanceCreationTime",
                    "ContentDate", "ContentTime", "TimezoneOffsetFromUTC", "SeriesDate", "SeriesTime", "SoftwareVersions"}
UID = re.compile(r"2\.25\.\d+")


class Uids:
    """UIDs of one folder against those of the other: each stands for exactly one, so that what refers to what is the same."""

    def __init__(self):
        self.pairs = {}

    def are_same(self, one, other):
        return self.pairs.setdefault(one, other) == other and list(self.pairs.values()).count(other) == 1


def without_numbers(text):
    text = re.sub(r"[0-9a-f]{64}|\d{4}-\d\d-\d\dT[\d:+-]+|\([0-9a-f]{12}[^)]*\)|AVX\d*|SSE\d*|NEON\S*", "#", UID.sub("#", text))
    return re.sub(r"[ +-]*\d+(\.\d+)?", "#", text)


def json_differences(one, other, uids, path="", is_pose=False, was_found=True):
    if type(one) is not type(other) and not (isinstance(one, (int, float)) and isinstance(other, (int, float))):
        yield f"{path}: {one!r} and {other!r}"
    elif isinstance(one, dict):
        if one.keys() != other.keys():
            yield f"{path}: other keys: {sorted(one.keys() ^ other.keys())}"
        for key in one.keys() & other.keys():
            if key not in (IGNORED_KEYS if was_found else IGNORED_KEYS | KEYS_OF_NOTHING):
                is_pose_there = is_pose or (was_found and key in POSE_KEYS)
                yield from json_differences(one[key], other[key], uids, f"{path}/{key}", is_pose_there, was_found)
    elif isinstance(one, list):
        if len(one) != len(other):
            yield f"{path}: {len(one)} and {len(other)} entries"
        for n, (a, b) in enumerate(zip(one, other)):
            yield from json_differences(a, b, uids, f"{path}[{n}]", is_pose, was_found)
    elif isinstance(one, str):
        if UID.fullmatch(one) and UID.fullmatch(other):
            if not uids.are_same(one, other):
                yield f"{path}: UIDs {one} and {other}"
        elif without_numbers(one) != without_numbers(other):
            yield f"{path}: {one!r} and {other!r}"
    elif is_pose and one is not None and abs(one - other) > TOLERANCE:
        yield f"{path}: {one} and {other}"


def dicom_differences(one, other, uids, path=""):
    keywords = lambda dataset: {element.keyword for element in dataset} - IGNORED_KEYWORDS
    if keywords(one) != keywords(other):
        yield f"{path}: other attributes: {sorted(keywords(one) ^ keywords(other))}"
    for keyword in sorted(keywords(one) & keywords(other)):
        a, b, where = one[keyword], other[keyword], f"{path}/{keyword}"
        if a.VR == "SQ":
            if len(a.value) != len(b.value):
                yield f"{where}: {len(a.value)} and {len(b.value)} items"
            for n, (item, other_item) in enumerate(zip(a.value, b.value)):
                yield from dicom_differences(item, other_item, uids, f"{where}[{n}]")
        elif a.VR == "UI":
            if not uids.are_same(str(a.value), str(b.value)):
                yield f"{where}: UIDs {a.value} and {b.value}"
        elif keyword == "FrameOfReferenceTransformationMatrix":
            # 0.2 degrees turn a point at 500 mm, as far as the CT is from its origin, by 2 mm.
            rotation = max(abs(float(x) - float(y)) for n, (x, y) in enumerate(zip(a.value, b.value)) if n % 4 != 3)
            translation = max(abs(float(x) - float(y)) for n, (x, y) in enumerate(zip(a.value, b.value)) if n % 4 == 3)
            if rotation > 0.004 or translation > 2.0:
                yield f"{where}: {a.value} and {b.value}"
        elif a.value != b.value:
            yield f"{where}: {a.value!r} and {b.value!r}"


def text_differences(one, other, was_found):
    # What the search did on its way, and on what, may differ.
    left_out = re.compile(r"\s+(Stage|Renderer|Time) " + ("" if was_found else r"|\s+- |\d{4}-\d\d-\d\dT"))
    lines = lambda text: [without_numbers(line) for line in text.splitlines() if not left_out.match(line)]
    for a, b in zip(lines(one), lines(other)):
        if a != b:
            yield f"{a!r} and {b!r}"
    if len(lines(one)) != len(lines(other)):
        yield f"{len(lines(one))} and {len(lines(other))} lines"


def run_differences(one, other, uids):
    if one.suffix in DRAWN:
        return [] if one.stat().st_size and other.stat().st_size else ["is empty"]
    if one.suffix == ".dcm":
        return list(dicom_differences(pydicom.dcmread(one), pydicom.dcmread(other), uids))
    result = one.parent / "result.json"
    was_found = not result.exists() or json.loads(result.read_text()).get("verdict") != "rejected"
    if one.suffix == ".json":
        return list(json_differences(json.loads(one.read_text()), json.loads(other.read_text()), uids, was_found=was_found))
    return list(text_differences(one.read_text(), other.read_text(), was_found))


def files_in(folder, by_hand):
    names = (str(path.relative_to(folder)) for path in folder.rglob("*") if path.is_file())
    return {name for name in names if not by_hand.fullmatch(name)}


def main():
    committed, remade = pathlib.Path(sys.argv[1]), pathlib.Path(sys.argv[2])
    versions = [path.name for path in (remade / "results").iterdir()]
    by_hand = re.compile(BY_HAND.pattern.replace("VERSION", re.escape(versions[0])))
    here, there = files_in(committed, by_hand), files_in(remade, by_hand)
    complaints = [f"{name}: is in testdata/, and make.sh does not make it" for name in sorted(here - there)]
    complaints += [f"{name}: make.sh makes it, and it is missing in testdata/" for name in sorted(there - here)]
    folders = {path for path in committed.iterdir() if path.is_dir()}
    complaints += [f"{path.name}: has no README.md" for path in sorted(folders) if not (path / "README.md").exists()]
    uids = {}  # by folder: the files of a result name each other
    for name in sorted(here & there):
        one, other = committed / name, remade / name
        if not RUN_DEPENDENT.fullmatch(name):
            if DCMTK_RELEASE.sub(b"", one.read_bytes()) != DCMTK_RELEASE.sub(b"", other.read_bytes()):
                complaints.append(f"{name}: differs")
            continue
        for difference in run_differences(one, other, uids.setdefault(one.parent, Uids())):
            complaints.append(f"{name}: {difference}")
    for complaint in complaints:
        print(complaint)
    print(f"{len(here & there)} files compared, {len(complaints)} complaints")
    return 1 if complaints else 0


sys.exit(main())
