# Copyright the Sheaf authors.
# SPDX-License-Identifier: Apache-2.0
"""The image viewer, used by keyboard, wheel and mouse as a user does. For page_test.py.

The made-up job must have ended: its image then does not change, so every change is the viewer's.
"""
import math

from farm import wait_until

CHANGE_SECONDS_MAX = 10
ARROW_DOWN, ARROW_RIGHT = "\ue015", "\ue014"
TEXT = "return document.getElementById(arguments[0]).textContent"
FOCUS = "document.getElementById(arguments[0]).focus()"
HIDDEN = "return document.getElementById(arguments[0]).hidden"
PRESSED = "return document.getElementById(arguments[0]).getAttribute('aria-pressed') === 'true'"
# The pixels of the canvas, reduced to 16 x 16, as text; and the pixel in its middle.
PIXELS = """
  const image = document.getElementById("image");
  if (image.hidden || !image.width) return "";
  const canvas = document.createElement("canvas");
  canvas.width = canvas.height = 16;
  const context = canvas.getContext("2d");
  context.drawImage(image, 0, 0, 16, 16);
  return Array.from(context.getImageData(0, 0, 16, 16).data).join();
"""
MIDDLE = """
  const image = document.getElementById("image");
  const [x, y] = [Math.floor(image.width / 2), Math.floor(image.height / 2)];
  return Array.from(image.getContext("2d").getImageData(x, y, 1, 1).data);
"""
# Whether the drawn image is the last version that the server has.
LAST_IS_DRAWN = """
  const [frame, query] = (document.getElementById("image").dataset.drawn || "").split(
      "/preview.png?");
  if (!query) return false;
  return fetch(frame).then((answer) => answer.json()).then(
      (found) => String(found.preview_version) === new URLSearchParams(query).get("version"));
"""
# The lengths of the runs of equal pixels in the canvas's middle row.
RUNS = """
  const image = document.getElementById("image");
  const y = Math.floor(image.height / 2);
  const row = image.getContext("2d").getImageData(0, y, image.width, 1).data;
  const runs = [];
  let start = 0;
  for (let x = 1; x < image.width; ++x) {
    if ([0, 1, 2].every((c) => row[4 * x + c] === row[4 * (x - 1) + c])) continue;
    runs.push(x - start);
    start = x;
  }
  return runs.slice(1);
"""


def zoom_percent(browser):
    return float(browser.run(TEXT, "zoom-level").rstrip("% "))


def wait_for_zoom(browser, percent):
    wait_until(lambda: math.isclose(zoom_percent(browser), percent, rel_tol=0.02),
               CHANGE_SECONDS_MAX, f"a zoom of {percent} %")


def wait_for_new_pixels(browser, before, what):
    return wait_until(lambda: (now := browser.run(PIXELS)) != before and now, CHANGE_SECONDS_MAX,
                      what)


def check_zoom_and_pan(browser, _):
    """Keys, buttons and wheel zoom until pixels are squares; arrow keys and dragging pan."""
    browser.run(FOCUS, "image-box")
    fitted = zoom_percent(browser)
    whole = browser.run(PIXELS)
    browser.press("+")
    wait_for_zoom(browser, 2 * fitted)
    assert not browser.run(PRESSED, "zoom-fit")
    browser.press("-")
    browser.press("1")
    wait_for_zoom(browser, 100)
    for _ in range(4):
        browser.press("+")
    wait_for_zoom(browser, 1600)
    wait_for_new_pixels(browser, whole, "the zoomed image")
    runs = browser.run(RUNS)
    assert runs and all(run % 16 == 0 for run in runs), f"pixels are no squares of 16: {runs}"
    before = browser.run(PIXELS)
    browser.press(ARROW_RIGHT)
    before = wait_for_new_pixels(browser, before, "panning by an arrow")
    x, y = browser.middle_of("image-box")
    browser.drag((x, y), (x + 90, y - 40))
    wait_for_new_pixels(browser, before, "panning by dragging")
    browser.turn_wheel((x, y), 300)
    wait_for_zoom(browser, 800)
    browser.run("document.getElementById('zoom-in').click()")
    wait_for_zoom(browser, 1600)
    browser.press("0")
    wait_for_zoom(browser, fitted)
    assert browser.run(PRESSED, "zoom-fit")
    wait_until(lambda: browser.run(PIXELS) == whole, CHANGE_SECONDS_MAX, "the whole image again")


def wait_for_last_image(browser):
    """The last version arrives shortly after the job's end."""
    wait_until(lambda: browser.run(LAST_IS_DRAWN), CHANGE_SECONDS_MAX, "the last image")


def light_of_level(level):
    """The sRGB curve, IEC 61966-2-1."""
    share = level / 255
    return share / 12.92 if share <= 0.04045 else ((share + 0.055) / 1.055) ** 2.4


def check_exposure(browser, _):
    """One stop less halves the light, including light brighter than the screen's white."""
    browser.run(FOCUS, "image-box")
    fitted = browser.run(PIXELS)
    browser.press("1")
    wait_for_new_pixels(browser, fitted, "the image at 100 %")
    whole = browser.run(PIXELS)
    before = browser.run(MIDDLE)
    for _ in range(4):
        browser.press("[")
    assert browser.run(TEXT, "exposure-value") == "\u22122", browser.run(TEXT, "exposure-value")
    wait_for_new_pixels(browser, whole, "the darker image")
    after = browser.run(MIDDLE)
    for old, new in zip(before[:3], after[:3]):
        assert old == 255 or abs(light_of_level(new) * 4 - light_of_level(old)) < 0.03, (before,
                                                                                        after)
    browser.run("const e = document.getElementById('exposure'); e.value = 1;"
                "e.dispatchEvent(new Event('input'))")
    assert browser.run(TEXT, "exposure-value") == "+1"
    browser.run("document.getElementById('exposure-reset').click()")
    wait_until(lambda: browser.run(PIXELS) == whole, CHANGE_SECONDS_MAX, "the image as it was")
    browser.press("0")
    wait_until(lambda: browser.run(PIXELS) == fitted, CHANGE_SECONDS_MAX, "the whole image")


def check_layers(browser, screenshot):
    """Selected by keyboard; a legend states the range of the colors."""
    browser.run(FOCUS, "layer")
    image = browser.run(PIXELS)
    assert browser.run(HIDDEN, "legend"), "a legend without false colours"
    browser.press(ARROW_DOWN)
    error = wait_for_new_pixels(browser, image, "the standard error")
    low, high = (browser.run(TEXT, name) for name in ("legend-low", "legend-high"))
    assert 0 < float(low.rstrip("% ")) < float(high.rstrip("% ")), (low, high)
    assert "Standard error" in browser.run(TEXT, "legend-words")
    assert browser.run("return document.getElementById('exposure').disabled"), "errors are exposed"
    assert browser.run("return document.getElementById('legend-colors').naturalWidth") == 256
    screenshot("page-error.png")
    browser.press(ARROW_DOWN)
    wait_for_new_pixels(browser, error, "the sample count")
    assert browser.run(TEXT, "legend-low") == "257", browser.run(TEXT, "legend-low")
    assert browser.run(TEXT, "legend-high") == "771", browser.run(TEXT, "legend-high")
    screenshot("page-samples.png")
    samples = browser.run(PIXELS)
    browser.press(ARROW_DOWN)
    wait_for_new_pixels(browser, samples, "the time spent")
    assert browser.run(TEXT, "legend-high").endswith("ms"), browser.run(TEXT, "legend-high")
    for _ in range(3):
        browser.press("\ue013")
    wait_until(lambda: browser.run(PIXELS) == image, CHANGE_SECONDS_MAX, "the image again")
    assert browser.run(HIDDEN, "legend")


def check_viewer(browser, screenshot):
    wait_for_last_image(browser)
    check_zoom_and_pan(browser, screenshot)
    check_exposure(browser, screenshot)
    check_layers(browser, screenshot)
