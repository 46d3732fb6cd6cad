"""A treatment room whose engine, server and browsers are killed again and again while studies arrive, are registered, decided about and
sent. At the end nothing is lost, doubled, mixed, or sent without a release: the peer counts what it stored.

  kills.py ISOSHIFT WORK [KILLS [PATIENTS]]

WORK is an empty folder. Prints what went wrong and exits with 1, or a line with figures and 0.
"""

import collections
import http.client
import json
import pathlib
import random
import signal
import socket
import subprocess
import sys
import threading
import time

import pydicom

sys.path.insert(0, str(pathlib.Path(__file__).parents[2] / "support"))
from orthanc_server import free_port
from room import expect, wait_for
from watch_with_orthanc import Room, studies

SECRET = "word"


class KilledRoom(Room):
    """With a screen behind a proxy, and programs that are killed and started again."""

    def __init__(self, program, work, patients):
        super().__init__(program, work, patients)
        self.peer.settings["DicomAlwaysAllowFind"] = True  # a peer that can be asked receives nothing twice
        self.port = free_port()
        (work / "secret").write_text(SECRET + "\n")
        (work / "secret").chmod(0o600)
        (work / "serve.json").write_text(json.dumps({
            "serve_file": 1, "watch": "watch.json", "port": self.port, "proxy": {"header": "X-Remote-User", "secret_file": "secret"},
            "roles": {"doe": ["view", "release"]}}))
        self.running, self.lock = {}, threading.Lock()

    def start_program(self, name):
        with self.lock:
            self.running[name] = subprocess.Popen([self.program, "room", name, self.work / f"{name}.json"], stdout=self.log, stderr=self.log)

    def kill_program(self, name):
        with self.lock:
            self.running[name].send_signal(signal.SIGKILL)
            self.running[name].wait()

    def headers(self):
        return {"X-Remote-User": "doe", "X-Isoshift-Proxy": SECRET, "Content-Type": "application/json"}

    def ask(self, method, path, body=None, token=""):
        """The answer, or None if there is no server."""
        connection = http.client.HTTPConnection("127.0.0.1", self.port, timeout=10)
        try:
            connection.request(method, path, json.dumps(body) if body is not None else None, {**self.headers(), "X-Isoshift-Token": token})
            answer = connection.getresponse()
            return answer.status, json.loads(answer.read())
        except (OSError, http.client.HTTPException, ValueError):
            return None
        finally:
            connection.close()

    def get(self, path):
        answer = self.ask("GET", path)
        return answer[1] if answer and answer[0] == 200 else None

    def break_off(self, path, body, token):
        """A browser that is gone before it hears the answer."""
        content = json.dumps(body)
        head = "".join(f"{name}: {value}\r\n" for name, value in {**self.headers(), "X-Isoshift-Token": token, "Content-Length": len(content)}.items())
        try:
            with socket.create_connection(("127.0.0.1", self.port), timeout=5) as one:
                one.sendall(f"POST {path} HTTP/1.1\r\nHost: x\r\n{head}\r\n{content}".encode())
        except OSError:
            pass


def is_rejected(patient):
    """By the person of this test."""
    return int(patient.removeprefix("PHANTOM")) % 4 == 0


def has_end(room, patient, session):
    """Whether what shall become of a result has become of it. A result that isoshift rejected stays as it is."""
    if room.result(session)["verdict"] == "rejected":
        return True
    return bool(list((room.results / "decided").glob(f"{session}.*"))) if is_rejected(patient) else (room.results / "released" / f"{session}.json").exists()


class Person(threading.Thread):
    """Decides about every session, one way for each patient, until all are decided. Some of the browsers break off."""

    def __init__(self, room):
        super().__init__(daemon=True)
        self.room, self.broken_off, self.is_over = room, 0, False

    def run(self):
        while not self.is_over:
            listed = self.room.get("/api/room")
            for one in listed["sessions"] if listed else []:
                self.decide(one["session"])
            time.sleep(0.3)

    def decide(self, session):
        seen, me = self.room.get(f"/api/sessions/{session}"), self.room.get("/api/me")
        if not seen or not me or seen["decision"] or seen["obstacle"]:
            return
        patient = self.room.result(session)["patient"]["id"]
        if is_rejected(patient):
            path, body = "decide", {"decision": "rejected", "record": seen["record"], "reason": "for this test"}
        else:
            path, body = "release", {"record": seen["record"], "objection": seen["objection"], "despite": False}
        path = f"/api/sessions/{session}/{path}"
        if random.random() < 0.4:
            self.room.break_off(path, body, me["token"])
            self.broken_off += 1
        else:
            self.room.ask("POST", path, body, me["token"])


def main(program, work, kills, patients):
    random.seed(11)
    room = KilledRoom(program, work, patients)
    person, killed = Person(room), collections.Counter()
    try:
        made = studies(room)
        room.source.start()
        room.peer.start()
        for name in ("watch", "serve"):
            room.start_program(name)
        person.start()

        def send_all():
            for files in made.values():
                random.shuffle(files)
                room.source.send(files)
                time.sleep(random.uniform(0.5, 1.5) * 4.0 * kills / patients)

        sender = threading.Thread(target=send_all, daemon=True)
        sender.start()
        for _ in range(kills):
            time.sleep(random.expovariate(1 / 4.0))
            name = random.choice(["watch", "serve"])
            room.kill_program(name)
            killed[name] += 1
            time.sleep(random.uniform(0, 0.5))
            room.start_program(name)
        sender.join()

        def are_all_decided():
            results = {room.result(session)["patient"]["id"]: session for session in room.sessions()}
            return sorted(results) == sorted(made) and all(has_end(room, *one) for one in results.items())

        wait_for(are_all_decided, 60 + 20 * patients, "all sessions and decisions")
        found = {room.result(session)["patient"]["id"]: session for session in room.sessions()}
        released = {patient: session for patient, session in found.items() if (room.results / "released" / f"{session}.json").exists()}
        objects = {str(pydicom.dcmread(file, stop_before_pixels=True).SOPInstanceUID): session for session in released.values()
                   for file in (room.results / "sessions" / session).glob("*.dcm")}
        wait_for(lambda: set(objects) <= set(room.at_peer()), 120, "all released objects at the peer")
        time.sleep(10)

        expect(len(room.sessions()) == patients, f"sessions of {sorted(found)}: {room.sessions()}")
        owner = {str(pydicom.dcmread(file, stop_before_pixels=True).SOPInstanceUID): patient for patient, files in made.items() for file in files}
        for patient, session in found.items():
            views = [view["sop_instance_uid"] for view in room.result(session)["views"]]
            expect({owner[uid] for uid in views} == {patient}, f"{patient}: X-rays of {[owner[uid] for uid in views]}")
        stored = collections.Counter(room.at_peer())
        expect(set(stored) == set(objects), f"at the peer, and not released: {set(stored) - set(objects)}")
        expect(set(stored.values()) == {1}, f"stored more than once: {[uid for uid, count in stored.items() if count > 1]}")
        whole = subprocess.run([program, "room", "audit", room.results / "audit.jsonl"], capture_output=True, text=True, check=False)
        expect(whole.returncode == 0, f"audit: {whole.stdout}{whole.stderr}")
        print(f"{killed['watch']} kills of watch, {killed['serve']} of serve, {person.broken_off} browsers that broke off; {patients} sessions, "
              f"{len(released)} released, {len(stored)} objects stored once each; {whole.stdout.splitlines()[0]} of the audit log")
    finally:
        person.is_over = True
        for one in room.running.values():
            one.kill()
            one.wait()
        room.source.stop()
        room.peer.stop()


if __name__ == "__main__":
    main(sys.argv[1], pathlib.Path(sys.argv[2]), int(sys.argv[3]) if len(sys.argv) > 3 else 100, int(sys.argv[4]) if len(sys.argv) > 4 else 20)
