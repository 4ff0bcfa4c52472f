"""Headless Chromium for the tests of pages, where it is installed."""

import shutil
import time

import pytest
from selenium import webdriver

#: With these switches Chromium fetches nothing but the page itself.
_SWITCHES = ["--headless=new", "--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run"]
_SWITCHES += ["--disable-background-networking", "--disable-component-update", "--disable-sync"]
_SWITCHES += ["--window-size=1400,900", "--disable-dev-shm-usage"]


@pytest.fixture(scope="module")
def browser(tmp_path_factory):
    """Start a browser that saves downloads in `browser.downloads`; skip the test without one."""
    paths = [shutil.which(name) for name in ("chromium", "chromedriver")]
    if None in paths:
        pytest.skip("chromium and chromedriver are not installed")
    downloads = tmp_path_factory.mktemp("downloads")
    options = webdriver.ChromeOptions()
    options.binary_location = paths[0]
    for switch in [*_SWITCHES, f"--user-data-dir={tmp_path_factory.mktemp('profile')}"]:
        options.add_argument(switch)
    options.add_experimental_option("prefs", {"download.default_directory": str(downloads)})
    options.set_capability("goog:loggingPrefs", {"browser": "ALL"})
    driver = webdriver.Chrome(options=options, service=webdriver.ChromeService(paths[1]))
    driver.downloads = downloads
    yield driver
    driver.quit()


def console_errors(driver):
    """Return the error messages in the browser console since the last call."""
    return [entry["message"] for entry in driver.get_log("browser") if entry["level"] == "SEVERE"]


#: Collects the elements that match a selector, the argument of the script, also in shadow roots.
_SEARCH = """
    const found = [];
    const search = root => {
        found.push(...root.querySelectorAll(arguments[0]));
        root.querySelectorAll("*").forEach(e => e.shadowRoot && search(e.shadowRoot));
    };
    search(document);
"""


def find_elements_in_shadow_roots(driver, selector):
    """Return the elements that match a CSS selector in the document and all shadow roots."""
    return driver.execute_script(_SEARCH + "return found;", selector)


def visible_texts(driver, selector):
    """Return the texts of all visible elements that match a CSS selector."""
    visible = "return found.filter(e => e.checkVisibility()).map(e => e.innerText);"
    return driver.execute_script(_SEARCH + visible, selector)


def wait_for(condition, seconds=300.0):
    """Call a function until it returns a true value, and return this value."""
    deadline = time.monotonic() + seconds
    while time.monotonic() < deadline:
        if result := condition():
            return result
        time.sleep(0.2)
    raise TimeoutError(f"the condition did not become true within {seconds} s")
