# Copyright the Sheaf authors.
# SPDX-License-Identifier: Apache-2.0
"""The slider between rounds, for a real frame that stops at a target error. For page_test.py."""
import os
import re

from farm import ROOT, wait_until
from viewer_checks import FOCUS, HIDDEN, PIXELS, TEXT, wait_for_new_pixels
from viewer_checks import wait_for_last_image, zoom_percent

JOB_SECONDS_MAX = 120
CHANGE_SECONDS_MAX = 20
HOME, END, ARROW_RIGHT, ARROW_DOWN, ARROW_UP = "\ue011", "\ue010", "\ue014", "\ue015", "\ue013"
TARGET = "0.01"


def words(browser):
    """The selected round, its samples per pixel and its error."""
    found = re.fullmatch(r"(.*): ([\d.\u2009]+) samples per pixel, error ±([\d.]+) %",
                         browser.run(TEXT, "round-words"))
    assert found, browser.run(TEXT, "round-words")
    return found[1], float(found[2].replace("\u2009", "")), float(found[3])


def check_rounds(browser, farm):
    """Images of earlier rounds have fewer samples and more noise, in every layer, at the same
    place.
    """
    scene = os.path.join(ROOT, "scenes", "cornell-box.pbrt")
    job = farm.sheaf("submit", scene, "--crop", "40,40,200,160", "--target-error",
                     TARGET).stdout.strip()
    farm.sheaf("watch", job, seconds=JOB_SECONDS_MAX)
    browser.run("location.hash = arguments[0]", job)
    # The previously shown job has another title.
    wait_until(lambda: (browser.run(TEXT, "job-title"), browser.run(TEXT, "job-state")) ==
               ("cornell-box.pbrt", "succeeded"), CHANGE_SECONDS_MAX, "the job")
    wait_until(lambda: not browser.run(HIDDEN, "rounds"), CHANGE_SECONDS_MAX, "the slider")
    wait_until(lambda: words(browser)[0] == "Now", CHANGE_SECONDS_MAX, "the present")
    wait_for_last_image(browser)
    now, (_, samples, error), zoom = browser.run(PIXELS), words(browser), zoom_percent(browser)
    browser.run(FOCUS, "round")
    browser.press(HOME)
    first = wait_for_new_pixels(browser, now, "the first round's image")
    what, first_samples, first_error = words(browser)
    assert what.startswith("Round 1 of ") and first_samples == 16, words(browser)
    assert first_samples < samples and first_error > error, (words(browser), samples, error)
    assert zoom_percent(browser) == zoom, "the image jumps between rounds"
    # Another exposure and another layer also use the round.
    browser.run("const e = document.getElementById('exposure'); e.value = -2;"
                "e.dispatchEvent(new Event('input'))")
    darker = wait_for_new_pixels(browser, first, "the round's light")
    browser.run("document.getElementById('exposure-reset').click()")
    wait_until(lambda: browser.run(PIXELS) == first, CHANGE_SECONDS_MAX, "the round's image")
    assert darker != now
    browser.run(FOCUS, "layer")
    browser.press(ARROW_DOWN)
    wait_for_new_pixels(browser, first, "the round's errors")
    browser.press(ARROW_DOWN)
    wait_until(lambda: browser.run(TEXT, "legend-high") == "16", CHANGE_SECONDS_MAX,
               "the round's sample count")
    browser.press(ARROW_UP)
    browser.press(ARROW_UP)
    browser.run(FOCUS, "round")
    browser.press(END)
    wait_until(lambda: browser.run(PIXELS) == now, CHANGE_SECONDS_MAX, "the present again")
    assert words(browser)[0] == "Now"
