# Copyright the Sheaf authors.
# SPDX-License-Identifier: Apache-2.0
"""Mouse clicks on every button that other checks use by keyboard or not at all. For page_test.py.
"""
import time

from farm import wait_until
from viewer_checks import FOCUS, HIDDEN, PIXELS, PRESSED, TEXT, wait_for_zoom, zoom_percent

CHANGE_SECONDS_MAX = 20
ENTER = "\ue007"
THEME = "return document.documentElement.dataset.theme"
ROW_NAME = "return document.querySelectorAll('#jobs .vlist-row .job-title')[1].textContent"
SHOWN = "return document.querySelector(arguments[0]).getClientRects().length > 0"
MORE_FRAMES = 1050
MISSING_JOB = "jobs/777777"
# Longer than the page's intervals for polling and for reading the counters.
MET_AGAIN_SECONDS = 4


def check_clicks(browser):
    """Runs over made-up jobs, with a shown job that has ended."""
    before = browser.run(THEME)
    browser.click("theme")
    wait_until(lambda: browser.run(THEME) != before, CHANGE_SECONDS_MAX, "another appearance")
    browser.click("theme")
    wait_until(lambda: browser.run(THEME) == before, CHANGE_SECONDS_MAX, "the first appearance")
    browser.run("localStorage.clear()")  # Later checks use the system's theme again.
    fitted = zoom_percent(browser)
    browser.click("zoom-in")
    wait_until(lambda: zoom_percent(browser) > fitted, CHANGE_SECONDS_MAX, "zooming in")
    nearer = zoom_percent(browser)
    browser.click("zoom-out")
    wait_until(lambda: zoom_percent(browser) < nearer, CHANGE_SECONDS_MAX, "zooming out")
    browser.click("image-zoom")
    wait_for_zoom(browser, 100)
    browser.click("zoom-fit")
    wait_for_zoom(browser, fitted)
    assert browser.run(PRESSED, "zoom-fit")
    browser.run("document.querySelector('.skip').focus()")
    browser.press(ENTER)
    wait_until(lambda: browser.run("return document.activeElement.id") == "details",
               CHANGE_SECONDS_MAX, "the skip link")
    name = browser.run(ROW_NAME)
    browser.click_at(*browser.run("""
      const box = document.querySelectorAll("#jobs .vlist-row")[1].getBoundingClientRect();
      return [box.left + box.width / 2, box.top + box.height / 2];"""))
    wait_until(lambda: browser.run(TEXT, "job-title") == name, CHANGE_SECONDS_MAX,
               "a job by the mouse")


def check_more_frames(browser, url):
    """Runs against a server whose job has MORE_FRAMES frames."""
    browser.open("about:blank")
    browser.open(url)
    wait_until(lambda: not browser.run(HIDDEN, "frames-more"), CHANGE_SECONDS_MAX, "the button")
    assert browser.run(TEXT, "frames-count").endswith("of the first 1000")
    # The image is above the button and moves it when it arrives.
    wait_until(lambda: browser.run(PIXELS), CHANGE_SECONDS_MAX, "the image")
    browser.run("document.getElementById('frames-more').scrollIntoView()")
    browser.click("frames-more")
    wait_until(lambda: browser.run(TEXT, "frames-count").endswith(f"of {MORE_FRAMES} complete"),
               CHANGE_SECONDS_MAX, "all frames")
    assert browser.run(HIDDEN, "frames-more")


def is_of_missing_job(error):
    """Requests in flight may fail after check_unknown_job has left the address."""
    return f"{MISSING_JOB}?" in error and "404" in error


def check_unknown_job(browser, job_count):
    """An address of a job that the farm does not have shows none and says so; the next one is
    shown.
    """
    browser.run("location.hash = arguments[0]", MISSING_JOB)
    wait_until(lambda: f"no job {MISSING_JOB}" in browser.run(TEXT, "details-empty"),
               CHANGE_SECONDS_MAX, "words on the missing job")
    for part in (".details-head", "#viewer", "#facts"):
        assert not browser.run(SHOWN, part), f"{part} of another job is shown"
    errors = browser.console_errors()
    # The page asks again whenever it reconnects.
    assert errors and all(is_of_missing_job(error) for error in errors), errors
    browser.run("location.hash = 'jobs/' + arguments[0]", job_count)
    wait_until(lambda: browser.run(SHOWN, ".details-head"), CHANGE_SECONDS_MAX, "the next job")


def wait_for_problems(browser):
    """The coordinator is away: the page says so once, however many requests fail."""
    wait_until(lambda: browser.run(TEXT, "problems-text") ==
               "The coordinator does not answer; trying again.", CHANGE_SECONDS_MAX, "problems")
    assert not browser.run(HIDDEN, "problems")


def check_dismissed(browser):
    """While the coordinator is away, dismissed problems stay hidden, however often they recur."""
    wait_for_problems(browser)
    browser.run(FOCUS, "problems-dismiss")
    browser.press(ENTER)
    wait_until(lambda: browser.run(HIDDEN, "problems"), CHANGE_SECONDS_MAX, "its end")
    time.sleep(MET_AGAIN_SECONDS)
    assert browser.run(HIDDEN, "problems"), browser.run(TEXT, "problems-text")
