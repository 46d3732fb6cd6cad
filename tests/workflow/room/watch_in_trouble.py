"""A watch whose server fails or is another one, whose disk is full or damaged, and whose peer does not answer: nothing is lost, nobody
else waits.

  watch_in_trouble.py ISOSHIFT WORK

WORK is an empty folder. Prints what went wrong and exits with 1, or ends with 0.
"""

import http.server
import json
import pathlib
import socket
import subprocess
import sys
import threading
import urllib.parse

import pydicom

from room import expect, wait_for

FAILURES = 5  # of one X-ray, before the server gives it


class Server(http.server.ThreadingHTTPServer):
    """The little of Orthanc's REST interface that watch uses."""

    def __init__(self):
        super().__init__(("127.0.0.1", 0), Handler)
        self.instances, self.failures = [], {}
        threading.Thread(target=self.serve_forever, daemon=True).start()

    def publish(self, files, failures=0, prefix=""):
        for file in files:
            name = f"{prefix}{len(self.instances):08x}"
            if pydicom.dcmread(file, stop_before_pixels=True).Modality == "RTIMAGE":
                self.failures[name], failures = failures, 0
            self.instances.append((name, file.read_bytes()))


class Handler(http.server.BaseHTTPRequestHandler):
    def log_message(self, *_):
        pass

    def answer(self, status, body):
        self.send_response(status)
        self.send_header("Content-Length", str(len(body)))
        self.end_headers()
        self.wfile.write(body)

    def do_GET(self):
        url = urllib.parse.urlparse(self.path)
        if url.path == "/changes":
            since, limit = (int(urllib.parse.parse_qs(url.query)[key][0]) for key in ("since", "limit"))
            new = self.server.instances[since:since + limit]
            changes = [{"ChangeType": "NewInstance", "ID": name, "Seq": since + n + 1} for n, (name, _) in enumerate(new)]
            last = since + len(new)
            return self.answer(200, json.dumps({"Changes": changes, "Last": last, "Done": last >= len(self.server.instances)}).encode())
        name = url.path.split("/")[2]
        if self.server.failures.get(name, 0) > 0:
            self.server.failures[name] -= 1
            return self.answer(500, b"")
        return self.answer(200, dict(self.server.instances)[name])


def study(program, folder, seed):
    subprocess.run([program, "phantom", "-o", folder, "--seed", str(seed), "--voxel-mm", "4", "--image-pixels", "96", "--photons", "0"], check=True, capture_output=True)
    return sorted(folder.rglob("*.dcm"))


def main(program, work):
    server = Server()
    peer = socket.socket()  # takes connections, and says nothing
    peer.bind(("127.0.0.1", 0))
    peer.listen()
    disk = work / "disk"
    disk.mkdir()
    is_mounted = subprocess.run(["mount", "-t", "tmpfs", "-o", "size=20m", "none", disk], capture_output=True).returncode == 0
    (work / "site.json").write_text(json.dumps({"site_file": 1, "name": "test", "sessions": {"views": 2, "quiet_s": 1}}))
    (work / "watch.json").write_text(json.dumps({
        "watch_file": 1, "orthanc": {"url": f"http://127.0.0.1:{server.server_port}"}, "results": "disk/results", "site": "site.json", "register": ["--preset=fast"],
        "peers": [{"name": "mute", "host": "127.0.0.1", "port": peer.getsockname()[1], "called_aet": "MUTE", "calling_aet": "ISOSHIFT", "tls": False}]}))
    results = disk / "results"

    def sessions():
        return {f.parent.name for f in (results / "sessions").glob("*/result.json") if "." not in f.parent.name}

    log = work / "watch.log"

    def start():
        return subprocess.Popen([program, "watch", work / "watch.json"], stderr=log.open("a"))

    def kill():
        watch.kill()
        watch.wait()

    watch = start()
    try:
        wait_for(lambda: (results / "index.html").exists(), 30, "the index")
        filler = disk / "filler"
        if is_mounted:
            subprocess.run(["dd", "if=/dev/zero", f"of={filler}", "bs=64k"], capture_output=True)  # until the disk is full
        server.publish(study(program, work / "a", 1), FAILURES)
        if is_mounted:
            wait_for(lambda: "No space left on device" in log.read_text(), 30, "the disk to be full")
            wait_for(lambda: "receiving: " in log.read_text(), 30, "receiving to be in trouble")
            filler.unlink()
        wait_for(lambda: len(sessions()) == 1, 120, "the session of a server that fails")
        first = sessions()
        expect(sum(server.failures.values()) == 0, "the server was not asked again")

        released = subprocess.run([program, "release", *first, "--by", "J. Doe", "--watch", work / "watch.json"], capture_output=True, text=True)
        expect(released.returncode == 0 and "isoshift watch sends it" in released.stdout, f"release: {released.stdout}{released.stderr}")
        connection = peer.accept()  # it tries
        server.publish(study(program, work / "b", 2))
        wait_for(lambda: len(sessions()) == 2, 25, "a session while the peer says nothing")
        del connection

        # A result and an object that are damaged: the object comes again, and the result keeps no other.
        kill()
        damaged = sorted((results / "objects").glob("*.dcm"))[0]
        content = damaged.read_bytes()
        damaged.write_bytes(content[:200])
        (results / "sessions" / min(first) / "result.json").write_text("{")
        watch = start()
        wait_for(lambda: damaged.exists() and damaged.read_bytes() == content, 30, "the damaged object to come again")
        server.publish(study(program, work / "c", 3))
        wait_for(lambda: len(sessions()) == 3, 60, "a session beside a damaged one")
        wait_for(lambda: "holds no readable result" in (results / "index.html").read_text(), 10, "the index to tell of the damaged one")

        # Another server's database, with more changes than the first had.
        kill()
        before, server.instances = len(server.instances), []
        other = study(program, work / "d", 4)
        while len(server.instances) <= before:
            server.publish(other, prefix="f")
        watch = start()
        wait_for(lambda: len(sessions()) == 4, 60, "the session of another server")
        expect("holds other changes than before" in log.read_text(), "another server was not told")
    finally:
        kill()
        if is_mounted:
            subprocess.run(["umount", disk], check=True)


if __name__ == "__main__":
    main(sys.argv[1], pathlib.Path(sys.argv[2]))
