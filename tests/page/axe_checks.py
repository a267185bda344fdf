# Copyright the Sheaf authors.
# SPDX-License-Identifier: Apache-2.0
"""Accessibility of the page by axe-core, light and dark, from a phone to a wall. For page_test.py.

axe-core is installed beside the page's other packages (dashboard/package.json).
"""
import os
import time

from farm import programs, wait_until

AXE = os.path.join("dashboard", "page", "node_modules", "axe-core", "axe.min.js")
# All findings, with the elements.
RUN_AXE = """
  return axe.run(document, {resultTypes: ["violations"]}).then(({violations}) => violations
      .map(({id, nodes}) => id + ": " + nodes.map((node) => node.target.join(" ") + " " +
          (node.any[0] || node.all[0] || {message: ""}).message).join("; ")));
"""
# Controls whose edge is nearer to what surrounds them than EDGE_CONTRAST_MIN, and placeholders
# nearer to their field than TEXT_CONTRAST_MIN: axe-core looks at neither.
FAINT_CONTROLS = """
  const [edgeMin, textMin] = arguments;
  const numbers = (color) => color.match(/[\\d.]+/g).map(Number);
  const luminance = (color) => {
    const linear = numbers(color).slice(0, 3).map((level) => level / 255).map(
        (v) => v <= 0.04045 ? v / 12.92 : ((v + 0.055) / 1.055) ** 2.4);
    return 0.2126 * linear[0] + 0.7152 * linear[1] + 0.0722 * linear[2];
  };
  const contrast = (a, b) => {
    const [low, high] = [luminance(a), luminance(b)].sort((x, y) => x - y);
    return (high + 0.05) / (low + 0.05);
  };
  const ground = (element) => {
    const color = element ? getComputedStyle(element).backgroundColor : "rgb(255, 255, 255)";
    return element && numbers(color)[3] === 0 ? ground(element.parentElement) : color;
  };
  const found = [];
  const note = (element, what, ratio, min) => {
    if (ratio < min) found.push((element.id || element.className) + ": " + what + " " +
                                ratio.toFixed(2));
  };
  for (const element of document.querySelectorAll(".button, .icon-button, select, .switch span, " +
      "input:not([type=range]):not([type=radio]):not([type=file])")) {
    if (element.disabled || element.getClientRects().length === 0) continue;
    note(element, "edge", contrast(getComputedStyle(element).borderTopColor,
                                   ground(element.parentElement)), edgeMin);
    if (element.placeholder) {
      note(element, "placeholder", contrast(getComputedStyle(element, "::placeholder").color,
                                            ground(element)), textMin);
    }
  }
  return found;
"""
EDGE_CONTRAST_MIN, TEXT_CONTRAST_MIN = 3, 4.5  # WCAG 2.1, 1.4.11 and 1.4.3.
CHANGE_SECONDS_MAX = 10
SETTLE_SECONDS = 1
SIZES = ((390, 844), (1440, 900), (3840, 2160))
VIEWS = ("/jobs", "/workers", "/history")


def faults(browser, sizes, visit=lambda name: None):
    """The findings of axe-core and FAINT_CONTROLS at each size, light and dark. visit: called with
    a name for each."""
    with open(os.path.join(programs(), "..", AXE), encoding="utf-8") as file:
        browser.run(file.read())
    found = []
    for width_px, height_px in sizes:
        browser.set_size(width_px, height_px)
        for dark in (False, True):
            browser.set_dark(dark)
            time.sleep(SETTLE_SECONDS)
            name = f"{width_px}-{'dark' if dark else 'light'}"
            visit(name)
            found += [f"{name}: {one}" for one in browser.run(RUN_AXE) +
                      browser.run(FAINT_CONTROLS, EDGE_CONTRAST_MIN, TEXT_CONTRAST_MIN)]
    browser.set_dark(False)
    return found


def check_accessible(browser):
    found = faults(browser, SIZES)
    assert not found, "\n".join(found)


def check_views_accessible(browser, screenshot):
    """The tables, the history, the list of keys, and the viewer with all its tools."""
    before = browser.run("return location.hash")
    found = []
    for view in VIEWS:
        browser.run("location.hash = arguments[0]", view)
        found += [f"{view} {one}" for one in faults(
            browser, SIZES[:2],
            lambda name: screenshot(f"page{view.replace('/', '-')}-{name}.png"))]
        assert browser.run("return document.documentElement.scrollWidth <= innerWidth"), view
    browser.run("location.hash = arguments[0]", before)
    browser.run("""
      for (const id of ["viewer-more", "histogram-show", "false-color"])
        document.getElementById(id).click();
      document.getElementById("settings").open = true;""")
    found += [f"tools {one}" for one in faults(
        browser, SIZES[:2], lambda name: screenshot(f"page-tools-{name}.png"))]
    browser.run("""
      for (const id of ["viewer-more", "histogram-show", "false-color"])
        document.getElementById(id).click();
      document.getElementById("help-open").click();""")
    found += [f"keys {one}" for one in faults(browser, SIZES[:2])]
    browser.run("document.getElementById('help').close()")
    browser.set_size(1440, 900)
    assert not found, "\n".join(found)


def check_first_screen(browser):
    """At 400 px the list of jobs begins on the first screen."""
    browser.set_size(400, 800)
    wait_until(lambda: browser.run("""
      return document.getElementById("jobs").getBoundingClientRect().top + scrollY < 600;"""),
               CHANGE_SECONDS_MAX, "the list of jobs on the first screen")
    browser.set_size(1440, 900)
