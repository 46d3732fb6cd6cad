"""Results that were exchanged and releases that nobody gave: nothing of it leaves.

  watch_and_forgers.py ISOSHIFT WORK

WORK is an empty folder. Prints what went wrong and exits with 1, or ends with 0.
"""

import hashlib
import json
import os
import pathlib
import pwd
import shutil
import signal
import subprocess
import sys
import time

sys.path.insert(0, str(pathlib.Path(__file__).parents[2] / "support"))
from orthanc_server import free_port
from room import expect, wait_for

PATIENTS = 3


class Room:
    def __init__(self, program, work):
        self.program, self.work, self.results, self.log = program, work, work / "results", work / "watch.log"
        self.received = work / "received"
        self.received.mkdir()
        port = free_port()
        self.peer = subprocess.Popen(["storescp", "-aet", "RECORD", "-od", self.received, str(port)])
        (work / "in").mkdir()
        (work / "site.json").write_text(json.dumps({"site_file": 1, "name": "test", "sessions": {"views": 2, "quiet_s": 1}}))
        (work / "watch.json").write_text(json.dumps({
            "watch_file": 1, "folder": "in", "results": "results", "site": "site.json", "register": ["--preset=fast", "--write-reg-for-review"],
            "peers": [{"name": "record", "host": "127.0.0.1", "port": port, "called_aet": "RECORD", "calling_aet": "ISOSHIFT", "tls": False}]}))
        self.watch = None

    def start_watch(self):
        self.watch = subprocess.Popen([self.program, "room", "watch", self.work / "watch.json"], stderr=self.log.open("a"))

    def end_watch(self, how=signal.SIGKILL):
        self.watch.send_signal(how)
        self.watch.wait()

    def session(self, name):
        return self.results / "sessions" / name

    def by_patient(self):
        found = {}
        for file in sorted((self.results / "sessions").glob("*/result.json")):
            if "." not in file.parent.name:
                found[json.loads(file.read_text())["patient"]["id"]] = file.parent.name
        return found

    def release(self, session, **environment):
        return subprocess.run([self.program, "room", "release", session, "--by", "J. Doe", "--watch", self.work / "watch.json"],
                              env=os.environ | environment, capture_output=True, text=True)

    def release_file(self, session):
        return self.results / "released" / f"{session}.json"

    def at_peer(self):
        return sorted(self.received.iterdir())

    def audit(self):
        return [json.loads(line) for line in (self.results / "audit.jsonl").read_text().splitlines()]


def sha256(path):
    return hashlib.sha256(path.read_bytes()).hexdigest()


def login_user():
    """The user who logged in, whom a release names rather than SUDO_USER; None where the kernel knows nobody."""
    login = int(pathlib.Path("/proc/self/loginuid").read_text())
    return None if login == 2**32 - 1 else pwd.getpwuid(login).pw_name


def forged(room, session):
    """A release file that somebody wrote by hand, with all that isoshift room release would write."""
    folder = room.session(session)
    objects = [{"file": name, "sha256": sha256(folder / name)} for name in ("spatial_registration.dcm", "report.dcm") if (folder / name).exists()]
    room.release_file(session).write_text(json.dumps({
        "schema": 1, "session": session, "by": "J. Doe", "user": "root", "on": "2026-03-01T10:00:00+0100", "verdict": "accepted", "objects": objects, "peers": ["record"],
        "record": sha256(room.results / "registered" / f"{session}.json")}))


def main(program, work):
    room = Room(program, work)
    try:
        for n in range(PATIENTS):
            subprocess.run([program, "phantom", "-o", work / "in" / str(n), "--seed", str(n + 1), "--voxel-mm", "4", "--image-pixels", "96", "--photons", "0"],
                           check=True, capture_output=True)
        room.start_watch()
        wait_for(lambda: len(room.by_patient()) == PATIENTS, 180, "all sessions")
        found = room.by_patient()
        room.end_watch()

        # Another patient's report among the files.
        session, other = found["PHANTOM2"], room.session(found["PHANTOM1"])
        genuine = (room.session(session) / "report.dcm").read_bytes()
        shutil.copyfile(other / "report.dcm", room.session(session) / "report.dcm")
        refused = room.release(session)
        expect(refused.returncode == 1 and "report.dcm" in refused.stderr, f"another patient's report: status {refused.returncode}, {refused.stdout}{refused.stderr}")
        expect(not room.release_file(session).exists(), "another patient's report: a release file was written")
        (room.session(session) / "report.dcm").write_bytes(genuine)

        # What nobody touched is released, with the user of the system and of sudo, and sent.
        session = found["PHANTOM1"]
        released = room.release(session, SUDO_USER="jdoe")
        expect(released.returncode == 0 and "sent" in released.stdout, f"release: {released.stdout}{released.stderr}")
        line = next(line for line in room.audit() if line["event"] == "released")
        user = subprocess.run(["id", "-un"], capture_output=True, text=True).stdout.strip()
        login = login_user()
        sudo_user = "jdoe" if login is None else login if login != user else None
        for record in (line, json.loads(room.release_file(session).read_text())):
            expect((record["by"], record.get("user"), record.get("sudo_user")) == ("J. Doe", user, sudo_user), f"who released: {record}")
        expect(f"J. Doe (user {user}" + (f", sudo of {sudo_user})" if sudo_user else ")") in released.stdout, released.stdout)
        expect(line.get("release") == sha256(room.release_file(session)), "the audit line does not name the release file")
        expect(len(room.at_peer()) == len(list(room.session(session).glob("*.dcm"))), f"the peer received {room.at_peer()}")

        # Released while the peer was down, and exchanged before it was sent; and a release that nobody gave.
        session = found["PHANTOM2"]
        room.peer.kill()
        room.peer.wait()
        released = room.release(session)
        expect(released.returncode == 0 and "not sent yet" in released.stdout, f"release: {released.stdout}{released.stderr}")
        shutil.copyfile(other / "view1.png", room.session(session) / "view1.png")
        forged(room, found["PHANTOM3"])
        room.peer = subprocess.Popen([str(word) for word in room.peer.args])
        before = len(room.at_peer())
        room.start_watch()
        wait_for(lambda: "view1.png" in room.log.read_text() and f"{found['PHANTOM3']}.json" in room.log.read_text(), 20, "both to be told")
        time.sleep(3)
        expect(len(room.at_peer()) == before, "an exchanged or forged result was sent")
        room.end_watch(signal.SIGTERM)
        audit = (room.results / "audit.jsonl").read_text()
        expect("PHANTOM" not in audit and "Phantom" not in audit and "2.25." not in audit, "the audit log names a patient or a UID")
    finally:
        if room.watch and room.watch.poll() is None:
            room.watch.kill()
        room.peer.kill()


if __name__ == "__main__":
    main(sys.argv[1], pathlib.Path(sys.argv[2]))
