"""A watch whose disk is full, and whose peer does not answer: nothing is lost, nobody else waits.

  watch_in_trouble.py ISOSHIFT WORK

WORK is an empty folder. Prints what went wrong and exits with 1, or ends with 0.
"""

import json
import pathlib
import re
import resource
import socket
import subprocess
import sys

from room import expect, wait_for

FULL_AT_BYTES = 3000  # less than index.html


def main(program, work):
    peer = socket.socket()  # takes connections, and says nothing
    peer.bind(("127.0.0.1", 0))
    peer.listen()
    results, log = work / "results", work / "watch.log"
    (work / "in").mkdir()
    (work / "site.json").write_text(json.dumps({"site_file": 1, "name": "test", "sessions": {"views": 2, "quiet_s": 1}}))
    (work / "watch.json").write_text(json.dumps({
        "watch_file": 1, "folder": "in", "results": "results", "site": "site.json", "register": ["--preset=fast"],
        "peers": [{"name": "mute", "host": "127.0.0.1", "port": peer.getsockname()[1], "called_aet": "MUTE", "calling_aet": "ISOSHIFT", "tls": False}]}))

    def sessions():
        return {f.parent.name for f in (results / "sessions").glob("*/result.json") if "." not in f.parent.name}

    def bring_study(seed):
        subprocess.run([program, "phantom", "-o", work / "in" / str(seed), "--seed", str(seed), "--voxel-mm", "4", "--image-pixels", "96", "--photons", "0"],
                       check=True, capture_output=True)

    # Files of the watch and of its registrations that grow beyond a limit cannot be written: SIGXFSZ stays ignored.
    watch = subprocess.Popen([program, "room", "watch", work / "watch.json"], stderr=log.open("a"), restore_signals=False)
    try:
        wait_for(lambda: (results / "index.html").exists(), 30, "the index")
        resource.prlimit(watch.pid, resource.RLIMIT_FSIZE, (FULL_AT_BYTES, resource.RLIM_INFINITY))
        bring_study(1)
        wait_for(lambda: re.search("session .*: File too large", log.read_text()), 60, "a registration to find the disk full")
        wait_for(lambda: "writing the index: " in log.read_text(), 30, "writing the index to be in trouble")
        expect(not sessions(), "a session on a full disk")
        resource.prlimit(watch.pid, resource.RLIMIT_FSIZE, (resource.RLIM_INFINITY, resource.RLIM_INFINITY))
        wait_for(lambda: len(sessions()) == 1, 120, "the session of a disk that was full")

        released = subprocess.run([program, "room", "release", *sessions(), "--by", "J. Doe", "--watch", work / "watch.json"], capture_output=True, text=True)
        expect(released.returncode == 0 and "isoshift room watch sends it" in released.stdout, f"release: {released.stdout}{released.stderr}")
        connection = peer.accept()  # it tries
        bring_study(2)
        wait_for(lambda: len(sessions()) == 2, 25, "a session while the peer says nothing")
        del connection
    finally:
        watch.kill()
        watch.wait()


if __name__ == "__main__":
    main(sys.argv[1], pathlib.Path(sys.argv[2]))
