"""The room's screen in Chromium: sessions appear, are looked at and released; two browsers see each other's changes; the
heartbeat tells when the engine is killed.

  screen_in_browser.py ISOSHIFT WORK

WORK is an empty folder. Prints what went wrong and exits with 1, or ends with 0.
"""

import base64
import datetime
import json
import pathlib
import re
import signal
import subprocess
import sys
import time

import pydicom
from selenium.webdriver.common.by import By
from selenium.webdriver.common.keys import Keys

ROOT = pathlib.Path(__file__).resolve().parents[1]
sys.path += [str(ROOT / "io/report"), str(ROOT / "workflow/room")]

from browser import new_browser, problems  # noqa: E402
from room import expect, wait_for  # noqa: E402


def browser_of(user, address):
    """A browser behind a proxy that names this user."""
    browser = new_browser(1280, 1024)
    browser.execute_cdp_cmd("Network.enable", {})
    browser.execute_cdp_cmd("Network.setExtraHTTPHeaders", {"headers": {"X-Remote-User": user, "X-Isoshift-Proxy": "word"}})
    browser.get(address)
    return browser


def open_room(program, work, preset="fast", **site):
    """A room that registers what comes to WORK/in: the processes of watch and serve, and the screen's address."""
    (work / "in").mkdir()
    secret = work / "secret"
    secret.write_text("word\n")
    secret.chmod(0o600)
    (work / "site.json").write_text(json.dumps({"site_file": 1, "name": "Linac 3", "sessions": {"views": 2, "quiet_s": 1}, **site}))
    (work / "watch.json").write_text(json.dumps({
        "watch_file": 1, "folder": "in", "results": "results", "site": "site.json", "register": [f"--preset={preset}"]}))
    (work / "serve.json").write_text(json.dumps({
        "serve_file": 1, "watch": "watch.json", "port": 0, "proxy": {"header": "X-Remote-User", "secret_file": "secret"},
        "roles": {"doe": ["view", "register", "release"], "roe": ["view"], "poe": ["view", "release"]}}))
    results, log = work / "results", work / "serve.log"
    watch = subprocess.Popen([program, "room", "watch", work / "watch.json"], stderr=(work / "watch.log").open("w"))
    wait_for(lambda: (results / "engine.json").exists(), 30, "the engine")
    serve = subprocess.Popen([program, "room", "serve", work / "serve.json"], stderr=log.open("w"))
    wait_for(lambda: "serving" in log.read_text(), 30, "the server")
    return watch, serve, re.search(r"http://\S+", log.read_text())[0]


def text(browser, selector):
    return "\n".join(one.text for one in browser.find_elements(By.CSS_SELECTOR, selector))


kHostileName = "<img src=x onerror=document.body.remove()>^Roe"


def decide_and_register_by_hand(doe, poe, address, results):
    """The session that is not released yet: rejected, taken back, registered by hand, and released by another person."""
    released = {path.stem for path in (results / "released").glob("*.json")}
    [session] = [path.name for path in (results / "sessions").glob("[!.]*") if path.name not in released]
    doe.get(f"{address}/session/{session}")
    wait_for(lambda: doe.find_element(By.ID, "release").is_enabled(), 10, "a session that can be released")
    doe.execute_script("arguments[0].src = '/api/sessions/none/report.html'", doe.find_element(By.ID, "report"))
    wait_for(lambda: "could not be loaded" in text(doe, "#problem"), 10, "the words for a report that is not there")
    for button in ("release", "agreed"):
        expect(not doe.find_element(By.ID, button).is_enabled(), f"{button}: without the report on the screen")
    wait_for(lambda: doe.find_element(By.ID, "release").is_enabled(), 10, "the report, asked for again")
    poe.get(f"{address}/session/{session}/trend")
    wait_for(lambda: "held" in text(poe, "#results"), 10, "the trend")
    expect("<img src" in text(doe, "#patient"), "a name that holds HTML: " + text(doe, "#patient"))
    expect(not doe.find_element(By.ID, "rejected").is_enabled(), "a result could be rejected without a reason")
    doe.find_element(By.ID, "reason").send_keys("the patient coughed")
    doe.find_element(By.ID, "rejected").click()
    wait_for(lambda: "rejected by doe on" in text(doe, "#state") and "coughed" in text(doe, "#state"), 10, "the decision")
    expect(not doe.find_element(By.ID, "release").is_enabled(), "what was rejected could be released")
    wait_for(lambda: "rejected by doe on" in text(poe, "#results"), 10, "the decision on the page of the trend")
    poe.get(f"{address}/session/{session}")
    wait_for(lambda: "rejected by doe on" in text(poe, "#state"), 10, "the decision in another browser")
    doe.find_element(By.ID, "reason").send_keys("no, he did not")
    doe.find_element(By.ID, "reopened").click()
    wait_for(lambda: doe.find_element(By.ID, "release").is_enabled(), 10, "the decision taken back")
    expect(text(poe, "#by-hand") == "Look closely", "who may not register is led to registration by hand")
    poe.find_element(By.ID, "by-hand").click()
    wait_for(lambda: "rendered in" in text(poe, "#times"), 60, "the DRRs for who may look")
    expect(not poe.find_element(By.ID, "optimize").is_displayed(), "who may not register could")
    poe.get(f"{address}/session/{session}")

    doe.find_element(By.ID, "by-hand").click()
    wait_for(lambda: "rendered in" in text(doe, "#times"), 60, "the DRRs of the session")
    expect("<img src" in text(doe, "#patient"), "a name that holds HTML, by hand: " + text(doe, "#patient"))
    doe.find_element(By.TAG_NAME, "body").send_keys(Keys.ARROW_RIGHT)
    doe.find_element(By.ID, "keep").click()
    wait_for(lambda: "Kept as it was set" in text(doe, "#result"), 60, "the pose kept")
    doe.find_element(By.ID, "hand-over").click()
    wait_for(lambda: "The engine makes it" in text(doe, "#result"), 10, "the result handed over")
    doe.find_element(By.CSS_SELECTOR, "#result a").click()
    wait_for(lambda: f"Session {session}-2" in text(doe, "h1"), 10, "the page of the result by hand")
    wait_for(lambda: (results / "sessions" / f"{session}-2").exists(), 20, "the result by hand in the tree")
    wait_for(lambda: doe.find_element(By.ID, "release").is_enabled(), 10, "a result by hand that appears and can be released")
    doe.find_element(By.ID, "release").click()
    wait_for(lambda: "has set its pose by hand" in text(doe, "#problem"), 10, "the refusal of a release by the same person")
    poe.get(f"{address}/session/{session}")
    wait_for(lambda: f"session {session}-2" in text(poe, "#newest"), 10, "the way to the newest result")
    expect(not poe.find_element(By.ID, "release").is_enabled(), "a superseded result could be released")
    poe.find_element(By.ID, "newest").click()
    wait_for(lambda: poe.find_element(By.ID, "agreed").is_enabled(), 10, "the result by hand")
    poe.find_element(By.ID, "agreed").click()
    wait_for(lambda: "agreed to by poe" in text(poe, "#state"), 10, "the agreement")
    wait_for(lambda: "agreed to by poe" in text(doe, "#state"), 10, "the agreement in the other browser")
    doe.find_element(By.ID, "release").click()
    wait_for(lambda: "released by doe" in text(doe, "#state"), 10, "the release of the result by hand")


def choose_views_an_hour_apart(doe, address, results):
    """Two X-rays that wait for each other are chosen as one session, which is registered and needs a review."""
    doe.get(address)
    wait_for(lambda: len(doe.find_elements(By.LINK_TEXT, "Choose…")) == 2, 30, "two X-rays to choose for")
    before = {path.name for path in (results / "sessions").glob("[!.]*")}
    doe.find_element(By.LINK_TEXT, "Choose…").click()
    wait_for(lambda: len(doe.find_elements(By.NAME, "xrays")) == 2, 10, "the X-rays of the patient")
    own, other = doe.find_elements(By.NAME, "xrays")
    expect(own.is_selected() and not other.is_selected(), "the session's X-ray is not the one that is chosen")
    expect(not doe.find_element(By.ID, "plans").is_displayed(), "a plan is asked for that the X-rays name")
    other.click()
    expect(not doe.find_element(By.ID, "choose").is_enabled(), "a choice without a reason")
    doe.find_element(By.ID, "reason").send_keys("the panel had failed")
    doe.find_element(By.ID, "choose").click()
    wait_for(lambda: "Recorded" in text(doe, "#chosen"), 10, "the choice")
    wait_for(lambda: len({path.name for path in (results / "sessions").glob("[!.]*")} - before) == 1, 60, "its result")
    [made] = {path.name for path in (results / "sessions").glob("[!.]*")} - before
    result = json.loads((results / "sessions" / made / "result.json").read_text())
    reasons = " ".join(result["reasons"])
    expect(result["verdict"] == "review" and "doe chose on" in reasons and "the panel had failed" in reasons,
           f"{result['verdict']}: {reasons}")
    expect('"event":"chosen"' in (results / "audit.jsonl").read_text(), "the audit log does not tell of the choice")


def look_without_a_server(doe, roe, work):
    """What pages show stays, can be printed, and says of when it is."""
    pdf = work / "list.pdf"
    pdf.write_bytes(base64.b64decode(roe.execute_cdp_cmd("Page.printToPDF", {})["data"]))
    printed = subprocess.run(["pdftotext", "-layout", pdf, "-"], check=True, capture_output=True, text=True).stdout
    for words in ("Phantom Digital", "no connection to the server since", "As the server told it on"):
        expect(words in printed, f"the list on paper lacks: {words}\n{printed}")
    doe.execute_cdp_cmd("Browser.setDownloadBehavior", {"behavior": "allow", "downloadPath": str(work)})
    doe.find_element(By.ID, "pdf").click()
    wait_for(lambda: any(path.read_bytes().startswith(b"%PDF") for path in work.glob("session-*.pdf")), 10,
             "the report, from the page itself")


def main(program, work):
    results = work / "results"

    def bring_study(seed, patient_name=None, minutes_between=0):
        study = work / f"study-{seed}"
        subprocess.run([program, "phantom", "-o", study, "--seed", str(seed), "--voxel-mm", "4",
                        "--image-pixels", "96", "--photons", "0"], check=True, capture_output=True)
        for path in study.rglob("*.dcm") if patient_name else []:
            file = pydicom.dcmread(path)
            file.PatientName = patient_name
            file.save_as(path)
        if minutes_between:
            path = sorted((study / "RTIMAGE").glob("*.dcm"))[-1]
            file = pydicom.dcmread(path)
            taken = datetime.datetime.strptime(file.AcquisitionDate + file.AcquisitionTime[:6], "%Y%m%d%H%M%S")
            later = taken + datetime.timedelta(minutes=minutes_between)
            file.AcquisitionDate, file.AcquisitionTime = later.strftime("%Y%m%d %H%M%S").split()
            file.save_as(path)
        study.rename(work / "in" / str(seed))

    def result_of(count):
        wait_for(lambda: len(list((results / "sessions").glob("[!.]*/result.json"))) == count, 120, "a result")
        return time.time()

    watch, serve, address = open_room(program, work)
    doe = roe = None
    try:
        doe, roe = browser_of("doe", address), browser_of("roe", address)
        wait_for(lambda: "engine runs" in text(doe, "#heartbeat"), 10, "the heartbeat")
        bring_study(1)
        wait_for(lambda: text(doe, "#sessions"), 60, "a session that waits")
        began = result_of(1)
        wait_for(lambda: "held" in text(doe, "#sessions"), 10, "the session on the screen")
        print(f"a session appeared {time.time() - began:.1f} s after its result")

# What a person has set stays while sessions come.
        doe.find_element(By.ID, "filter").send_keys("phantom1")
        bring_study(2, kHostileName)
        result_of(2)
        wait_for(lambda: "2 with a result" in text(doe, "#count"), 10, "the second session")
        expect(len(doe.find_elements(By.CSS_SELECTOR, "#sessions tr")) == 1, "the filter was lost: " + text(doe, "#sessions"))
        expect(doe.find_element(By.ID, "filter").get_attribute("value") == "phantom1", "the filter's text was lost")
        doe.find_element(By.ID, "filter").send_keys(Keys.CONTROL, "a", Keys.DELETE)
        wait_for(lambda: "<img src" in text(doe, "#sessions"), 10, "a name that holds HTML in the list")
        doe.find_element(By.ID, "filter").send_keys("phantom1")
        expect("Phantom Digital (PHANTOM1)" in text(doe, "#sessions"), "names: " + text(doe, "#sessions"))

        link = doe.find_element(By.CSS_SELECTOR, "#sessions a")
        page = link.get_attribute("href")
        link.click()
        wait_for(lambda: "held" in text(doe, "#state"), 10, "the session's page")
        roe.get(page)
        wait_for(lambda: "may look" in text(roe, "#goes-to"), 10, "the words for who may only look")
        expect(not roe.find_element(By.ID, "release").is_enabled(), "who may only look could release")
        doe.switch_to.frame("report")
        wait_for(lambda: "Move the couch by" in text(doe, "body"), 10, "the report")
        doe.switch_to.default_content()
        doe.find_element(By.ID, "release").click()
        wait_for(lambda: "released by doe" in text(doe, "#state"), 10, "the release")
        wait_for(lambda: "released by doe" in text(roe, "#state"), 10, "the release in the other browser")
        expect(not doe.find_element(By.ID, "release").is_enabled(), "a released session could be released again")
        audit = (results / "audit.jsonl").read_text()
        for event in ("viewed", "released"):
            expect(f'"event":"{event}"' in audit and '"by":"doe"' in audit, f"the audit log does not tell of {event}")

        poe = browser_of("poe", address)
        decide_and_register_by_hand(doe, poe, address, results)
        poe.quit()
        released = doe.current_url
        bring_study(3, minutes_between=65)
        choose_views_an_hour_apart(doe, address, results)
        doe.get(released)
        wait_for(lambda: (doe.find_element(By.ID, "pdf").get_attribute("href") or "").startswith("blob:"), 10, "the report in the page")
        roe.get(address)
        wait_for(lambda: "4 with a result" in text(roe, "#count"), 10, "all sessions")

        watch.kill()
        watch.wait()
        wait_for(lambda: "no sign of life" in text(roe, "#heartbeat"), 30, "the red heartbeat")
        serve.send_signal(signal.SIGSTOP)  # its connections stay open, and nothing comes any more
        wait_for(lambda: "no connection" in text(roe, "#heartbeat"), 30, "the heartbeat of a server that stands still")
        serve.kill()
        serve.wait()
        wait_for(lambda: "no connection" in text(roe, "#heartbeat"), 20, "the heartbeat of a lost server")
        look_without_a_server(doe, roe, work)
        for browser in (doe, roe):
            seen = [one for one in problems(browser) if "ERR_CONNECTION_REFUSED" not in one and "api/" not in one
                    and "frame-ancestors" not in one and "chrome-error" not in one]  # of the frame that was led astray
            expect(not seen, f"the browser complains: {seen}")
    finally:
        for process in (watch, serve):
            process.kill()
            process.wait()
        for browser in (doe, roe):
            if browser:
                browser.quit()


if __name__ == "__main__":
    main(sys.argv[1], pathlib.Path(sys.argv[2]))
