"""What README.txt of isoshift room serve --init leads through: two Orthanc servers, watch, serve, a phantom, and its result at the peer.

  first_room.py ISOSHIFT WORK

WORK is an empty folder. Prints what went wrong and exits with 1.
"""

import base64
import json
import pathlib
import re
import ssl
import subprocess
import sys
import time
import urllib.request

sys.path.insert(0, str(pathlib.Path(__file__).parents[1] / "support"))
sys.path.insert(0, str(pathlib.Path(__file__).parents[1] / "workflow" / "room"))
from orthanc_server import free_port
from room import expect, wait_for

PORTS = ("8142", "4142", "8143", "4143", "8443")


def main(program, work):
    room = work / "room"
    subprocess.run([program, "room", "serve", "--init", room], check=True, capture_output=True)
    again = subprocess.run([program, "room", "serve", "--init", room], capture_output=True, text=True, check=False)
    expect(again.returncode == 1, "an earlier room was replaced")
    for file in room.iterdir():
        expect(file.name == ".isoshift" or file.stat().st_mode & 0o077 == 0, f"others can read {file}")
    # Another room may be open here: ports of this one's own.
    ports = {port: str(free_port()) for port in PORTS}
    for file in [*room.glob("*.json"), room / "README.txt"]:
        file.write_text(re.sub(r"\b(" + "|".join(PORTS) + r")\b", lambda port: ports[port[0]], file.read_text()))
    steps = (room / "README.txt").read_text()
    tls = ssl.create_default_context(cafile=room / "ca.pem")
    programs = []

    def start(*command):
        expect(" ".join(command) in steps, f"README.txt does not say {command}")
        log = (work / (re.sub(r"\W", "-", " ".join(command)) + ".log")).open("a")
        words = [program if command[0] == "isoshift" else "/usr/sbin/Orthanc", *command[1:]]
        programs.append(subprocess.Popen(words, cwd=room, stdout=log, stderr=subprocess.STDOUT))

    def fetch(port, path, server=None):
        request = urllib.request.Request(f"{'http' if server else 'https'}://localhost:{ports[port]}{path}")
        if server:
            password = (room / f"{server}.password").read_text().strip()
            request.add_header("Authorization", "Basic " + base64.b64encode(f"isoshift:{password}".encode()).decode())
        with urllib.request.urlopen(request, timeout=10, context=tls) as answer:
            return answer.read()

    def answers(port, path, server=None):
        try:
            return bool(fetch(port, path, server))
        except OSError:  # not yet
            return False

    try:
        start("Orthanc", "source.json")
        start("Orthanc", "record.json")
        wait_for(lambda: answers("8142", "/system", "source") and answers("8143", "/system", "record"), 30, "the Orthanc servers")
        start("isoshift", "room", "watch", "watch.json")
        start("isoshift", "room", "serve", "serve.json")
        subprocess.run([program, "phantom", "-o", work / "study"], check=True, capture_output=True)
        subprocess.run(["storescu", "+sd", "+r", "+sp", "*.dcm", "-aec", "SOURCE", "localhost", ports["4142"], work / "study"], check=True, capture_output=True)
        sessions = room / "results" / "sessions"
        finished = lambda: [file.parent.name for file in sessions.glob("*/result.json") if not file.parent.name.startswith(".")]
        wait_for(finished, 120, "the session")
        session = finished()[0]
        expect(json.loads((sessions / session / "result.json").read_text())["verdict"] == "accepted", "the phantom was not accepted")
        wait_for(lambda: b"Sign in" in fetch("8443", "/sign-in"), 10, "the screen")
        time.sleep(1)
        expect(fetch("8143", "/instances", "record").strip() == b"[]", "something was sent before its release")
        subprocess.run([program, "room", "release", session, "--by", "J. Doe", "--watch", "watch.json"], cwd=room, check=True, capture_output=True)
        wait_for(lambda: len(json.loads(fetch("8143", "/instances", "record"))) == 2, 60, "the report and the registration at the peer")
        released = json.loads((room / "results" / "released" / f"{session}.json").read_text())
        expect("signature" in released, "the release is not signed")
    finally:
        for one in programs:
            one.terminate()
        for one in programs:
            one.wait()


if __name__ == "__main__":
    main(sys.argv[1], pathlib.Path(sys.argv[2]))
