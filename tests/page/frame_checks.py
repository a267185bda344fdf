# Copyright the Sheaf authors.
# SPDX-License-Identifier: Apache-2.0
"""The grid of frames: for a real range, and for a thousand frames. For page_test.py."""
import os

from farm import ROOT, wait_until
from load_checks import FRAME_MS_MAX, SCROLL_ALL, TASK_MS_MAX, check_is_quick, worst_ms
from viewer_checks import FOCUS, TEXT

CHANGE_SECONDS_MAX = 60
FRAME_COUNT = 5
MANY_FRAMES = 1000
CELL_COUNT_MAX = 150
END, ARROW_LEFT = "\ue010", "\ue012"
HASH = "return location.hash"
# The title of each cell, and whether its image is loaded.
CELLS = """
  return [...document.querySelectorAll("#frames .vlist-row")].map((cell) => {
    const image = cell.querySelector("img");
    return [cell.title, !image.hidden && image.naturalWidth > 1];
  });
"""
CLICK_SECOND = "document.querySelectorAll('#frames .vlist-row')[1].click()"


def check_frame_grid(browser, farm):
    """Every frame of a range gets its image; keys and mouse select frames."""
    scene = os.path.join(ROOT, "scenes", "turntable", "turntable.####.pbrt")
    farm.sheaf("submit", scene, "--frames", f"1-{FRAME_COUNT}", "--samples", 4)
    done = f"{FRAME_COUNT} of {FRAME_COUNT} complete"
    wait_until(lambda: browser.run(TEXT, "frames-count") == done, CHANGE_SECONDS_MAX, done)
    wait_until(lambda: all(shown for _, shown in browser.run(CELLS)), CHANGE_SECONDS_MAX,
               "an image of every frame")
    assert [title for title, _ in browser.run(CELLS)] == [
        f"Frame {i}, complete" for i in range(1, FRAME_COUNT + 1)], browser.run(CELLS)
    browser.run(FOCUS, "frames")
    browser.press(END)
    wait_until(lambda: browser.run(HASH).endswith(f"/frames/{FRAME_COUNT}"), CHANGE_SECONDS_MAX,
               "the last frame by a key")
    browser.press(ARROW_LEFT)
    wait_until(lambda: browser.run(HASH).endswith(f"/frames/{FRAME_COUNT - 1}"),
               CHANGE_SECONDS_MAX, "the frame before it")
    browser.run(CLICK_SECOND)
    wait_until(lambda: browser.run(HASH).endswith("/frames/2"), CHANGE_SECONDS_MAX,
               "a frame by the mouse")
    # A thumbnail remains after the coordinator that made it, and its cache, are gone.
    status = browser.run("""
      return fetch(new URL(document.querySelector("#frames img").src)).then((r) => r.status);""")
    assert status == 200, status


def check_many_frames(browser, url):
    """A thousand frames: few cells in the document, no long tasks."""
    def scroll():
        browser.run(SCROLL_ALL, "frames")
        return worst_ms(browser)

    browser.open("about:blank")
    browser.open(url)
    wait_until(lambda: browser.run(TEXT, "frames-count").endswith(f"of {MANY_FRAMES} complete"),
               CHANGE_SECONDS_MAX, "the frames")
    wait_until(lambda: any(shown for _, shown in browser.run(CELLS)), CHANGE_SECONDS_MAX,
               "an image of a frame")
    cells = len(browser.run(CELLS))
    assert 0 < cells < CELL_COUNT_MAX, f"{cells} cells in the document"
    worst_ms(browser)
    check_is_quick(browser, "longest task while scrolling frames", TASK_MS_MAX, scroll)
    check_is_quick(browser, "longest wait for an image while scrolling frames", FRAME_MS_MAX,
                   lambda: browser.run(SCROLL_ALL, "frames"))
    browser.run(FOCUS, "frames")
    browser.press(END)
    wait_until(lambda: browser.run(HASH).endswith(f"/frames/{MANY_FRAMES}"), CHANGE_SECONDS_MAX,
               "the last frame")
