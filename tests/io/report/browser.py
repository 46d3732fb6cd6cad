"""A headless Chromium of a test's own."""
import pathlib
import tempfile

from selenium import webdriver
from selenium.webdriver.chrome.service import Service


def new_browser(width, height):
    # Removed with the browser's object, at the latest when the test ends.
    profile = tempfile.TemporaryDirectory(prefix="isoshift-browser-", ignore_cleanup_errors=True)
    options = webdriver.ChromeOptions()
    options.binary_location = "/usr/bin/chromium"
    for argument in ("--headless=new", "--no-sandbox", "--disable-gpu", "--disable-dev-shm-usage", f"--window-size={width},{height}",
                     "--user-data-dir=" + profile.name):
        options.add_argument(argument)
    options.set_capability("goog:loggingPrefs", {"browser": "ALL"})
    browser = webdriver.Chrome(service=Service("/usr/bin/chromedriver"), options=options)
    browser.profile = profile
    return browser


def open_page(file, width, height):
    browser = new_browser(width, height)
    browser.get(pathlib.Path(file).resolve().as_uri())
    return browser


def problems(browser):
    return [entry["message"] for entry in browser.get_log("browser") if entry["level"] in ("SEVERE", "WARNING")]
