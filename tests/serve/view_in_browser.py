"""isoshift view in Chromium: a head that lies 25 mm and 12 degrees off is brought near by keys alone, and found from there.

  view_in_browser.py ISOSHIFT WORK

WORK is an empty folder. Prints what went wrong and exits with 1, or ends with 0.
"""

import json
import pathlib
import re
import subprocess
import sys
import time
import urllib.error
import urllib.request

from selenium.webdriver.common.action_chains import ActionChains
from selenium.webdriver.common.by import By
from selenium.webdriver.common.keys import Keys
from selenium.webdriver.support.ui import Select

ROOT = pathlib.Path(__file__).resolve().parents[1]
sys.path += [str(ROOT / "io/report"), str(ROOT / "workflow/room")]

from browser import new_browser, problems  # noqa: E402
from room import expect, wait_for  # noqa: E402

TRANSLATION = (15, -14, 14)  # mm
ABOUT_Z = 12  # degrees


def answer_to(address):
    try:
        return urllib.request.urlopen(address).status
    except urllib.error.HTTPError as error:
        return error.code


def open_view(program, log, *arguments):
    """isoshift view, and the address that opens it once."""
    view = subprocess.Popen([program, "view", *arguments], stdout=log.open("w"))
    wait_for(lambda: "/open/" in log.read_text(), 60, "the address")
    return view, re.search(r"http://\S+", log.read_text())[0]


def colored(browser, color):
    """How many pixels of the first view have nearly this color."""
    return browser.execute_script("""
        const canvas = document.querySelector("figure.view canvas");
        const data = canvas.getContext("2d").getImageData(0, 0, canvas.width, canvas.height).data;
        let count = 0;
        for (let at = 0; at < data.length; at += 4)
          if (arguments[0].every((value, n) => Math.abs(data[at + n] - value) < 40)) ++count;
        return count;""", color)


def main(program, work):
    study, results, log = work / "study", work / "out", work / "view.log"
    subprocess.run([program, "phantom", "-o", study, "--seed", "8", "--voxel-mm", "2", "--image-pixels", "256",
                    "--translation", *map(str, TRANSLATION), "--rotation", "0", "0", str(ABOUT_Z)],
                   check=True, capture_output=True)
    view, address = open_view(program, log, study, "-o", results, "--preset=setup")
    root = address[:address.index("/open/")]
    browser = None
    try:
        expect(answer_to(root + "/") == 403, "the page is shown to anybody")
        browser = new_browser(1280, 1024)
        browser.get(address)
        expect(answer_to(address) == 403, "the address opens twice")
        one = lambda selector: browser.find_element(By.CSS_SELECTOR, selector)
        wait_for(lambda: "rendered in" in one("#times").text, 20, "the DRRs")
        expect("Phantom" in one("#patient").text, "the patient's name: " + one("#patient").text)

        press = lambda *keys: one("body").send_keys(*keys)
        for forward, back, millimeters in ((Keys.ARROW_RIGHT, Keys.ARROW_LEFT, TRANSLATION[0]),
                                           (Keys.PAGE_UP, Keys.PAGE_DOWN, TRANSLATION[1]),
                                           (Keys.ARROW_UP, Keys.ARROW_DOWN, TRANSLATION[2])):
            for _ in range(abs(millimeters) - 2):  # a person stops near
                press(forward if millimeters > 0 else back)
        for _ in range(ABOUT_Z - 2):
            press(Keys.SHIFT + Keys.ARROW_RIGHT + Keys.NULL)
        numbers = [float(one("#" + name).get_attribute("value")) for name in ("x", "y", "z", "rz")]
        expect(numbers == [13, -12, 12, 10], f"the keys moved to {numbers}")
        shown = lambda: json.loads(one("#times").get_attribute("data-pose"))["translation_mm"]
        wait_for(lambda: [round(mm) for mm in shown()] == [13, -12, 12], 10, "the DRRs of that pose")
        wait_for(lambda: "256 x 256" in one("#times").text, 10, "the DRRs at rest")
        print(one("#times").text)
        browser.save_screenshot(str(work / "near.png"))

        one("#optimize").click()
        wait_for(lambda: not one("#optimize").is_enabled(), 10, "the registration")
        wait_for(lambda: "Found" in one("#result").text, 120, "the result")
        found = json.loads((results / "1" / "result.json").read_text())
        truth = json.loads((study / "truth.json").read_text())["setup_error_room"]
        off = max(abs(a - b) for a, b in zip(found["setup_error"]["translation_mm"], truth["translation_mm"]))
        expect(off < 0.2, f"{off} mm off")
        # Nothing but its size speaks against a rotation of 12 degrees.
        expect(found["verdict"] == "review" and len(found["reasons"]) == 1 and "more than 5 degrees" in found["reasons"][0],
               f"{found['verdict']}: {found['reasons']}")
        expect(found["start"]["set_by"] and found["searched"], "the result does not say who set its start")
        wait_for(lambda: abs(float(one("#x").get_attribute("value")) - 15) < 0.2, 10, "the pose that was found")
        browser.save_screenshot(str(work / "found.png"))

#Landmarks bring the patient near, and outlines are drawn.
        one("#as-planned").click()
        wait_for(lambda: shown() == [0, 0, 0], 10, "the DRRs as planned")
        wait_for(lambda: "256 x 256" in one("#times").text, 10, "the DRRs at rest")
        select = Select(one("#part"))
        before = colored(browser, (230, 159, 0))
        select.select_by_index(1)
        wait_for(lambda: colored(browser, (230, 159, 0)) > before + 100, 10, "the outline")
        one("#mark").click()
        views = browser.execute_async_script("fetch('/api/manual/study').then(r => r.json()).then(arguments[0])")["views"]
        for number, one_view in enumerate(views):
            still = one_view["isocenter_px"]
            moved = [at + sum(px * mm for px, mm in zip(row, truth["translation_mm"]))
                     for at, row in zip(still, one_view["px_per_mm"])]
            xray, drr = browser.find_elements(By.CSS_SELECTOR, "figure.view")[number].find_elements(By.TAG_NAME, "canvas")
            for canvas, at in ((xray, moved), (drr, still)):
                edge = canvas.size["width"]
                dx, dy = ((value + 0.5) / size * edge - edge / 2 for value, size in zip(at, one_view["sizes"][0]))
                ActionChains(browser).move_to_element_with_offset(canvas, round(dx), round(dy)).click().perform()
        browser.save_screenshot(str(work / "landmarks.png"))
        one("#fit").click()
        wait_for(lambda: max(abs(a - b) for a, b in zip(shown(), truth["translation_mm"])) < 1.5, 10,
                 f"the pose of the landmark near {truth['translation_mm']}")
        expect("Moved by 1 landmark" in one("#landmarks").text, one("#landmarks").text)
        one("#mark").click()

#Another registration can be given up, and leaves nothing; a pose can be kept as it is.
        one("#optimize").click()
        wait_for(lambda: one("#cancel").is_displayed(), 10, "the button that cancels")
        one("#cancel").click()
        wait_for(lambda: one("#keep").is_enabled(), 10, "the end of what was cancelled")
        expect([path.name for path in results.iterdir()] == ["1"], f"left behind: {list(results.iterdir())}")
        one("#keep").click()
        wait_for(lambda: "Kept" in one("#result").text, 60, "the pose that is kept")
        kept = json.loads((results / "2" / "result.json").read_text())
        expect(kept["verdict"] == "review" and not kept["searched"], f"{kept['verdict']}, searched: {kept['searched']}")
        one("#undo").click()
        wait_for(lambda: shown() == [0, 0, 0], 10, "the DRRs of the pose before")

#Only what lies in a box is compared.
        one("input[value=blend]").click()
        one("#box").click()
        canvas = browser.find_element(By.CSS_SELECTOR, "figure.view canvas")
        ActionChains(browser).move_to_element_with_offset(canvas, -100, -80).click_and_hold().move_by_offset(180, 150).release().perform()
        one("#box").click()
        browser.save_screenshot(str(work / "box.png"))
        one("#keep").click()
        wait_for(lambda: (results / "3" / "result.json").exists(), 60, "the result of the box")
        wait_for(lambda: one("#keep").is_enabled(), 10, "the page to learn of it")
        region = json.loads((results / "3" / "result.json").read_text())["region"]
        expect(len(region) == 1 and region[0].startswith("rectangle " + views[0]["label"] + "="), f"compared: {region}")

#A result is looked at again.
        view.kill()
        view.wait()
        view, address = open_view(program, log, study, "-o", results, "--start", results / "1" / "result.json")
        browser.get(address)
        wait_for(lambda: "rendered in" in one("#times").text, 20, "the DRRs of the result")
        expect(abs(shown()[0] - 15) < 0.2, f"the page begins at {shown()}")
        for mode in ("side", "wipe", "flicker", "difference", "blend"):
            one(f"input[value={mode}]").click()
            time.sleep(0.3)
            browser.save_screenshot(str(work / f"{mode}.png"))
        complaints = [one for one in problems(browser) if "willReadFrequently" not in one]  # that is this test
        expect(not complaints, f"the browser complains: {complaints}")
    finally:
        view.kill()
        view.wait()
        if browser:
            browser.quit()


if __name__ == "__main__":
    main(sys.argv[1], pathlib.Path(sys.argv[2]))
