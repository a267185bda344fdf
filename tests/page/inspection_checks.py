# Copyright the Sheaf authors.
# SPDX-License-Identifier: Apache-2.0
"""Close looks at an image: full screen, false color, histogram, automatic exposure, and layers of
one frame beside each other, by turns and as a difference. For page_test.py, over a made-up job that
has ended.
"""
import re

from compare_checks import BESIDE, CHOOSE
from farm import wait_until
from viewer_checks import FOCUS, HIDDEN, PIXELS, TEXT, wait_for_new_pixels

ONE_LINE_PX_MAX = 45  # The height of controls that do not wrap.
CHANGE_SECONDS_MAX = 20
# Colors are 0 to 255.
ROUNDING_MAX = 2
BOX = """
  const box = document.getElementById("image-box").getBoundingClientRect();
  return [box.width, box.height];
"""
TYPE_RANGE = """
  for (const [id, value] of [["range-low", arguments[0]], ["range-high", arguments[1]]]) {
    document.getElementById(id).value = value;
  }
  document.getElementById("range-high").dispatchEvent(new Event("change"));
"""
# How many pixels of the histogram are drawn.
INK = """
  const canvas = document.getElementById("histogram");
  const data = canvas.getContext("2d").getImageData(0, 0, canvas.width, canvas.height).data;
  let count = 0;
  for (let i = 3; i < data.length; i += 4) count += data[i] > 0;
  return count / (data.length / 4);
"""
VISIBLE = "return getComputedStyle(document.getElementById(arguments[0])).visibility"
SETTINGS = """
  return Object.fromEntries([...document.querySelectorAll("#settings-list .fact")].map(
      (fact) => [...fact.children].map((part) => part.textContent)));
"""


LOG = """
  return [...document.querySelectorAll("#log-list li")].map(
      (line) => [line.children[1].textContent, line.children[2].textContent]);
"""


def check_settings(browser):
    """The owner of the job, its settings, and a command that submits such a one."""
    whose = browser.run(TEXT, "job-whose")
    assert re.match(r"jobs/\d+ · (anna|ben) · show (film|test) · submitted .*\d", whose), whose
    settings = browser.run(SETTINGS)
    assert settings["Size"] == "640 × 360" and settings["Bounces"].isdigit(), settings
    command = browser.run("return document.querySelector('#settings-command input').value")
    assert re.match(r"sheaf submit '.*' (--samples \d+|--target-error [\d.]+%) --max-depth \d+ "
                    r"--seed \d+", command), command


def check_full_screen(browser):
    """By a key, over the whole window, and back."""
    browser.run(FOCUS, "image-box")
    width, height = browser.run(BOX)
    browser.press("f")
    wait_until(lambda: browser.run(BOX)[1] > 1.5 * height, CHANGE_SECONDS_MAX, "full screen")
    large = browser.run(BOX)
    assert large[0] > 1400 and large[1] > 700, large
    browser.press("f")
    wait_until(lambda: browser.run(BOX) == [width, height], CHANGE_SECONDS_MAX, "the way back")


def check_false_color(browser, screenshot):
    """False colors of the luminance, with a range that one chooses; errors have theirs."""
    image = browser.run(PIXELS)
    browser.press("c")
    shown = wait_for_new_pixels(browser, image, "false color")
    wait_until(lambda: "Luminance" in browser.run(TEXT, "legend-words"), CHANGE_SECONDS_MAX,
               "the legend")
    low, high = (float(browser.run(TEXT, name)) for name in ("legend-low", "legend-high"))
    assert 0.001 < low < high < 10, (low, high)
    browser.run(TYPE_RANGE, "0.01", "100")
    wider = wait_for_new_pixels(browser, shown, "another range")
    wait_until(lambda: browser.run(TEXT, "legend-high") == "100", CHANGE_SECONDS_MAX, "its legend")
    screenshot("page-false-color.png")
    browser.run("document.getElementById('range-auto').click()")
    wait_until(lambda: browser.run(PIXELS) == shown, CHANGE_SECONDS_MAX, "the range as it was")
    assert wider != shown
    browser.press("c")
    wait_until(lambda: browser.run(PIXELS) == image, CHANGE_SECONDS_MAX, "the image again")
    browser.run(CHOOSE, "layer", "of:denoisedError")
    error = wait_for_new_pixels(browser, image, "the error of the denoised image")
    wait_until(lambda: browser.run(TEXT, "legend-high").endswith(" %"), CHANGE_SECONDS_MAX,
               "a scale in percent")
    assert "expected error" in browser.run(TEXT, "legend-words")
    browser.run(TYPE_RANGE, "0.01", "90")
    wait_for_new_pixels(browser, error, "errors over another range")
    assert browser.run(TEXT, "legend-high") == "90 %", browser.run(TEXT, "legend-high")
    browser.run("document.getElementById('range-auto').click()")
    wait_until(lambda: browser.run(PIXELS) == error, CHANGE_SECONDS_MAX, "the errors as they were")
    browser.run(CHOOSE, "layer", "of:normal")
    wait_until(lambda: "x, y and z" in browser.run(TEXT, "legend-words"), CHANGE_SECONDS_MAX,
               "what the colors of a direction mean")
    browser.run(CHOOSE, "layer", "image")
    wait_until(lambda: browser.run(PIXELS) == image, CHANGE_SECONDS_MAX, "the image again")


def check_histogram(browser, screenshot):
    """Histograms of light and of false colors, and the exposure that they suggest."""
    browser.run(FOCUS, "image-box")
    image = browser.run(PIXELS)
    browser.press("h")
    wait_until(lambda: browser.run(INK) > 0.02, CHANGE_SECONDS_MAX, "a histogram of light")
    assert "brighter than the screen" in browser.run(TEXT, "histogram-words")
    screenshot("page-histogram.png")
    browser.run(CHOOSE, "layer", "error")
    wait_until(lambda: "colors of the scale" in browser.run(TEXT, "histogram-words"),
               CHANGE_SECONDS_MAX, "a histogram of errors")
    assert browser.run(INK) > 0.02
    browser.run(CHOOSE, "layer", "image")
    browser.run(FOCUS, "image-box")
    browser.press("h")
    assert browser.run(HIDDEN, "histogram-box")
    # The light, which the histogram needs, is a level off here and there.
    wait_until(lambda: browser.run(PIXELS) == image, CHANGE_SECONDS_MAX, "the image again")
    browser.press("e")
    wait_until(lambda: browser.run(TEXT, "exposure-value") != "0", CHANGE_SECONDS_MAX, "stops")
    stops = float(browser.run(TEXT, "exposure-value").replace("\u2212", "-"))
    assert -3 < stops < 3, stops
    # Another layer has another exposure: the one before is not taken again.
    browser.run(CHOOSE, "layer", "of:albedo")
    browser.run(FOCUS, "image-box")
    browser.press("e")
    wait_until(lambda: browser.run(TEXT, "exposure-value").replace("\u2212", "-") not in
               ("0", str(stops)), CHANGE_SECONDS_MAX, "the exposure of the albedo")
    browser.run("document.getElementById('exposure-reset').click()")
    browser.run(CHOOSE, "layer", "image")
    wait_until(lambda: browser.run(PIXELS) == image, CHANGE_SECONDS_MAX, "the image again")


def check_denoised_beside(browser, screenshot):
    """The denoised layer in a split, by turns, and what the denoiser has changed."""
    browser.run(FOCUS, "image-box")
    image = browser.run(PIXELS)
    browser.press("d")
    wait_until(lambda: browser.run(BESIDE) not in ("", image), CHANGE_SECONDS_MAX, "two layers")
    assert browser.run("return document.getElementById('compare-mode').value") == "split"
    assert browser.run(TEXT, "beside-name").startswith("B: denoised"), browser.run(
        TEXT, "beside-name")
    screenshot("page-denoised.png")
    browser.press("b")
    assert browser.run(VISIBLE, "image-box") == "hidden"
    assert browser.run(VISIBLE, "beside-box") == "visible"
    browser.press("b")
    assert browser.run(VISIBLE, "image-box") == "visible"
    assert browser.run(VISIBLE, "beside-box") == "hidden"
    browser.run(CHOOSE, "compare-mode", "relative")
    wait_until(lambda: browser.run(TEXT, "legend-high").endswith(" %"), CHANGE_SECONDS_MAX,
               "what the denoiser has changed")
    browser.run(CHOOSE, "beside-layer", "error")
    wait_until(lambda: "Only colors" in browser.run(TEXT, "image-note"), CHANGE_SECONDS_MAX,
               "why an error has no difference")
    browser.run(CHOOSE, "compare-mode", "beside")
    wait_until(lambda: re.search(r"B: Standard error · [\d.]+ % to [\d.]+ %$",
                                 browser.run(TEXT, "beside-name")), CHANGE_SECONDS_MAX, "its scale")
    browser.run(CHOOSE, "beside-job", "")
    wait_until(lambda: browser.run(HIDDEN, "beside-box") and browser.run(PIXELS) == image,
               CHANGE_SECONDS_MAX, "the image alone")


def values_of(pixels):
    return [int(value) for value in pixels.split(",")] if pixels else []


def furthest(a, b):
    """The largest difference of two lists of values."""
    return max(abs(x - y) for x, y in zip(a, b, strict=True))


def are_alike(a, b):
    """Whether PIXELS differ by rounding alone: the page draws an image of the server's first, and
    then its own of the light.
    """
    a, b = values_of(a), values_of(b)
    return len(a) == len(b) > 0 and furthest(a, b) <= ROUNDING_MAX


def settled_pixels(browser, *others):
    """The pixels once they have ceased to change and are like none of the others."""
    last = [""]

    def are_settled():
        before, last[0] = last[0], browser.run(PIXELS)
        return are_alike(before, last[0]) and not any(are_alike(last[0], o) for o in others)

    wait_until(are_settled, CHANGE_SECONDS_MAX, "another image")
    return last[0]


def check_both_eyes(browser, stereo_job, screenshot):
    """A stereo image: both eyes side by side, by turns and as an anaglyph; its command and log."""
    assert browser.run(HIDDEN, "eyes-label"), "one eye has no choice of eyes"
    other = browser.run("return location.hash")
    browser.run("location.hash = arguments[0]", stereo_job)
    wait_until(lambda: browser.run(TEXT, "job-title") == "both eyes", CHANGE_SECONDS_MAX, "its job")
    browser.set_size(1440, 900)
    bar = browser.run("return document.querySelector('.viewer-bar').clientHeight")
    assert bar <= ONE_LINE_PX_MAX, f"the controls of a stereo image take {bar} px"
    # The image of the job before may look the same.
    before = browser.run(PIXELS)
    browser.run(CHOOSE, "eyes", "left")
    left = settled_pixels(browser, before)
    browser.run(CHOOSE, "eyes", "both")
    both = settled_pixels(browser, left)
    shown = {}
    for mode in ("left", "right", "anaglyph"):
        browser.run(CHOOSE, "eyes", mode)
        shown[mode] = settled_pixels(browser, both, *shown.values())
        screenshot(f"page-eyes-{mode}.png")
    pixels = {mode: values_of(text) for mode, text in shown.items()}
    for channel, eye in enumerate(("left", "right", "right")):
        apart = furthest(pixels["anaglyph"][channel::4], pixels[eye][channel::4])
        assert apart <= ROUNDING_MAX, f"channel {channel} is that of the {eye} eye: {apart}"
    browser.run(CHOOSE, "eyes", "left")
    browser.run(FOCUS, "image-box")
    browser.press("x")
    wait_until(lambda: are_alike(browser.run(PIXELS), shown["right"]), CHANGE_SECONDS_MAX,
               "the other eye")
    browser.run(CHOOSE, "eyes", "both")
    wait_until(lambda: are_alike(browser.run(PIXELS), both), CHANGE_SECONDS_MAX, "both again")
    command = "return document.querySelector('#settings-command input').value"
    wait_until(lambda: browser.run(command) == "sheaf submit room.pbrt --stereo 0.065",
               CHANGE_SECONDS_MAX, "the command that submitted it")
    browser.run("document.getElementById('log').open = true")
    wait_until(lambda: browser.run(LOG), CHANGE_SECONDS_MAX, "its log")
    lines = browser.run(LOG)
    assert [line[0] for line in lines] == ["submit", "started", "failure", "priority"], lines
    assert lines[2][1].startswith("frame 7 · ") and "roughness 1.7" in lines[2][1], lines
    browser.run("document.getElementById('log').scrollIntoView()")
    screenshot("page-log.png")
    browser.run("document.getElementById('log').open = false; location.hash = arguments[0]", other)


def check_close_looks(browser, screenshot):
    browser.set_size(1440, 900)
    check_full_screen(browser)
    check_false_color(browser, screenshot)
    check_histogram(browser, screenshot)
    check_denoised_beside(browser, screenshot)
    assert browser.run(HIDDEN, "problems"), browser.run(TEXT, "problems-text")
