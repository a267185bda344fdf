# Copyright the Sheaf authors.
# SPDX-License-Identifier: Apache-2.0
"""Accessibility of the page by axe-core, light and dark, from a phone to a wall. For page_test.py.

axe-core is installed beside the page's other packages (dashboard/package.json).
"""
import os
import time

from farm import programs, wait_until

AXE = os.path.join("dashboard", "page", "node_modules", "axe-core", "axe.min.js")
# Serious and critical findings, with the elements.
RUN_AXE = """
  return axe.run(document, {resultTypes: ["violations"]}).then(({violations}) => violations
      .filter(({impact}) => impact === "serious" || impact === "critical")
      .map(({id, nodes}) => id + ": " + nodes.map((node) => node.target.join(" ") + " " +
          (node.any[0] || node.all[0] || {message: ""}).message).join("; ")));
"""
CHANGE_SECONDS_MAX = 10
SETTLE_SECONDS = 1
SIZES = ((400, 800), (1440, 900), (3840, 2160))


def check_accessible(browser):
    with open(os.path.join(programs(), "..", AXE), encoding="utf-8") as file:
        source = file.read()
    browser.run(source)
    found = []
    for width_px, height_px in SIZES:
        browser.set_size(width_px, height_px)
        for dark in (False, True):
            browser.set_dark(dark)
            time.sleep(SETTLE_SECONDS)
            found += [f"{width_px} px, {'dark' if dark else 'light'}: {one}"
                      for one in browser.run(RUN_AXE)]
    browser.set_dark(False)
    assert not found, "\n".join(found)


def check_first_screen(browser):
    """At 400 px the list of jobs begins on the first screen."""
    browser.set_size(400, 800)
    wait_until(lambda: browser.run("""
      return document.getElementById("jobs").getBoundingClientRect().top + scrollY < 600;"""),
               CHANGE_SECONDS_MAX, "the list of jobs on the first screen")
    browser.set_size(1440, 900)
