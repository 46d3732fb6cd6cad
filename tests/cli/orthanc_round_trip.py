"""Sends a study and its result to an Orthanc server of its own, fetches everything back, and registers what came back.

  orthanc_round_trip.py ISOSHIFT STUDY RESULT WORK

STUDY and RESULT are folders of isoshift phantom and isoshift register; WORK is an empty folder. The server listens on free ports of
the loopback device. Prints what went wrong and exits with 1, or nothing and 0.
"""

import json
import pathlib
import subprocess
import sys

sys.path.insert(0, str(pathlib.Path(__file__).parents[1] / "support"))
from orthanc_server import Orthanc, fetch


def main(program, study, result, work):
    server = Orthanc(work / "orthanc")
    try:
        server.start()
        files = sorted(study.rglob("*.dcm")) + sorted(result.rglob("*.dcm"))
        server.send(files)
        instances = server.get("/instances")
        if len(instances) != len(files):
            sys.exit(f"{len(files)} objects were sent, Orthanc holds {len(instances)}")
        back = work / "back"
        back.mkdir()
        registration = None
        for instance in instances:
            path = back / f"{instance}.dcm"
            path.write_bytes(fetch(f"{server.url}/instances/{instance}/file"))
            if server.get(f"/instances/{instance}/simplified-tags")["Modality"] == "REG":
                registration = path
    finally:
        server.stop()

    again = subprocess.run([program, "register", str(back), "-o", str(work / "again"), "--write-reg-for-review"], capture_output=True, text=True)
    if again.returncode not in (0, 3):
        sys.exit(f"register: {again.returncode} {again.stderr}")
    before = json.loads((result / "result.json").read_text())["setup_error"]
    after = json.loads((work / "again" / "result.json").read_text())["setup_error"]
    if before != after:
        sys.exit(f"registered differently: {before} before, {after} after")
    checked = subprocess.run([program, "check", str(registration), str(result / "spatial_registration.dcm")], capture_output=True, text=True)
    if checked.returncode != 0:
        sys.exit(f"check: {checked.returncode} {checked.stdout}{checked.stderr}")


if __name__ == "__main__":
    main(sys.argv[1], *map(pathlib.Path, sys.argv[2:5]))
