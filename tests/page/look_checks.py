# Copyright the Sheaf authors.
# SPDX-License-Identifier: Apache-2.0
"""Pixels, layers and differences in the viewer, over a made-up job that has ended.

For page_test.py.
"""
import re
import time

from compare_checks import CHOOSE
from farm import wait_until
from viewer_checks import FOCUS, HIDDEN, PIXELS, TEXT, wait_for_new_pixels

CHANGE_SECONDS_MAX = 20
SETTLE_SECONDS = 2
END = "\ue010"
VALUES = """
  return Object.fromEntries([...document.querySelectorAll("#pixel-values li")].map(
      (row) => [...row.children].map((part) => part.textContent)));
"""
MOVE = """
  const box = document.getElementById("image-box");
  const frame = box.getBoundingClientRect();
  const [x, y] = [frame.left + frame.width / 2, frame.top + frame.height / 2];
  box.dispatchEvent(new PointerEvent("pointermove", {clientX: x, clientY: y, bubbles: true}));
"""
STEP = """
  document.getElementById("image-box").dispatchEvent(
      new KeyboardEvent("keydown", {key: "ArrowRight", shiftKey: true, bubbles: true}));
"""
LAYERS = "return [...document.getElementById('layer').options].map((option) => option.value)"
SPLIT = "return getComputedStyle(document.getElementById('beside-box')).clipPath"


def check_pixel_readout(browser):
    """Linear values of all channels under the cursor, with errors; by mouse and keyboard."""
    browser.run(MOVE)
    values = wait_until(lambda: browser.run(VALUES), CHANGE_SECONDS_MAX, "the values of a pixel")
    assert {"R", "G", "B", "samples", "albedo.R", "normal.Z", "depth.Z"} <= set(values), values
    assert re.match(r"[\d.e-]+ ± [\d.e-]+$", values["R"]), values
    assert "stderr.R" not in values, values
    place = browser.run(TEXT, "pixel-place")
    found = re.match(r"Pixel (\d+), (\d+): linear values ± standard error$", place)
    assert found and int(found[1]) in (319, 320) and int(found[2]) in (179, 180), place
    # The page shows the numbers of the coordinator.
    exact = browser.run("""
      return fetch(`/api/v1/${location.hash.slice(1)}/frames/1/pixel?x=${arguments[0]}` +
          `&y=${arguments[1]}`).then((r) => r.json()).then((p) => p.channels[0]);""",
                        found[1], found[2])
    shown = float(values["R"].split()[0])
    assert exact["name"] == "R" and abs(shown - exact["value"]) <= 1e-3 * exact["value"], exact
    browser.run(FOCUS, "image-box")
    browser.run(STEP)
    wait_until(lambda: browser.run(TEXT, "pixel-place").startswith(f"Pixel {int(found[1]) + 1}, "),
               CHANGE_SECONDS_MAX, "the next pixel by the keyboard")


def check_channel_layers(browser, screenshot):
    """AOVs are offered and shown: a color that can be exposed, directions, and values in false
    color.
    """
    layers = browser.run(LAYERS)
    assert {"of:albedo", "of:normal", "of:depth"} <= set(layers), layers
    image = browser.run(PIXELS)
    browser.run(CHOOSE, "layer", "of:albedo")
    albedo = wait_for_new_pixels(browser, image, "the albedo")
    assert not browser.run("return document.getElementById('exposure').disabled")
    browser.run(FOCUS, "image-box")
    browser.press("[")
    wait_for_new_pixels(browser, albedo, "the darker albedo")
    browser.press("]")
    wait_until(lambda: browser.run(PIXELS) == albedo, CHANGE_SECONDS_MAX, "the albedo again")
    browser.run(CHOOSE, "layer", "of:depth")
    wait_for_new_pixels(browser, albedo, "the depth")
    wait_until(lambda: not browser.run(HIDDEN, "legend"), CHANGE_SECONDS_MAX, "the range of depths")
    low, high = (float(browser.run(TEXT, name)) for name in ("legend-low", "legend-high"))
    assert 2 < low < high < 30, (low, high)
    screenshot("page-depth.png")
    browser.run(CHOOSE, "layer", "image")
    wait_until(lambda: browser.run(PIXELS) == image, CHANGE_SECONDS_MAX, "the image again")


def check_comparisons(browser, other_job, screenshot):
    """Another job over the same place with a line between, and the difference of both."""
    image = browser.run(PIXELS)
    assert browser.run(HIDDEN, "compare-mode")
    # Made-up jobs that are not the newest have no times.
    browser.run("document.querySelector('input[name=abscissa][value=samples]').click()")
    browser.run(CHOOSE, "beside-job", other_job)
    wait_until(lambda: not browser.run(HIDDEN, "compare-mode"), CHANGE_SECONDS_MAX, "the modes")
    wait_until(lambda: "compared job: ±" in browser.run(TEXT, "chart-words"), CHANGE_SECONDS_MAX,
               "the compared job in the chart")
    browser.run(CHOOSE, "compare-mode", "split")
    places = browser.run("""
      return ["image-box", "beside-box"].map((id) => {
        const box = document.getElementById(id).getBoundingClientRect();
        return [box.left, box.top, box.width, box.height].map(Math.round);
      });""")
    assert places[0] == places[1], f"the images do not lie over each other: {places}"
    assert "50%" in browser.run(SPLIT), browser.run(SPLIT)
    browser.run(FOCUS, "split-at")
    browser.press(END)
    assert "100%" in browser.run(SPLIT), browser.run(SPLIT)
    screenshot("page-split.png")
    # The made-up jobs show one image: nothing differs.
    for mode in ("difference", "relative"):
        browser.run(CHOOSE, "compare-mode", mode)
        wait_until(lambda: browser.run(PIXELS) not in ("", image) and
                   not browser.run(HIDDEN, "legend"), CHANGE_SECONDS_MAX, f"the {mode}")
        assert browser.run(TEXT, "legend-high") == "0", browser.run(TEXT, "legend-high")
        assert browser.run(HIDDEN, "beside-box")
    # After that no answer redraws the image.
    time.sleep(SETTLE_SECONDS)
    browser.run(CHOOSE, "beside-job", "")
    wait_until(lambda: browser.run(PIXELS) == image, CHANGE_SECONDS_MAX, "the image again")


def check_looking(browser, other_job, screenshot):
    check_pixel_readout(browser)
    check_channel_layers(browser, screenshot)
    check_comparisons(browser, other_job, screenshot)
