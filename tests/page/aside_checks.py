# Copyright the Sheaf authors.
# SPDX-License-Identifier: Apache-2.0
"""The page's view of work that is set aside, and its buttons, on a real farm. For page_test.py.
"""
import json
import os

from farm import ROOT, wait_until
from viewer_checks import HIDDEN, TEXT

CHANGE_SECONDS_MAX = 20
CRASH_SECONDS_MAX = 60
# One task a frame, which no worker finishes within a second.
ENDLESS = ("--frames", "1-2", "--crop", "0,0,32,32", "--tile-size", "32", "--samples", 1 << 20,
           "--pass-samples", 1 << 20, "--lease-passes", "1")
ASIDE = "return document.getElementById('aside').innerText"
COMMANDS = "return [...document.querySelectorAll('#aside input')].map((field) => field.value)"
PRESS = """
  const button = [...document.querySelectorAll("#aside button")].find(
      (candidate) => candidate.textContent === arguments[0]);
  button.click();"""
DIALOG_IS_OPEN = "return document.getElementById('confirm').open"


def counter(farm, name):
    return farm.metrics()[name]


def check_set_aside(browser, farm, screenshot):
    """A frame whose task crashes, its commands, and the buttons that give up and try again.

    Ends the farm's workers. Requires: one failing worker suffices (--poison-workers 1).
    """
    for worker in list(farm.workers):
        worker.terminate()  # Not killed: it says goodbye.
        worker.wait()
        farm.workers.remove(worker)
    scene = os.path.join(ROOT, "scenes", "turntable", "turntable.####.pbrt")
    done = farm.sheaf("submit", scene, *ENDLESS, "--json")
    job = json.loads(done.stdout.splitlines()[-1])["name"]
    browser.run("location.hash = arguments[0]", job)
    worker = farm.start_worker("--task-seconds-max", "1")
    wait_until(lambda: all(f"Frame {number}" in browser.run(ASIDE) for number in (1, 2)),
               CRASH_SECONDS_MAX, "both frames set aside")
    farm.kill(worker)
    farm.sheaf("retry", job, "--frame", 2)  # It waits for a worker.
    wait_until(lambda: "Frame 2" not in browser.run(ASIDE), CHANGE_SECONDS_MAX, "frame 2 waits")
    text = browser.run(ASIDE)
    for words in ("Task 0", "internal", "did not finish within 1s", "Retry task", "Retry frame"):
        assert words in text, text
    assert f"sheaf bundle {job} --frame 1 --task 0" in browser.run(COMMANDS), text
    screenshot("page-aside.png")
    give_up(browser, job)
    failed = browser.run(TEXT, "job-message")
    assert "2 of 2 frames are incomplete, such as frame 1: 1 task is set aside" in failed, failed
    screenshot("page-aside-failed.png")
    before = counter(farm, "sheaf_tasks_retried_total")
    browser.run(PRESS, "Retry task")
    wait_until(lambda: browser.run(TEXT, "job-state") in ("queued", "running"), CHANGE_SECONDS_MAX,
               "the job continues")
    assert counter(farm, "sheaf_tasks_retried_total") == before + 1
    # Only the task is tried again. The answer to the button may come before the event of a frame.
    wait_until(lambda: "Frame 1" not in browser.run(ASIDE) and "Frame 2" in browser.run(ASIDE),
               CHANGE_SECONDS_MAX, "frame 2 alone set aside")
    browser.click("retry")
    wait_until(lambda: browser.run(HIDDEN, "aside-section"), CHANGE_SECONDS_MAX, "nothing aside")
    # The button also follows the job, whose event comes after those of its frames.
    wait_until(lambda: browser.run(HIDDEN, "retry"), CHANGE_SECONDS_MAX, "nothing to retry")


def give_up(browser, job):
    """The button of the other frame asks before it acts."""
    browser.run("location.hash = arguments[0]", job + "/frames/2")
    wait_until(lambda: not browser.run(HIDDEN, "kill-frame"), CHANGE_SECONDS_MAX, "the button")
    browser.click("kill-frame")
    wait_until(lambda: browser.run(DIALOG_IS_OPEN), CHANGE_SECONDS_MAX, "the question")
    assert browser.run(TEXT, "confirm-title") == "Give up frame 2?"
    browser.click("confirm-yes")
    wait_until(lambda: browser.run(TEXT, "job-state") == "failed", CHANGE_SECONDS_MAX, "the end")
