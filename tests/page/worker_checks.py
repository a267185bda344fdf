# Copyright the Sheaf authors.
# SPDX-License-Identifier: Apache-2.0
"""The workers' present tasks, and failed leases, on a real farm. For page_test.py."""
import os
import re
import shlex
import subprocess

from farm import ROOT, programs, wait_until
from viewer_checks import HIDDEN, TEXT

CHANGE_SECONDS_MAX = 20
ENTER = "\ue007"
ROWS = "return [...document.querySelectorAll('#workers .vlist-row')].map((row) => row.textContent)"
TITLES = "return [...document.querySelectorAll('#workers .vlist-row')].map((row) => row.title)"
FAILURES = "return [...document.querySelectorAll('#failures li')].map((item) => item.textContent)"
COMMANDS = "return [...document.querySelectorAll('#failures input')].map((i) => i.value)"
# All failures: one that arrives meanwhile comes before the one whose button was pressed.
COPIES = "return [...document.querySelectorAll('#failures button')].map((b) => b.textContent)"


def check_workers(browser):
    """Runs while one worker of one thread renders a job of the Cornell box."""
    def row():
        return re.search(r"busy.*(rendering|loading|uploading) cornell-box\.pbrt, "
                         r"frame 1 at \d+, \d+.*seen .*[\d.]+ [kM]/s · 1 thread · "
                         r"[\d\u2009]+ results1 scene, [\d.]+ [kMG]?B", browser.run(ROWS)[0])
    wait_until(row, CHANGE_SECONDS_MAX, "what the worker does")
    assert "cornell-box.pbrt" in browser.run(TITLES)[0], browser.run(TITLES)


def check_drain(browser):
    """The worker is drained in the table of workers, and gets work again."""
    browser.run("location.hash = '/workers'")
    rows = ROWS.replace("#workers ", "#workers-table ")
    wait_until(lambda: browser.run(rows), CHANGE_SECONDS_MAX, "the table")
    assert re.match(r"1 worker: 1 busy · 1 thread · ", browser.run(TEXT, "worker-totals"))
    browser.run("document.querySelector('#workers-table .cell-tick').click()")
    for button, state in (("worker-drain", "draining"), ("worker-undrain", "busy")):
        browser.run("document.getElementById(arguments[0]).click()", button)
        wait_until(lambda: state in browser.run(rows)[0], CHANGE_SECONDS_MAX, state)
    browser.run("location.hash = ''")


def check_failures(browser, farm, folder):
    """A worker without memory for the scene fails; the commands on the page fetch its task, in any
    folder, and render its tile.
    """
    assert browser.run(HIDDEN, "failures-section"), "failures of a job that has none"
    poor = farm.start_worker("--scene-memory-max", "1K")
    wait_until(lambda: browser.run(FAILURES), CHANGE_SECONDS_MAX, "a failure on the page")
    farm.kill(poor)
    text = browser.run(FAILURES)[0]
    assert "(--scene-memory-max 1 KiB)" in text and "frame 1, tile at" in text, text
    browser.run("document.querySelector('#failures button').focus()")
    browser.press(ENTER)
    wait_until(lambda: {"Copied", "Press Ctrl+C"} & set(browser.run(COPIES)), CHANGE_SECONDS_MAX,
               "the answer of the button")
    anywhere, beside_scene = browser.run(COMMANDS)[:2]
    words = shlex.split(anywhere.split("&&")[0])
    assert words[:3] == ["sheaf", "bundle", "jobs/2"] and words[-2] == "-o", words
    bundle = os.path.join(folder, words[-1])
    farm.sheaf(*words[1:-1], bundle)
    assert os.path.getsize(bundle) > 0
    words = shlex.split(beside_scene)
    assert words[:3] == ["sheaf", "render", "cornell-box.pbrt"], words
    output = os.path.join(folder, "tile.exr")
    command = [os.path.join(programs(), "sheaf"), *words[1:], "-o", output]
    done = subprocess.run(command, cwd=os.path.join(ROOT, "scenes"), capture_output=True, text=True)
    assert done.returncode == 0 and os.path.getsize(output) > 0, done.stderr
