# Copyright the Sheaf authors.
# SPDX-License-Identifier: Apache-2.0
"""Pause, resume, priority and refinement by keyboard, on a real farm. For page_test.py."""
import json
import os
import re
import time

from farm import ROOT, wait_until
from viewer_checks import FOCUS, HIDDEN, TEXT

CHANGE_SECONDS_MAX = 20
ARROW_UP, ENTER, ESCAPE, TAB = "\ue013", "\ue007", "\ue00c", "\ue004"
ARROW_RIGHT, END = "\ue014", "\ue010"
JOB_SECONDS_MAX = 120
# A generous limit for fetching and drawing the price.
PRICE_SECONDS_MAX = 5
IS_ASKED = "return document.getElementById('refine-dialog').open"
FOCUSED = "return document.activeElement.id"
PRIORITY = "return document.getElementById('priority').value"
# Twice the time that results in transit may take.
STILL_SECONDS = 2


def show(farm, job):
    return json.loads(farm.sheaf("show", job, "--json").stdout)


def wait_for_state(browser, state):
    wait_until(lambda: browser.run(TEXT, "job-state") == state, CHANGE_SECONDS_MAX, state)


def check_pause(browser, farm, job):
    """Nothing new is rendered while the job is paused, by the page or in the terminal."""
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
    """Requires: the job is running and selected."""
    check_pause(browser, farm, job)
    check_priority(browser, farm, job)


def price_words(browser):
    """The error, processor time and wall time that the dialog shows."""
    return [browser.run(TEXT, f"refine-{name}") for name in ("error", "cpu", "wall")]


def wait_for_price(browser, before):
    def other():
        now = price_words(browser)
        return now if now != before and "(" in now[1] and "(" in now[2] else None
    return wait_until(other, PRICE_SECONDS_MAX, "a price")


def seconds_of(words):
    """Converts "1 min 05 s (...)" to seconds; the band in parentheses is ignored."""
    units = {"s": 1, "min": 60, "h": 3600, "d": 86400}
    parts = re.findall(r"([\d.]+) (s|min|h|d)\b", words.split("(")[0])
    assert parts, words
    return sum(float(value) * units[unit] for value, unit in parts)


def ask_for_refinement(browser):
    browser.run(FOCUS, "refine")
    browser.press(ENTER)
    wait_until(lambda: browser.run(IS_ASKED), CHANGE_SECONDS_MAX, "the question")
    assert browser.run(FOCUSED) == "refine-target", "the slider has no focus"


def check_refine(browser, farm, screenshot):
    """The slider shows the cost of each error; the confirmed error is rendered."""
    job = farm.sheaf("submit", os.path.join(ROOT, "scenes", "cornell-box.pbrt"), "--crop",
                     "60,60,188,156", "--samples", 32, "--measure", 1).stdout.strip()
    farm.sheaf("watch", job, seconds=JOB_SECONDS_MAX)
    browser.run("location.hash = arguments[0]", job)
    wait_until(lambda: not browser.run(HIDDEN, "refine") and
               browser.run("return location.hash") == "#" + job, CHANGE_SECONDS_MAX, "the button")
    ask_for_refinement(browser)
    begin = time.monotonic()
    first = wait_for_price(browser, [])
    print(f"  a price is there {time.monotonic() - begin:.2f} s after the question")
    browser.press(ARROW_RIGHT)
    for _ in range(9):
        browser.press(ARROW_RIGHT)
    dearer = wait_for_price(browser, first)
    assert seconds_of(dearer[1]) > seconds_of(first[1]), (first, dearer)
    screenshot("page-refine.png")
    browser.press(END)
    dearest = wait_for_price(browser, dearer)
    assert seconds_of(dearest[1]) > 4 * seconds_of(dearer[1]), (dearer, dearest)
    browser.press(ESCAPE)
    wait_until(lambda: not browser.run(IS_ASKED), CHANGE_SECONDS_MAX, "no by Escape")
    assert show(farm, job)["state"] == "succeeded", "a job was refined by a no"
    ask_for_refinement(browser)
    browser.click("refine-no")
    wait_until(lambda: not browser.run(IS_ASKED), CHANGE_SECONDS_MAX, "no by the button")
    assert show(farm, job)["state"] == "succeeded"
    # Half the error of a pixel.
    ask_for_refinement(browser)
    words = wait_for_price(browser, [])
    said = seconds_of(words[1])
    target = float(re.search(r"relMSE ([\d.]+e\u2212\d+)", words[0])[1].replace("\u2212", "-"))
    before = show(farm, job)["progress"]
    assert 0.2 < target / before["relative_mse"] < 0.3, (words, before)
    browser.run(FOCUS, "refine-yes")
    browser.press(ENTER)
    wait_until(lambda: show(farm, job)["progress"]["sample_count_done"] >
               before["sample_count_done"] and show(farm, job)["state"] == "succeeded",
               JOB_SECONDS_MAX, "the refined image")
    wait_for_state(browser, "succeeded")
    after = show(farm, job)["progress"]
    assert after["relative_mse"] <= target * 1.01, (after, target)
    spent = after["cpu_duration_seconds"] - before["cpu_duration_seconds"]
    print(f"  refined from relMSE {before['relative_mse']:.1e} to {after['relative_mse']:.1e}: "
          f"{said:.1f} s said, {spent:.1f} s taken")
    # A displayed price has one decimal.
    assert said < 2 * spent + 0.1 and spent < 2 * said + 0.1, (said, spent)
    wait_until(lambda: after["relative_mse"] == browser.run("""
      return fetch("/api/v1/" + location.hash.slice(1)).then((r) => r.json())
        .then((job) => job.progress.relative_mse);"""), CHANGE_SECONDS_MAX, "the new error")


def check_effects(browser, farm):
    """The refined job's effects were measured and have bars; another job explains how to get them.
    """
    wait_until(lambda: not browser.run(HIDDEN, "effects"), CHANGE_SECONDS_MAX, "the bars")
    rows = browser.run("""
      return [...document.querySelectorAll("#effects .effect")].map((row) => [
        row.children[0].textContent, row.children[2].textContent,
        row.querySelector(".effect-fill").getBoundingClientRect().width]);""")
    [indirect] = [row for row in rows if row[0] == "indirect light"]
    assert indirect[2] > 5, rows
    assert re.match(r"[\d.]+ ± [\d.]+ % of the time; [\d.]+ ± [\d.]+ % of the light; variance × ",
                    indirect[1]), indirect
    browser.run("location.hash = 'jobs/1'")
    wait_until(lambda: browser.run(HIDDEN, "effects"), CHANGE_SECONDS_MAX, "no bars")
    assert "sheaf submit SCENE --measure" in browser.run(TEXT, "effects-empty")
    assert not browser.run(HIDDEN, "effects-empty")
