# Copyright the Sheaf authors.
# SPDX-License-Identifier: Apache-2.0
"""Checks for every page of a study. For study_page_test.py and study_test.py."""
import pathlib
import re
import time

from farm import wait_until
from study_fixture import SHOWN_MAX

DRAW_SECONDS_MAX = 10
# Between two inspections of a page during a new layout.
SETTLE_SECONDS = 0.3
CHARTS = ("prices-cards", "chart-error", "chart-gain", "chart-bias", "chart-rate", "chart-effects",
          "chart-paths", "chart-tiles")
# The elements that represent one number in a chart.
MARKS = {"prices-cards": ".price", "chart-error": "path.point", "chart-gain": "rect.bar",
         "chart-bias": "rect.limit, .dot",
         "chart-rate": "circle.dot", "chart-effects": "rect.bar, circle.dot",
         "chart-paths": "rect.bar", "chart-tiles": ".tile-plot rect"}
IS_DRAWN = """
  const plots = [...document.querySelectorAll(".error-plot")];
  return plots.every((plot) => plot.firstChild.nodeName === "svg");
"""
# For a chart: its declared count, its marks with a visible size, and its text.
LOOK = """
  const chart = document.getElementById(arguments[0]);
  if (!chart) return null;
  const marks = [...chart.querySelectorAll(arguments[1])].filter((mark) => {
    const box = mark.getBoundingClientRect();
    return box.width > 0 && box.height > 0 && Number.isFinite(box.x);
  });
  return [Number(chart.dataset.count), marks.length, chart.textContent.trim()];
"""
BAD_NUMBERS = r"""
  const bad = [...document.querySelectorAll("svg *")].filter((element) =>
    [...element.attributes].some(({value}) => /NaN|Infinity|undefined/.test(value)));
  const words = document.getElementById("sections").innerText.match(/NaN|Infinity|undefined|null/);
  return [...bad.map((element) => element.outerHTML.slice(0, 200)), ...(words ?? [])];
"""
# Elements that extend beyond the window, except for content of boxes with their own scrolling.
SIDEWAYS = """
  if (document.documentElement.scrollWidth <= window.innerWidth) return [];
  return [...document.querySelectorAll("body *")]
    .filter((e) => e.getBoundingClientRect().right > window.innerWidth && !e.closest(".table-box"))
    .map((e) => e.outerHTML.slice(0, 120));
"""
FETCHED = "return performance.getEntriesByType('resource').map((entry) => entry.name)"


def check_file(path):
    """The file refers to no other address."""
    text = pathlib.Path(path).read_text(encoding="utf-8")
    data = re.search(r'<script id="study" type="application/json">(.*?)</script>', text, re.S)
    assert data, f"{path} has no JSON within it"
    rest = text.replace(data[1], "")
    for part in ("http:", "https:", "src=", "url(", "@import"):
        assert part not in rest, f"{path} has {part!r} in it"


def look_at(browser, chart):
    """The chart's declared count must equal its visible marks; an empty chart must have a text."""
    found = browser.run(LOOK, chart, MARKS[chart])
    assert found, f"no {chart}"
    count, seen, words = found
    assert words or count, f"{chart} is empty and says nothing"
    assert seen == count, f"{chart} says {count} and shows {seen}"
    return count


# For each image of a crop: whether it was decoded, at which size, and its text.
CROPS = """
  return [...document.querySelectorAll(".crop img")].map(
    (image) => [image.complete && image.naturalWidth, image.naturalHeight, image.alt]);
"""


def check_crops(browser):
    """Every crop is a decoded image with a text, and the first section holds them all."""
    for width_px, height_px, text in browser.run(CROPS):
        assert width_px > 0 and height_px > 0 and "per pixel" in text, (width_px, height_px, text)
    inside = "return document.querySelector('main > section').querySelectorAll('.crop').length"
    assert browser.run(inside) == browser.run("return document.querySelectorAll('.crop').length")
    assert browser.run("return document.querySelector('main > section').id") == "prices"


def check_study_page(browser, path, entries_min, screenshot=None):
    """Opens the file and asserts that it is complete: every chart exists and is drawn, or says why
    not; nothing scrolls horizontally at any width; nothing is fetched; no errors.

    `entries_min` is the number of entries that must be drawn with points. `screenshot`, if given,
    is called with "light", "dark", "narrow" and "4k". Returns counts by chart.
    """
    check_file(path)
    browser.console_errors()  # From earlier pages.
    counts = {}
    for name, width_px, height_px, dark in (("light", 1440, 900, False), ("dark", 1440, 900, True),
                                            ("narrow", 400, 900, False),
                                            ("tablet", 820, 1180, True),
                                            ("4k", 3840, 2160, True)):
        browser.set_size(width_px, height_px)
        browser.set_dark(dark)
        browser.open(pathlib.Path(path).resolve().as_uri())
        wait_until(lambda: browser.run(IS_DRAWN), DRAW_SECONDS_MAX, "the charts")
        time.sleep(SETTLE_SECONDS)
        theme = browser.run("return document.documentElement.dataset.theme")
        assert theme == ("dark" if dark else "light"), theme
        counts = {chart: look_at(browser, chart) for chart in CHARTS}
        sideways = browser.run(SIDEWAYS)
        assert not sideways, f"{width_px} px wide: " + "\n".join(sideways)
        bad = browser.run(BAD_NUMBERS)
        assert not bad, "\n".join(bad)
        if screenshot:
            height_px = browser.run("return document.documentElement.scrollHeight")
            browser.set_size(width_px, height_px)
            time.sleep(SETTLE_SECONDS)
            screenshot(name)
    check_crops(browser)
    drawn = browser.run("return [...document.querySelectorAll('#chart-error .line')]"
                        ".filter((line) => line.querySelector('.point')).length")
    assert entries_min <= drawn <= SHOWN_MAX, f"{drawn} entries are drawn, not {entries_min}"
    assert browser.run("return document.getElementById('recommendation').textContent.length > 0")
    fetched = browser.run(FETCHED)
    assert not fetched, fetched
    errors = browser.console_errors()
    assert not errors, "\n".join(errors)
    return counts
