"""Opens report.html in headless Chromium, moves the slider and the switches by keyboard, and looks at what is drawn.

html_report_in_browser.py REPORT.html [SCREENSHOT.png]"""
import sys

from selenium.webdriver.common.by import By
from selenium.webdriver.common.keys import Keys
from selenium.webdriver.support.ui import WebDriverWait

from browser import open_page, problems

browser = open_page(sys.argv[1], 1200, 1600)
try:
    WebDriverWait(browser, 20).until(lambda b: b.find_elements(By.CSS_SELECTOR, "figure canvas[data-state]"))
    canvas = browser.find_element(By.CSS_SELECTOR, "figure canvas")

    def state():
        return canvas.get_attribute("data-state")

    def pixels():
        return browser.execute_script(
            "const c = arguments[0]; return Array.from(c.getContext('2d').getImageData(0, 0, c.width, c.height).data)"
            ".reduce((sum, value, n) => (sum + value * (n % 997)) % 1e9, 0)", canvas)

    def press(element, *keys):
        element.send_keys(*keys)
        return state(), pixels()

    assert state() == "wipe found 50", state()
    first = pixels()
    slider = browser.find_element(By.CSS_SELECTOR, "figure input[type=range]")
    words, slid = press(slider, Keys.ARROW_RIGHT, Keys.ARROW_RIGHT)
    assert words == "wipe found 52" and slid != first, words
    assert press(slider, Keys.HOME)[0] == "wipe found 0"
    assert press(slider, Keys.END)[0] == "wipe found 100"
    modes = browser.find_elements(By.CSS_SELECTOR, "figure input[name^=mode]")
    words, both = press(modes[0], Keys.ARROW_RIGHT)
    assert words.startswith("both found"), words
    assert not slider.is_displayed()
    words, difference = press(modes[1], Keys.ARROW_RIGHT)
    assert words.startswith("difference found") and difference != both, words
    patient = browser.find_elements(By.CSS_SELECTOR, "figure input[name^=patient]")
    words, _ = press(patient[1], Keys.ARROW_LEFT)
    assert words.startswith("difference planned"), words
    marks = browser.find_element(By.CSS_SELECTOR, "figure input[name=marks]")
    marked = pixels()
    assert press(marks, Keys.SPACE)[1] != marked
    if len(sys.argv) > 2:
        browser.save_screenshot(sys.argv[2])
    found = problems(browser)
    assert not found, found
finally:
    browser.quit()
