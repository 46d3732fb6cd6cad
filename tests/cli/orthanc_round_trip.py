"""Sends a study and its result to an Orthanc server of its own, fetches everything back, and registers what came back.

  orthanc_round_trip.py ISOSHIFT STUDY RESULT WORK

STUDY and RESULT are folders of isoshift phantom and isoshift register; WORK is an empty folder. The server listens on free ports of
the loopback device. Prints what went wrong and exits with 1, or nothing and 0.
"""

import json
import pathlib
import socket
import subprocess
import sys
import time
import urllib.error
import urllib.request


def free_port():
    with socket.socket() as listener:
        listener.bind(("127.0.0.1", 0))
        return listener.getsockname()[1]


def fetch(url):
    with urllib.request.urlopen(url, timeout=60) as answer:
        return answer.read()


def wait_until_up(url, server):
    for _ in range(300):
        if server.poll() is not None:
            sys.exit(f"Orthanc ended with {server.returncode}: {server.stdout.read()}")
        try:
            return fetch(url)
        except urllib.error.URLError:
            time.sleep(0.1)
    sys.exit("Orthanc did not answer within 30 s")


def send(files, port):
    sent = subprocess.run(["storescu", "-aec", "ORTHANC", "127.0.0.1", str(port), *map(str, files)], capture_output=True, text=True)
    if sent.returncode != 0:
        sys.exit(f"storescu: {sent.stdout}{sent.stderr}")


def main(program, study, result, work):
    http, dicom = free_port(), free_port()
    configuration = {"HttpPort": http, "DicomPort": dicom, "RemoteAccessAllowed": False, "DicomAlwaysAllowStore": True,
                     "DicomCheckCalledAet": True, "StorageDirectory": str(work / "storage"), "IndexDirectory": str(work / "storage")}
    (work / "orthanc.json").write_text(json.dumps(configuration))
    server = subprocess.Popen(["/usr/sbin/Orthanc", str(work / "orthanc.json")], stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)
    try:
        url = f"http://127.0.0.1:{http}"
        wait_until_up(url + "/system", server)
        files = sorted(study.rglob("*.dcm")) + sorted(result.rglob("*.dcm"))
        send(files, dicom)
        instances = json.loads(fetch(url + "/instances"))
        if len(instances) != len(files):
            sys.exit(f"{len(files)} objects were sent, Orthanc holds {len(instances)}")
        back = work / "back"
        back.mkdir()
        registration = None
        for instance in instances:
            path = back / f"{instance}.dcm"
            path.write_bytes(fetch(f"{url}/instances/{instance}/file"))
            if json.loads(fetch(f"{url}/instances/{instance}/simplified-tags"))["Modality"] == "REG":
                registration = path
    finally:
        server.terminate()
        server.wait()

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
