# Copyright the Sheaf authors.
# SPDX-License-Identifier: Apache-2.0
"""Pausing, resuming and putting first, by keys alone, over a real farm. For page_test.py."""
import json
import time

from farm import wait_until
from viewer_checks import FOCUS, HIDDEN, TEXT

CHANGE_SECONDS_MAX = 20
ARROW_UP, ENTER, TAB = "\ue013", "\ue007", "\ue004"
FOCUSED = "return document.activeElement.id"
PRIORITY = "return document.getElementById('priority').value"
# Twice the time that results on their way may take.
STILL_SECONDS = 2


def show(farm, job):
    return json.loads(farm.sheaf("show", job, "--json").stdout)


def wait_for_state(browser, state):
    wait_until(lambda: browser.run(TEXT, "job-state") == state, CHANGE_SECONDS_MAX, state)


def check_pause(browser, farm, job):
    """Nothing new is rendered while it is paused, whatever page or terminal did it."""
    browser.run(FOCUS, "pause")
    assert browser.run(TEXT, "pause") == "Pause job"
    browser.press(ENTER)
    wait_for_state(browser, "paused")
    assert browser.run(FOCUSED) == "pause", "the focus is lost"
    assert browser.run(TEXT, "pause") == "Resume job"
    assert "paused" in browser.run("return document.querySelector('#jobs .badge').textContent")
    assert show(farm, job)["state"] == "paused"
    wait_until(lambda: " 0 " in [line for line in farm.sheaf("workers").stdout.splitlines()][1],
               CHANGE_SECONDS_MAX, "the end of what was leased")
    before = show(farm, job)["progress"]
    time.sleep(STILL_SECONDS)
    after = show(farm, job)["progress"]
    assert after["sample_count_done"] == before["sample_count_done"] > 0, (before, after)
    assert after["wall_duration_seconds"] == before["wall_duration_seconds"], (before, after)
    browser.press(ENTER)
    wait_for_state(browser, "running")
    wait_until(lambda: show(farm, job)["progress"]["sample_count_done"] >
               after["sample_count_done"], CHANGE_SECONDS_MAX, "more samples")
    farm.sheaf("pause", job)
    wait_for_state(browser, "paused")
    farm.sheaf("resume", job)
    wait_for_state(browser, "running")


def check_priority(browser, farm, job):
    browser.run(FOCUS, "priority")
    assert browser.run(PRIORITY) == "0"
    browser.press(ARROW_UP)
    browser.press(ARROW_UP)
    wait_until(lambda: show(farm, job)["priority"] == 2, CHANGE_SECONDS_MAX, "a priority of 2")
    browser.press(TAB)
    assert browser.run(FOCUSED) == "pause", "the Tab key leads from the priority to the pause"
    farm.sheaf("priority", job, -4)
    wait_until(lambda: browser.run(PRIORITY) == "-4", CHANGE_SECONDS_MAX, "the terminal's priority")
    browser.run("const p = document.getElementById('priority'); p.value = 5000;"
                "p.dispatchEvent(new Event('change'))")
    time.sleep(0.5)
    assert show(farm, job)["priority"] == -4, "a priority out of range was taken"
    assert browser.run(HIDDEN, "problems"), "a refused priority is no problem of the page"


def check_control(browser, farm, job):
    """The job must be running and selected."""
    check_pause(browser, farm, job)
    check_priority(browser, farm, job)
