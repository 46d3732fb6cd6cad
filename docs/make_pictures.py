"""The pictures of docs/make.py: functions that write PNG files into a folder."""

import base64
import os
import pathlib
import subprocess
import sys
import time

from selenium.webdriver.common.by import By
from selenium.webdriver.support.ui import Select

ROOT = pathlib.Path(__file__).resolve().parents[1]
sys.path += [str(ROOT / "tests/io/report"), str(ROOT / "tests/workflow/room"), str(ROOT / "tests/serve")]

from browser import open_page  # noqa: E402
from room import wait_for  # noqa: E402
from screen_in_browser import browser_of, open_room, text  # noqa: E402
from view_in_browser import colored, open_view  # noqa: E402

OUTLINE = (230, 159, 0)  # red, green, blue
DAYS, REJECTED = 5, 2


def take_picture(browser, file, width, height, scale=1.0):
    browser.execute_cdp_cmd("Emulation.setScrollbarsHidden", {"hidden": True})
    browser.execute_cdp_cmd("Emulation.setDeviceMetricsOverride",
                            {"width": width, "height": height, "deviceScaleFactor": scale, "mobile": False})
    time.sleep(0.5)  # the page arranges itself
    file.write_bytes(base64.b64decode(browser.execute_cdp_cmd("Page.captureScreenshot", {})["data"]))


def pictures_of_result(result, to):
    """demo-view1.png, report-pdf.png, report-html.png: of the result of the README's example."""
    (to / "demo-view1.png").write_bytes((result / "view1.png").read_bytes())
    subprocess.run(["pdftoppm", "-png", "-r", "75", "-f", "1", "-l", "1", "-singlefile", result / "report.pdf", to / "report-pdf"], check=True)
    browser = open_page(result / "report.html", 1100, 1357)
    take_picture(browser, to / "report-html.png", 1100, 1357, scale=8 / 11)
    browser.quit()


def pictures_by_hand(program, work, to):
    """serve-by-hand.png: the README's study as planned, with the outline of a bone."""
    view, address = open_view(program, work / "view.log", work / "study", "-o", work / "by-hand")
    browser = None
    try:
        browser = browser_of("doe", address)
        wait_for(lambda: "512 x 512" in text(browser, "#times"), 60, "the DRRs")
        before = colored(browser, OUTLINE)
        Select(browser.find_element(By.ID, "part")).select_by_index(1)
        wait_for(lambda: colored(browser, OUTLINE) > before + 100, 30, "the outline")
        take_picture(browser, to / "serve-by-hand.png", 1280, 880)
    finally:
        view.kill()
        view.wait()
        if browser:
            browser.quit()


def pictures_of_room(program, work, to):
    """serve-list.png, serve-trend.png: days of a patient, each decided before the next: one rejected, the last one undecided."""
    study = work / "study"
    subprocess.run([program, "phantom", "-o", study, "--seed", "3", "--fractions", str(DAYS), "--voxel-mm", "2", "--image-pixels", "128",
                    "--translation", "1.5,-1,0.8", "--rotation", "1.4,-2.1,1.8"], check=True, capture_output=True)
    days = [study / "RTIMAGE" / f"F{day:02}" for day in range(2, DAYS + 1)]
    for day in days:
        day.rename(work / day.name)
    watch, serve, address = open_room(program, work, "setup", action_levels={"default": {"translation_mm": 3, "rotation_deg": 3}})
    browser = None
    try:
        browser = browser_of("doe", address)
        done = set()
        for day in [study, *(work / day.name for day in days)]:
            day.rename(work / "in" / day.name)
            sessions = lambda: {path.parent.name for path in (work / "results" / "sessions").glob("[!.]*/result.json")}
            wait_for(lambda: sessions() - done, 60, "the result of a day")
            [session] = sessions() - done
            done.add(session)
            if len(done) == DAYS:
                break
            browser.get(f"{address}/session/{session}")
            wait_for(lambda: browser.find_element(By.ID, "release").is_enabled(), 10, "the session's page")
            decision, state = "release", "released by"
            if len(done) == REJECTED:
                browser.find_element(By.ID, "reason").send_keys("the patient coughed")
                decision, state = "rejected", "rejected by"
            browser.find_element(By.ID, decision).click()
            wait_for(lambda: state in text(browser, "#state"), 10, "the decision")
        for page, picture, height in (("", "serve-list.png", 520), (f"/session/{session}/trend", "serve-trend.png", 880)):
            browser.get(address + page)
            wait_for(lambda: "held" in text(browser, "body"), 10, "the last session")
            take_picture(browser, to / picture, 1280, height)
    finally:
        for process in (watch, serve):
            process.kill()
            process.wait()
        if browser:
            browser.quit()


def pictures_of_python(module, program, to):
    """python-*.png: what the examples of python/examples draw of testdata/head."""
    for example in sorted((ROOT / "python" / "examples").glob("*.py")):
        picture = to / f"python-{example.stem.replace('_', '-')}.png"
        subprocess.run(["/usr/bin/python3", "-B", example, ROOT / "testdata" / "head", picture], check=True, capture_output=True,
                       env=os.environ | {"PYTHONPATH": str(module), "ISOSHIFT_PROGRAM": program})
