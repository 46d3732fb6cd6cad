"""Opens index.html of a batch in headless Chromium, sorts and filters it.

results_page_in_browser.py INDEX.html"""
import sys

from selenium.webdriver.common.by import By
from selenium.webdriver.common.keys import Keys

from browser import open_page, problems

browser = open_page(sys.argv[1], 1400, 900)
try:
    def shown():
        return [row for row in browser.find_elements(By.CSS_SELECTOR, "tbody tr") if row.is_displayed()]

    def column(number):
        return [float(row.find_elements(By.TAG_NAME, "td")[number].text) for row in shown() if row.get_attribute("class") != "failed"]

    count = len(shown())
    assert browser.find_element(By.ID, "count").text == f"{count} of {count}"
    head = browser.find_elements(By.CSS_SELECTOR, "th button")[5]
    assert head.text.startswith("x"), head.text
    head.send_keys(Keys.ENTER)
    assert column(5) == sorted(column(5)), column(5)
    head.send_keys(Keys.ENTER)
    assert column(5) == sorted(column(5), reverse=True), column(5)
    browser.find_element(By.ID, "text").send_keys("phantom2")
    assert 0 < len(shown()) < count and all("PHANTOM2" in row.text for row in shown())
    browser.find_element(By.ID, "text").clear()
    browser.find_element(By.ID, "text").send_keys("nobody")
    assert not shown() and browser.find_element(By.ID, "count").text == f"0 of {count}"
    browser.find_element(By.ID, "text").send_keys(Keys.CONTROL, "a")
    browser.find_element(By.ID, "text").send_keys(Keys.DELETE)
    link = shown()[0].find_element(By.TAG_NAME, "a")
    link.click()
    assert browser.title, "the report did not open"
    found = problems(browser)
    assert not found, found
finally:
    browser.quit()
