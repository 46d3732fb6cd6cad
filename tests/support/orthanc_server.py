"""An Orthanc server of a test's own, on free ports of the loopback device."""

import json
import socket
import subprocess
import time
import urllib.error
import urllib.request


def free_port():
    with socket.socket() as listener:
        listener.bind(("127.0.0.1", 0))
        return listener.getsockname()[1]


def fetch(url, data=None):
    with urllib.request.urlopen(urllib.request.Request(url, data=data), timeout=60) as answer:
        return answer.read()


class Orthanc:
    def __init__(self, folder, title="ORTHANC", **more):
        self.http, self.dicom, self.title = free_port(), free_port(), title
        self.url = f"http://127.0.0.1:{self.http}"
        folder.mkdir()
        self.log = folder / "log"
        self.configuration = folder / "orthanc.json"
        self.settings = {
            "HttpPort": self.http, "DicomPort": self.dicom, "DicomAet": title, "RemoteAccessAllowed": False,
            "DicomAlwaysAllowStore": True, "DicomCheckCalledAet": True, "StorageDirectory": str(folder / "storage"),
            "IndexDirectory": str(folder / "storage"), **more}
        self.server = None

    def start(self):
        self.configuration.write_text(json.dumps(self.settings))
        self.server = subprocess.Popen(["/usr/sbin/Orthanc", str(self.configuration)], stdout=self.log.open("a"), stderr=subprocess.STDOUT)
        for _ in range(300):
            if self.server.poll() is not None:
                raise SystemExit(f"Orthanc ended with {self.server.returncode}: {self.log.read_text()}")
            try:
                return fetch(self.url + "/system")
            except urllib.error.URLError:
                time.sleep(0.1)
        raise SystemExit("Orthanc did not answer within 30 s")

    def stop(self):
        if self.server:
            self.server.terminate()
            self.server.wait()
            self.server = None

    def get(self, path):
        return json.loads(fetch(self.url + path))

    def send(self, files):
        sent = subprocess.run(["storescu", "-aec", self.title, "127.0.0.1", str(self.dicom), *map(str, files)], capture_output=True, text=True)
        if sent.returncode != 0:
            raise SystemExit(f"storescu: {sent.stdout}{sent.stderr}")
