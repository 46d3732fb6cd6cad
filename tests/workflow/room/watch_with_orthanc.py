"""A treatment room: studies come to an Orthanc server in any order, isoshift room watch registers them, a person releases results, and
another Orthanc server receives them by C-STORE with TLS.

  watch_with_orthanc.py ISOSHIFT WORK [PATIENTS]

WORK is an empty folder. Prints what went wrong and exits with 1, or a line with figures and 0.
"""

import json
import os
import pathlib
import random
import signal
import subprocess
import sys
import threading
import time
import urllib.error

import pydicom

sys.path.insert(0, str(pathlib.Path(__file__).parents[2] / "support"))
from orthanc_server import Orthanc, fetch
from room import expect, wait_for

VIEWS, QUIET_S = 2, 2
# Orthanc calls this for every C-STORE. Of three stores of one object its list of changes has one.
COUNT_STORES = "function ReceivedInstanceFilter(dicom, origin, info) print('STORED ' .. dicom.SOPInstanceUID) return true end\n"


def make_certificate(folder):
    subprocess.run(["openssl", "req", "-x509", "-newkey", "rsa:3072", "-nodes", "-days", "2", "-subj", "/CN=isoshift test", "-addext", "subjectAltName=IP:127.0.0.1",
                    "-keyout", folder / "key.pem",
                    "-out", folder / "certificate.pem"], check=True, capture_output=True)
    return {"ca": str(folder / "certificate.pem"), "certificate": str(folder / "certificate.pem"), "key": str(folder / "key.pem")}


class Room:
    def __init__(self, program, work, patients):
        self.program, self.work, self.patients = program, work, patients
        self.results = work / "results"
        self.source = Orthanc(work / "source")
        tls = make_certificate(work)
        (work / "count.lua").write_text(COUNT_STORES)
        self.peer = Orthanc(work / "peer", "RECORD", DicomTlsEnabled=True, DicomTlsCertificate=tls["certificate"], DicomTlsPrivateKey=tls["key"],
                            DicomTlsTrustedCertificates=tls["ca"], LuaScripts=[str(work / "count.lua")])
        (work / "site.json").write_text(json.dumps({"site_file": 1, "name": "test", "sessions": {"views": VIEWS, "quiet_s": QUIET_S}}))
        (work / "watch.json").write_text(json.dumps({
            "watch_file": 1, "orthanc": {"url": self.source.url}, "results": "results", "site": "site.json", "register": ["--preset=fast", "--write-reg-for-review"],
            "peers": [{"name": "record", "host": "127.0.0.1", "port": self.peer.dicom, "called_aet": "RECORD", "calling_aet": "ISOSHIFT", "tls": tls}]}))
        self.log = (work / "watch.log").open("a")
        self.watch = None

    def start_watch(self):
        self.watch = subprocess.Popen([self.program, "room", "watch", self.work / "watch.json"], stderr=self.log)

    def kill_watch(self):
        self.watch.send_signal(signal.SIGKILL)
        self.watch.wait()

    def sessions(self):
        folder = self.results / "sessions"
        return sorted(f.parent.name for f in folder.glob("*/result.json") if "." not in f.parent.name) if folder.exists() else []

    def result(self, session):
        return json.loads((self.results / "sessions" / session / "result.json").read_text())

    def at_peer(self):
        """The SOPInstanceUIDs of all C-STOREs that the peer has received."""
        return [line.split("STORED ")[1] for line in self.peer.log.read_text().splitlines() if "STORED " in line] if self.peer.log.exists() else []

    def release(self, session):
        return subprocess.run([self.program, "room", "release", session, "--by", "J. Doe", "--watch", self.work / "watch.json"], capture_output=True, text=True)


def studies(room):
    made = {}
    for n in range(room.patients):
        folder = room.work / "studies" / str(n)
        anatomy = "thorax" if n % 2 else "head"
        subprocess.run([room.program, "phantom", "-o", folder, "--anatomy", anatomy, "--seed", str(n + 1), "--voxel-mm", "4", "--image-pixels", "96", "--photons", "0"],
                       check=True, capture_output=True)
        made[f"PHANTOM{n + 1}"] = sorted(folder.rglob("*.dcm"))
    return made


def send_shuffled(room, made):
    """Several senders, some objects twice; the server is restarted in between."""
    everything = [file for files in made.values() for file in files]
    again = random.sample(everything, len(everything) // 10)
    queue = everything + again
    random.shuffle(queue)
    half = len(queue) // 2

    def send(files):
        senders = [threading.Thread(target=room.source.send, args=(files[n::3],)) for n in range(3)]
        for sender in senders:
            sender.start()
        for sender in senders:
            sender.join()

    send(queue[:half])
    truncated = made["PHANTOM1"][-1].read_bytes()
    try:
        fetch(room.source.url + "/instances", truncated[:len(truncated) // 3])
    except urllib.error.HTTPError:
        pass  # refused by the server already
    room.source.stop()
    time.sleep(QUIET_S + 1)
    room.source.start()
    send(queue[half:])
    return len(everything)


def forget_and_come_again(room, files):
    """A patient's objects grow old; then the X-rays of the next fraction come."""
    room.kill_watch()
    objects = room.results / "objects"
    for file in objects.glob("*.dcm"):
        os.utime(file, (0, 0))
    room.start_watch()
    wait_for(lambda: not list(objects.glob("*.dcm")), 30, "old objects to be removed")
    before = len(room.sessions())
    for number, file in enumerate(file for file in files if file.parent.name == "RTIMAGE"):
        image = pydicom.dcmread(file)
        image.SOPInstanceUID = image.file_meta.MediaStorageSOPInstanceUID = f"{image.SOPInstanceUID[:50]}.{number + 1}"
        image.AcquisitionDate, image.ContentDate = "20260302", "20260302"
        image.save_as(room.work / f"next{number}.dcm")
    room.source.send(sorted(room.work.glob("next*.dcm")))
    wait_for(lambda: len(room.sessions()) == before + 1, 60, "the session of the next day")


def main(program, work, patients):
    random.seed(7)
    room = Room(program, work, patients)
    try:
        made = studies(room)
        room.source.start()
        room.start_watch()
        begin = time.time()
        count = send_shuffled(room, made)
        wait_for(lambda: len(room.sessions()) == patients, 60 + 20 * patients, "all sessions")
        seconds = time.time() - begin

        # Every patient's own, once.
        found = {room.result(session)["patient"]["id"]: session for session in room.sessions()}
        expect(sorted(found) == sorted(made), f"sessions of {sorted(found)}")
        owner = {str(pydicom.dcmread(file, stop_before_pixels=True).SOPInstanceUID): patient for patient, files in made.items() for file in files}
        for patient, session in found.items():
            views = {view["sop_instance_uid"] for view in room.result(session)["views"]}
            expect(len(views) == VIEWS and {owner[uid] for uid in views} == {patient}, f"{patient}: views of {[owner[uid] for uid in views]}")
            expect(room.result(session)["verdict"] != "rejected", f"{patient}: {room.result(session)['reasons']}")

        # Nothing leaves before a person releases it, and then once, though the peer is down and the watch is killed.
        time.sleep(2)
        session = found["PHANTOM1"]
        expect(not list((room.results / "sent").iterdir()), "something was sent")
        released = room.release(session)
        expect(released.returncode == 0, f"release: {released.stderr}")
        time.sleep(3)
        room.kill_watch()
        room.start_watch()
        room.peer.start()
        expected = len(list((room.results / "sessions" / session).glob("*.dcm")))
        wait_for(lambda: len(room.at_peer()) >= expected, 60, "the peer's objects")
        time.sleep(5)
        expect(len(room.at_peer()) == expected, f"the peer received {len(room.at_peer())} objects, expected {expected}")

        audit = (room.results / "audit.jsonl").read_text()
        events = [json.loads(line)["event"] for line in audit.splitlines()]
        expect(events.count("registered") == patients and events.count("sent") == expected, f"audit: {events}")
        expect("PHANTOM" not in audit and "Phantom" not in audit and "2.25." not in audit, "the audit log names a patient or a UID")

        # Killed between the peer's answer and its mark: the peer is asked, and gets nothing again.
        room.kill_watch()
        for mark in (room.results / "sent").iterdir():
            mark.rename(mark.parent / f".{mark.name}")
        room.peer.stop()
        room.peer.settings["DicomAlwaysAllowFind"] = True
        room.peer.start()
        room.start_watch()
        wait_for(lambda: (room.results / "audit.jsonl").read_text().count("was there, from an earlier attempt") == expected, 60, "the peer to be asked")
        expect(len(room.at_peer()) == expected, "the peer received an object again")

        # What was forgotten is fetched again when more of the patient comes.
        forget_and_come_again(room, made["PHANTOM2"])
        room.watch.send_signal(signal.SIGTERM)
        expect(room.watch.wait(30) == 0, f"watch ended with {room.watch.returncode}")
        print(f"{count} objects, {patients} sessions in {seconds:.0f} s")
    finally:
        if room.watch and room.watch.poll() is None:
            room.watch.kill()
        room.source.stop()
        room.peer.stop()


if __name__ == "__main__":
    main(sys.argv[1], pathlib.Path(sys.argv[2]), int(sys.argv[3]) if len(sys.argv) > 3 else 2)
