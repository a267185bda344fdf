# Copyright the Sheaf authors.
# SPDX-License-Identifier: Apache-2.0
"""Two jobs side by side, on a real farm. For page_test.py."""
import re

from farm import wait_until
from viewer_checks import FOCUS, HIDDEN, PIXELS, TEXT, zoom_percent

CHANGE_SECONDS_MAX = 20
BESIDE = PIXELS.replace('"image"', '"beside"')
assert BESIDE != PIXELS
# Chooses an option as a user does: the list is fetched when the select gets the focus.
CHOOSE = """
  const select = document.getElementById(arguments[0]);
  select.focus();
  select.value = arguments[1];
  select.dispatchEvent(new Event("change"));
  return select.value;
"""
WIDTH = "return document.getElementById('image-box').clientWidth"
HOME = "\ue011"
ARROW_RIGHT = "\ue014"


def both(browser):
    return browser.run(PIXELS), browser.run(BESIDE)


def check_compare(browser, screenshot):
    """The shown job is delivered and has rounds; jobs/1 is another image of the Cornell box."""
    assert browser.run(HIDDEN, "beside-box")
    assert browser.run(CHOOSE, "beside-job", "jobs/1") == "jobs/1", "jobs/1 is not offered"
    wait_until(lambda: all(both(browser)), CHANGE_SECONDS_MAX, "two images")
    assert re.match(r"cornell-box\.pbrt \(jobs/1\), frame 1$", browser.run(TEXT, "beside-name"))
    fitted = both(browser)
    assert fitted[0] != fitted[1], "two jobs, one image"

    def changed(before, what):
        def differ():
            now = both(browser)
            return now if now[0] != before[0] and now[1] != before[1] else None
        return wait_until(differ, CHANGE_SECONDS_MAX, what)

    browser.run(FOCUS, "image-box")
    browser.press("1")
    zoomed = changed(fitted, "zooming both")
    browser.run(FOCUS, "beside-box")
    for _ in range(3):  # Until both are larger than their boxes.
        browser.press("+")
    browser.press(ARROW_RIGHT)
    zoomed = changed(zoomed, "zooming and panning both by the second")
    x, y = browser.middle_of("beside-box")
    browser.drag((x, y), (x + 60, y - 30))
    zoomed = changed(zoomed, "dragging both")
    browser.press("[")
    changed(zoomed, "exposing both")
    browser.press("]")
    wait_until(lambda: both(browser) == zoomed, CHANGE_SECONDS_MAX, "the exposure as it was")
    browser.press("0")
    wait_until(lambda: both(browser) == fitted, CHANGE_SECONDS_MAX, "both fitted")
    browser.run(CHOOSE, "layer", "error")
    changed(fitted, "errors of both")
    wait_until(lambda: re.search(r"frame 1 · [\d.]+ % to [\d.]+ %$",
                                 browser.run(TEXT, "beside-name")), CHANGE_SECONDS_MAX, "a range")
    screenshot("page-compare.png")
    browser.run(CHOOSE, "layer", "image")
    wait_until(lambda: both(browser) == fitted, CHANGE_SECONDS_MAX, "both images")
    # A frame of a range.
    job = browser.run("""
      return [...document.getElementById("beside-job").options].find(
        (option) => option.textContent.includes("turntable")).value;""")
    browser.run(CHOOSE, "beside-job", job)
    wait_until(lambda: not browser.run(HIDDEN, "beside-frame"), CHANGE_SECONDS_MAX, "its frames")
    browser.run(CHOOSE, "beside-frame", f"{job}/frames/3")
    wait_until(lambda: browser.run(TEXT, "beside-name").endswith("frame 3"), CHANGE_SECONDS_MAX,
               "the frame beside")
    zoom, width = zoom_percent(browser), browser.run(WIDTH)
    browser.run(CHOOSE, "beside-job", "")
    wait_until(lambda: browser.run(HIDDEN, "beside-box"), CHANGE_SECONDS_MAX, "one image")
    # The controls above may be some pixels higher or lower.
    wait_until(lambda: browser.run(WIDTH) > 1.9 * width and zoom_percent(browser) > 0.98 * zoom,
               CHANGE_SECONDS_MAX, "all the room")
    check_other_size(browser)


def check_other_size(browser):
    """The shown job is a crop, jobs/1 is larger: they have no difference, and a comparison with a
    job does not survive the change to it.
    """
    shown = browser.run("return location.hash")
    browser.run(CHOOSE, "beside-job", "jobs/1")
    wait_until(lambda: not browser.run(HIDDEN, "compare-mode"), CHANGE_SECONDS_MAX, "the modes")
    browser.run(CHOOSE, "compare-mode", "relative")
    wait_until(lambda: "differ in size" in browser.run(TEXT, "image-note"), CHANGE_SECONDS_MAX,
               "why there is no difference")
    browser.run("location.hash = 'jobs/1'")
    wait_until(lambda: browser.run("return document.getElementById('beside-job').value") == "" and
               browser.run(HIDDEN, "beside-box") and browser.run(PIXELS), CHANGE_SECONDS_MAX,
               "the image of jobs/1 alone")
    assert browser.run(HIDDEN, "problems"), browser.run(TEXT, "problems-text")
    assert "No samples" not in browser.run(TEXT, "image-note")
    browser.run("location.hash = arguments[0]", shown)
    wait_until(lambda: browser.run("return location.hash") == shown and browser.run(PIXELS),
               CHANGE_SECONDS_MAX, "the job shown before")
