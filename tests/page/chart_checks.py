# Copyright the Sheaf authors.
# SPDX-License-Identifier: Apache-2.0
"""The chart of error against samples and time. For page_test.py."""
import re

from farm import wait_until

CHANGE_SECONDS_MAX = 10
ARROW_RIGHT, ARROW_LEFT = "\ue014", "\ue012"
WORDS = "return document.getElementById('chart-words').textContent"
# Gives every frame in events and replies a target (relMSE), since frames of the made-up farm have
# none.
ADD_TARGETS = """
  const addTarget = (frame) => frame.stop = {target_error: 0.0004};
  const parse = JSON.parse;
  JSON.parse = (...all) => {
    const object = parse(...all);
    if (object && object.frame_number) addTarget(object);
    return object;
  };
  const json = Response.prototype.json;
  Response.prototype.json = async function() {
    const object = await json.call(this);
    for (const frame of (object && object.frames) || []) addTarget(frame);
    return object;
  };
"""
# Counts the chart's pixels whose color is close to that of a property of the style sheet.
COUNT_POINTS = """
  const probe = document.createElement("canvas").getContext("2d");
  probe.fillStyle = getComputedStyle(document.documentElement).getPropertyValue(arguments[0]);
  probe.fillRect(0, 0, 1, 1);
  const want = probe.getImageData(0, 0, 1, 1).data;
  const canvas = document.querySelector("#chart canvas");
  const have = canvas.getContext("2d").getImageData(0, 0, canvas.width, canvas.height).data;
  let count = 0;
  for (let i = 0; i < have.length; i += 4) {
    if (have[i + 3] < 200) continue;
    if ([0, 1, 2].every((c) => Math.abs(have[i + c] - want[c]) < 24)) ++count;
  }
  return count;
"""


def wait_for_words(browser, pattern):
    return wait_until(lambda: re.search(pattern, browser.run(WORDS)), CHANGE_SECONDS_MAX,
                      f"{pattern!r} under the chart")


def check_chart(browser):
    """The curve, its fitted line and the target are drawn; keys switch the axis."""
    found = wait_for_words(browser, r"^Now ±([\d.]+) % with .* samples per pixel; target ±2 %; "
                                    r"dotted: extrapolated to ±([\d.]+) % with .* "
                                    r"samples per pixel\.$")
    assert float(found[1]) > float(found[2]) >= 2, found[0]
    assert browser.run(COUNT_POINTS, "--accent") > 50, "no curve"
    assert browser.run(COUNT_POINTS, "--good") > 50, "no target"
    browser.run("document.querySelector('input[name=abscissa]:checked').focus()")
    browser.press(ARROW_RIGHT)
    wait_for_words(browser, r"^Now ±.* after [\d.]+ s; .*dotted: extrapolated to ±.* after")
    browser.press(ARROW_RIGHT)
    wait_for_words(browser, r"^Now ±.* for [\d.]+ s of processor time;")
    browser.press(ARROW_RIGHT)
    wait_for_words(browser, r"^Now ±.* with .* samples per pixel;")
