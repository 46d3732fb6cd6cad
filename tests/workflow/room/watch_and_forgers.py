"""Results that were exchanged, edited or copied, releases that nobody gave, and an audit log that cannot be written: nothing of it leaves.

  watch_and_forgers.py ISOSHIFT WORK

WORK is an empty folder. Prints what went wrong and exits with 1, or ends with 0.
"""

import hashlib
import json
import os
import pathlib
import shutil
import signal
import subprocess
import sys
import time

sys.path.insert(0, str(pathlib.Path(__file__).parents[2] / "support"))
from orthanc_server import free_port
from room import expect, wait_for

PATIENTS = 4


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
        self.watch = subprocess.Popen([self.program, "watch", self.work / "watch.json"], stderr=self.log.open("a"))

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
        return subprocess.run([self.program, "release", session, "--by", "J. Doe", "--watch", self.work / "watch.json"],
                              env=os.environ | environment, capture_output=True, text=True)

    def expect_refused(self, session, reason, what):
        released, before = self.release(session), len(self.at_peer())
        expect(released.returncode == 1 and reason in released.stderr, f"{what}: status {released.returncode}, {released.stdout}{released.stderr}")
        expect(not self.release_file(session).exists(), f"{what}: a release file was written")
        expect(len(self.at_peer()) == before, f"{what}: the peer received something")

    def release_file(self, session):
        return self.results / "released" / f"{session}.json"

    def at_peer(self):
        return sorted(self.received.iterdir())

    def audit(self):
        return [json.loads(line) for line in (self.results / "audit.jsonl").read_text().splitlines()]


def sha256(path):
    return hashlib.sha256(path.read_bytes()).hexdigest()


def exchanged_edited_and_added(room, found):
    """Files of a held session that are not those that were registered."""
    victim, other = room.session(found["PHANTOM4"]), room.session(found["PHANTOM2"])
    genuine = (victim / "report.dcm").read_bytes()
    shutil.copyfile(other / "report.dcm", victim / "report.dcm")
    room.expect_refused(victim.name, "report.dcm", "another patient's report")
    (victim / "report.dcm").write_bytes(genuine)

    result = (victim / "result.json").read_text()
    (victim / "result.json").write_text(result.replace('"lateral_mm"', '"lateral_mm" '))
    room.expect_refused(victim.name, "result.json", "an edited result")
    (victim / "result.json").write_text(result)

    (victim / "note.txt").write_text("accepted")
    room.expect_refused(victim.name, "note.txt", "an added file")
    (victim / "note.txt").unlink()

    (victim / "report.pdf").rename(room.work / "report.pdf")
    room.expect_refused(victim.name, "report.pdf", "a file that is missing")
    (victim / "report.pdf").symlink_to(room.work / "report.pdf")
    room.expect_refused(victim.name, "report.pdf", "a link")
    (victim / "report.pdf").unlink()
    (room.work / "report.pdf").rename(victim / "report.pdf")

    victim.rename(room.work / "aside")
    other.rename(victim)
    room.expect_refused(victim.name, "is not what was registered", "two folders that changed their names")
    victim.rename(other)
    (room.work / "aside").rename(victim)


def copied(room, session):
    """A folder of a session that was released and sent, under another name."""
    copy = room.session("0123456789ab")
    shutil.copytree(room.session(session), copy)
    room.expect_refused(copy.name, "no record of its registration", "a copied folder")
    record = room.results / "registered" / f"{session}.json"
    if record.exists():  # with its record, too
        (room.results / "registered" / f"{copy.name}.json").write_text(record.read_text().replace(session, copy.name))
        room.expect_refused(copy.name, "audit.jsonl", "a copied folder with a copied record")
        (room.results / "registered" / f"{copy.name}.json").unlink()
    shutil.rmtree(copy)


def forged(room, session):
    """A release file that somebody wrote by hand; watch would send it."""
    folder = room.session(session)
    objects = [{"file": name, "sha256": sha256(folder / name)} for name in ("spatial_registration.dcm", "report.dcm") if (folder / name).exists()]
    release = {"schema": 1, "session": session, "by": "J. Doe", "user": "root", "on": "2026-03-01T10:00:00+0100", "verdict": "accepted", "objects": objects, "peers": ["record"]}
    record = room.results / "registered" / f"{session}.json"
    if record.exists():
        release["record"] = sha256(record)
    before = len(room.at_peer())
    room.release_file(session).write_text(json.dumps(release))
    copy = room.session("0123456789ab")
    shutil.copytree(folder, copy)
    room.start_watch()
    wait_for(lambda: f"{session}.json" in room.log.read_text() and f"{session}.json" in (room.results / "index.html").read_text(), 20, "the forged release to be told")
    wait_for(lambda: f"session {copy.name}: there is no record of its registration" in (room.results / "index.html").read_text(), 20, "the copied folder to be told")
    time.sleep(3)
    expect(room.log.read_text().count(f"{session}.json") == 1, "the forged release is told more than once")
    room.end_watch()
    expect(len(room.at_peer()) == before, "a forged release was sent")
    expect(all(line.get("session") != session for line in room.audit() if line["event"] in ("released", "sent")), "a forged release entered the audit log")
    room.release_file(session).unlink()
    shutil.rmtree(copy)


def without_audit_log(room, session):
    """Tests may run as root: a log that is a folder can be written by nobody."""
    log = room.results / "audit.jsonl"
    aside = log.rename(room.work / "audit.jsonl")
    room.expect_refused(session, "audit.jsonl", "a deleted audit log")
    log.unlink(missing_ok=True)
    log.mkdir()
    room.expect_refused(session, "audit.jsonl", "an audit log that cannot be written")
    log.rmdir()
    aside.rename(log)


def main(program, work):
    room = Room(program, work)
    try:
        for n in range(PATIENTS):
            subprocess.run([program, "phantom", "-o", work / "in" / str(n), "--seed", str(n + 1), "--voxel-mm", "4", "--image-pixels", "96", "--photons", "0"],
                           check=True, capture_output=True)
        room.start_watch()
        wait_for(lambda: len(room.by_patient()) == PATIENTS, 180, "all sessions")
        found = room.by_patient()
        time.sleep(1)
        room.end_watch()

        exchanged_edited_and_added(room, found)
        without_audit_log(room, found["PHANTOM4"])
        forged(room, found["PHANTOM3"])

        # What nobody touched is released, with the user of the system and of sudo, and sent.
        session = found["PHANTOM1"]
        released = room.release(session, SUDO_USER="jdoe")
        expect(released.returncode == 0 and "sent" in released.stdout, f"release: {released.stdout}{released.stderr}")
        line = next(line for line in room.audit() if line["event"] == "released")
        user = subprocess.run(["id", "-un"], capture_output=True, text=True).stdout.strip()
        for record in (line, json.loads(room.release_file(session).read_text())):
            expect((record["by"], record.get("user"), record.get("sudo_user")) == ("J. Doe", user, "jdoe"), f"who released: {record}")
        expect(f"J. Doe (user {user}, sudo of jdoe)" in released.stdout, released.stdout)
        expect(line.get("release") == sha256(room.release_file(session)), "the audit line does not name the release file")
        expect(len(room.at_peer()) == len(list(room.session(session).glob("*.dcm"))), f"the peer received {room.at_peer()}")
        copied(room, session)

        # Released, and exchanged before it was sent.
        session = found["PHANTOM4"]
        room.peer.kill()
        room.peer.wait()
        released = room.release(session)
        expect(released.returncode == 0 and "not sent yet" in released.stdout, f"release: {released.stdout}{released.stderr}")
        shutil.copyfile(room.session(found["PHANTOM2"]) / "view1.png", room.session(session) / "view1.png")
        again = room.release(session)
        expect(again.returncode == 1 and "has been released by J. Doe (user" in again.stderr, f"released twice: {again.stderr}")
        room.peer = subprocess.Popen([str(word) for word in room.peer.args])
        before = len(room.at_peer())
        room.start_watch()
        wait_for(lambda: "view1.png" in room.log.read_text(), 20, "the exchanged picture to be told")
        time.sleep(3)
        expect(len(room.at_peer()) == before, "an exchanged result was sent")
        room.end_watch(signal.SIGTERM)

        # The way out: the X-rays are registered again, and somebody releases that.
        room.session(session).rename(work / "exchanged")
        room.start_watch()
        wait_for(lambda: "PHANTOM4" in room.by_patient(), 60, "the session to be registered again")
        wait_for(lambda: "releases an earlier registration" in (room.results / "index.html").read_text(), 20, "the index to tell of the earlier release")
        expect(len(room.at_peer()) == before, "a result was sent with the release of an earlier one")
        room.release_file(session).unlink()
        released = room.release(session)
        expect(released.returncode == 0, f"release: {released.stdout}{released.stderr}")
        wait_for(lambda: len(room.at_peer()) == before + len(list(room.session(session).glob("*.dcm"))), 30, "the new result at the peer")
        room.end_watch(signal.SIGTERM)
        audit = (room.results / "audit.jsonl").read_text()
        expect("PHANTOM" not in audit and "Phantom" not in audit and "2.25." not in audit, "the audit log names a patient or a UID")
    finally:
        if room.watch and room.watch.poll() is None:
            room.watch.kill()
        room.peer.kill()


if __name__ == "__main__":
    main(sys.argv[1], pathlib.Path(sys.argv[2]))
