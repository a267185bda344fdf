# Copyright the Sheaf authors.
# SPDX-License-Identifier: Apache-2.0
"""Delay and rate at which the page shows a large image while it is rendered. For page_test.py."""
import json
import os
import re
import time
from urllib.request import urlopen

from farm import ROOT, wait_until
from load_checks import TAKE_LONG_TASKS, busy_factor
from viewer_checks import TEXT

SIZE_PX = (3840, 2160)
# From the arrival of the first part at the coordinator to its image on the screen.
FIRST_SECONDS_MAX = 1.0
UPDATES_PER_SECOND_MIN = 2.0
WATCH_SECONDS = 8
JOB_SECONDS_MAX = 60
# Other programs on the machine can spoil single measurements.
ATTEMPT_COUNT_MAX = 3
# Records the wall-clock time when each new image is drawn in the viewer.
NOTE_IMAGES = """
  window.imageTimes = [];
  const seen = new WeakSet();
  const draw = CanvasRenderingContext2D.prototype.drawImage;
  CanvasRenderingContext2D.prototype.drawImage = function(image, ...rest) {
    if (this.canvas.id === "image" && !seen.has(image)) {
      seen.add(image);
      window.imageTimes.push(Date.now() / 1000);
    }
    return draw.call(this, image, ...rest);
  };
"""
IMAGE_TIMES = "return window.imageTimes"


def large_scene(farm):
    """The Cornell box as a large image."""
    with open(os.path.join(ROOT, "scenes", "cornell-box.pbrt"), encoding="utf-8") as file:
        text = file.read()
    for axis, size_px in zip("xy", SIZE_PX):
        text, count = re.subn(rf'("integer {axis}resolution" \[?) *\d+', rf"\g<1> {size_px}", text)
        assert count == 1, "the scene does not say its size"
    path = os.path.join(farm.folder, "large.pbrt")
    with open(path, "w", encoding="utf-8") as file:
        file.write(text)
    return path


def first_part_time(farm, job):
    """The time when the coordinator has the first samples of the job's frame."""
    def landed():
        with urlopen(f"http://{farm.http}/api/v1/{job}/frames/1", timeout=100) as response:
            return json.load(response)["progress"]["sample_count_done"] > 0
    wait_until(landed, JOB_SECONDS_MAX, "a first part")
    return time.time()


def measure(browser, farm):
    """Seconds until the first image, and images per second after it."""
    browser.open("about:blank")
    browser.open(f"http://{farm.http}/")
    wait_until(lambda: browser.run(TEXT, "connection-text") == "Live", JOB_SECONDS_MAX, "events")
    job = farm.sheaf("submit", large_scene(farm), "--samples", 64).stdout.strip()
    try:
        landed = first_part_time(farm, job)
        # The previous job may be shown until then: its image does not count.
        times = wait_until(lambda: [t for t in browser.run(IMAGE_TIMES) if t > landed - 0.05],
                           JOB_SECONDS_MAX, "an image")
        browser.run(TAKE_LONG_TASKS)
        time.sleep(WATCH_SECONDS)
        later = [t for t in browser.run(IMAGE_TIMES) if times[0] < t <= times[0] + WATCH_SECONDS]
        longest_ms = max(browser.run(TAKE_LONG_TASKS), default=0)
    finally:
        farm.sheaf("cancel", job)
    return times[0] - landed, len(later) / WATCH_SECONDS, longest_ms


def check_large_image(browser, farm):
    """The best of some attempts meets the limits if the machine is otherwise idle."""
    texts = []
    for _ in range(ATTEMPT_COUNT_MAX):
        busy = busy_factor(browser)
        first, rate, longest_ms = measure(browser, farm)
        busy = max(busy, busy_factor(browser))
        texts.append(f"first image {first:.2f} s after the first part, {rate:.1f} images a "
                     f"second, longest task {longest_ms:.0f} ms (busy {busy:.1f})")
        if first <= FIRST_SECONDS_MAX * busy and rate >= UPDATES_PER_SECOND_MIN / busy:
            print("  3840 x 2160: " + "; ".join(texts))
            return
    raise AssertionError("; ".join(texts) + f"; {FIRST_SECONDS_MAX} s and "
                         f"{UPDATES_PER_SECOND_MIN} a second are allowed")
