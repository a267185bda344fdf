# Copyright the Sheaf authors.
# SPDX-License-Identifier: Apache-2.0
"""The page of a study in real headless Chromium, opened from a file.

  study_page_test.py sheaf_study_page_maker    over made-up studies that it makes pages of

Screenshots are kept in SHEAF_ARTEFACTS. Ends with "N passed, N failed".
"""
import json
import os
import subprocess
import sys

HERE = os.path.dirname(os.path.abspath(__file__))
sys.path += [HERE, os.path.join(HERE, "..", "integration")]
from browser import Browser  # noqa: E402
from farm import wait_until  # noqa: E402
from focus_checks import check_tab_stops  # noqa: E402
from page_test import artefact, run_checks  # noqa: E402
from study_checks import CHARTS, check_study_page  # noqa: E402
from study_crops_fixture import PRICE_SAMPLES  # noqa: E402
from study_fixture import ENTRIES, SAMPLES, SHOWN_MAX  # noqa: E402
from study_fixture import (bare_study, empty_study, light_study, mark_front,  # noqa: E402
                           whole_study)

CHANGE_SECONDS_MAX = 10
ARROW_RIGHT, END, ESCAPE, SPACE = "\ue014", "\ue010", "\ue00c", " "
TIP = """
  const tip = document.querySelector(arguments[0] + " .tip");
  return tip.hidden ? "" : tip.innerText;
"""
DRAWN_FOR_WIDTH = """
  const plot = document.querySelector(".error-plot");
  return Number(plot.firstChild.getAttribute("width")) === plot.clientWidth;
"""
SHOWN_LINES = """
  return [...document.querySelectorAll("#chart-error .line")]
    .filter((line) => line.querySelector(".curve")).length;
"""
TAB_STOP_COUNT_MAX = 40
FOCUSED = """
  const focused = document.activeElement;
  if (focused === document.body) return ["body", true];
  const style = getComputedStyle(focused);
  const seen = style.outlineStyle !== "none" && parseFloat(style.outlineWidth) >= 2;
  return [focused.id || focused.classList[0] || focused.nodeName, seen];
"""
TAB_STOPS = {"skip", "theme", "minutes", "error-plot", "legend-button", "tile-plot", "SUMMARY"}


class StudyPages:
    """Makes pages of studies and returns their paths."""

    def __init__(self, maker):
        self.maker = maker

    def make(self, name, study):
        path = artefact(f"study-{name}.html")
        with open(path, "wb") as page:
            subprocess.run([self.maker], input=json.dumps(study).encode(), stdout=page, check=True)
        return path


def check_whole_study(browser, pages):
    study = whole_study()
    counts = check_study_page(browser, pages.make("whole", study), SHOWN_MAX,
                              lambda name: browser.screenshot(artefact(f"study-{name}.png")))
    expected = {"prices-cards": len(PRICE_SAMPLES),
                "chart-error": SHOWN_MAX * len(SAMPLES), "chart-gain": len(ENTRIES) - 2,
                "chart-bias": len(ENTRIES) - 1, "chart-rate": len(ENTRIES) - 1,
                "chart-effects": 8, "chart-paths": 3 * len(study["paths"]),
                "chart-tiles": len(study["unreliable_tiles"])}
    assert counts == expected, counts


def check_words_and_names(browser, _):
    """The study's texts are on the page, and its numbers are in tables."""
    study = whole_study()
    words = browser.run("return document.body.textContent")
    names = [entry["name"] for entry in study["entries"]] + [e["name"] for e in study["effects"]]
    for part in study["recommendation"] + study["not_studied"] + names:
        assert part in words, part
    seen = browser.run("return document.getElementById('sections').innerText")
    assert "light paths" not in seen.lower(), "words about light paths that there are not"
    assert "at four prices" in seen
    assert not browser.run("return document.querySelector('#sections b')"), "markup of a name"
    rows = browser.run("return [...document.querySelectorAll('table')]"
                       ".map((table) => table.tBodies[0].rows.length)")
    entry_count, tile_count = len(ENTRIES), len(study["unreliable_tiles"])
    assert rows == [entry_count * len(SAMPLES), entry_count, entry_count, entry_count,
                    len(study["effects"]), len(study["paths"]), tile_count], rows


def check_crops_come_first(browser, _):
    """Two crops at four prices, each with its error and its times here and on the farm."""
    cards = browser.run("return [...document.querySelectorAll('.price')].map((c) => c.innerText)")
    assert len(cards) == len(PRICE_SAMPLES)
    assert "±17 %" in cards[0] and "±2.2 %" in cards[3], cards
    for card in cards:
        assert card.count("within it") == 2, card
        for part in ("This machine, 2 threads", "Farm, 1 worker (8 threads)",
                     "Farm, 4 workers (32 threads)", "Farm, 8 workers (64 threads)",
                     "Processor time", "Region of the largest error", "Representative region"):
            assert part in card, (part, card)
    # 1024 samples x 0.075 s = 76.8 s of CPU time, on 0.95 x 2 and 0.95 x 64 threads.
    assert "40.4 s" in cards[3] and "1.26 s" in cards[3], cards[3]
    words = browser.run("return document.getElementById('prices').innerText")
    assert "Nothing is denoised" in words and "the root of relMSE" in words, words


def check_minutes(browser, _):
    """The page says what some minutes buy, here and on the farm."""
    browser.run("""const field = document.getElementById("minutes");
      field.value = "1";
      field.dispatchEvent(new Event("input"));""")
    # 60 s x 0.95 x 2 threads / 0.075 s = 1520 samples: relMSE of 0.48 / 1520^1.02.
    words = browser.run("return document.getElementById('minutes-buy').innerText")
    lines = words.splitlines()
    assert "±1.7 %" in lines[0] and "520 samples per pixel (extrapolated)" in lines[0], words
    assert lines[-1].startswith("Farm, 8 workers") and "±0.28 %" in lines[-1], words


def check_one_error_scale(browser, _):
    """Errors have the same words everywhere; relMSE is in tables and notes only."""
    axes = browser.run("return [...document.querySelectorAll('#chart-error text')]"
                       ".map((text) => text.textContent)")
    assert any(text.startswith("±") for text in axes) and "typical error of a pixel" in axes, axes
    explained = "return document.body.innerText.split('the root of relMSE').length - 1"
    assert browser.run(explained) == 1
    for chart in ("chart-error", "chart-bias", "chart-effects"):
        words = browser.run("return document.getElementById(arguments[0]).innerText", chart)
        assert "relMSE" not in words, words


def check_few_distinct_curves(browser, _):
    """Five curves at most, with distinct colors and names, dashed and named where biased."""
    browser.set_size(1440, 900)
    wait_until(lambda: browser.run(DRAWN_FOR_WIDTH), CHANGE_SECONDS_MAX, "the chart")
    curves = browser.run("""
      return [...document.querySelectorAll("#chart-error .line .curve")].map((curve) => {
        const style = getComputedStyle(curve);
        return [style.stroke, style.strokeDasharray !== "none"];
      });""")
    assert len(curves) == SHOWN_MAX and len({color for color, _ in curves}) == SHOWN_MAX, curves
    names = browser.run("""
      return [...document.querySelectorAll("#chart-error .curve-name")].map((name) => {
        const box = name.getBoundingClientRect();
        return [name.textContent, box.top, box.bottom];
      });""")
    assert len({name for name, _, _ in names}) == SHOWN_MAX, names
    for above, below in zip(names, names[1:]):
        assert above[2] <= below[1] + 2, (above, below)
    dashed = sum(is_dashed for _, is_dashed in curves)
    assert dashed == sum("(biased)" in name for name, _, _ in names) > 0, (curves, names)


def check_time_labels(browser, _):
    """At least three times label the axis, and no two are the same."""
    labels = browser.run("return [...document.querySelectorAll('#chart-error text')]"
                         ".map((text) => text.textContent)"
                         ".filter((text) => /^[0-9.]+ (µs|ms|s|min|h|d)$/.test(text))")
    assert len(labels) >= 3 and len(set(labels)) == len(labels), labels


def check_front_and_floors(browser, _):
    """The front joins unbiased settings alone; a dotted line shows each floor of a shown curve."""
    pressed = browser.run("return [...document.querySelectorAll('.legend-button')]"
                          ".map((button) => button.getAttribute('aria-pressed') === 'true')")
    shown = [entry for entry, is_shown in zip(whole_study()["entries"], pressed) if is_shown]
    mark_front(shown)
    front = sum(point["on_pareto_front"] for entry in shown for point in entry["points"])
    assert not browser.run("return [...document.querySelectorAll('#chart-error .line')]"
                           ".filter((line) => line.querySelector('.biased'))"
                           ".some((line) => line.querySelector('.on-front'))")
    count = "return document.querySelectorAll('#chart-error ' + arguments[0]).length"
    assert browser.run(count, ".front") == 1
    assert browser.run(count, ".on-front") == front > 0
    assert browser.run(count, ".floor") == browser.run(count, ".line .biased") > 0
    assert browser.run(count, ".spread") == SHOWN_MAX * len(SAMPLES)


def check_legend_toggles(browser, _):
    """Keys hide and show a curve; a sixth cannot be chosen until one is hidden."""
    disabled = "return document.querySelectorAll('.legend-button:disabled').length"
    assert browser.run(disabled) == len(ENTRIES) - SHOWN_MAX
    browser.run("document.querySelector('.legend-button').focus()")
    for expected in (SHOWN_MAX - 1, SHOWN_MAX):
        browser.press(SPACE)
        wait_until(lambda: browser.run(SHOWN_LINES) == expected, CHANGE_SECONDS_MAX,
                   f"{expected} entries")
        assert browser.run(disabled) == (len(ENTRIES) - SHOWN_MAX if expected == SHOWN_MAX else 0)


def check_tips(browser, _):
    """Arrow keys and the pointer describe a point or tile."""
    browser.set_size(1440, 900)
    # A chart that is redrawn for another width shows no note.
    wait_until(lambda: browser.run(DRAWN_FOR_WIDTH), CHANGE_SECONDS_MAX, "the chart")
    browser.run("document.querySelector('.error-plot').focus()")
    browser.press(ARROW_RIGHT)
    first = browser.run(TIP, "#chart-error")
    assert "as given" in first and "4 samples" in first, first
    assert "error of a pixel ±34 %" in first and "relMSE 0.1" in first, first
    browser.press(ARROW_RIGHT)
    assert "16 samples" in browser.run(TIP, "#chart-error")
    browser.press(ESCAPE)
    assert not browser.run(TIP, "#chart-error"), "Escape leaves the note"
    browser.run("document.querySelector('.tile-plot').focus()")
    browser.press(END)
    assert "caustic" in browser.run(TIP, "#chart-tiles")
    x, y = browser.run("""
      const point = document.querySelector("#chart-error .line:not(.base) .point");
      point.scrollIntoView({block: "center"});
      const box = point.getBoundingClientRect();
      return [box.x + box.width / 2, box.y + box.height / 2];""")
    browser.chrome("Input.dispatchMouseEvent", type="mouseMoved", x=x, y=y)
    wait_until(lambda: "depth 4" in browser.run(TIP, "#chart-error"), CHANGE_SECONDS_MAX,
               "the note at the pointer")


def check_focus_is_visible(browser, _):
    browser.run("document.activeElement.blur(); window.scrollTo(0, 0)")
    check_tab_stops(browser, TAB_STOPS, FOCUSED, TAB_STOP_COUNT_MAX)


def check_unfolded_tables(browser, _):
    """Open tables scroll within themselves on a phone."""
    browser.set_size(400, 900)
    browser.run("for (const d of document.querySelectorAll('details')) d.open = true")
    assert browser.run("return document.documentElement.scrollWidth <= window.innerWidth")


def check_theme_button(browser, _):
    theme = "return document.documentElement.dataset.theme"
    before = browser.run(theme)
    browser.run("document.getElementById('theme').click()")
    assert browser.run(theme) != before
    browser.run("document.getElementById('theme').click(); localStorage.clear()")


def check_light_study(browser, pages):
    """Sections say what is measured on a smaller image; times include the training."""
    check_study_page(browser, pages.make("light", light_study()), SHOWN_MAX)
    browser.run("""const field = document.getElementById("minutes");
      field.value = "1";
      field.dispatchEvent(new Event("input"));""")
    # (60 s x 0.95 x 2 threads - 57 s) / 0.075 s.
    assert "760 samples per pixel" in browser.run(
        "return document.getElementById('minutes-buy').innerText")
    for place, part in (
            ("prices", "Crops show light paths of the image itself: as many passes as samples, at "
                       "most 48."),
            ("error", "measured on an image of 267 × 200 pixels, 3 times smaller"),
            ("effects", "those of paths from the camera alone"),
            ("paths", "measured on an image 5 times smaller"),
            ("facts", "Time of the training")):
        words = browser.run("return document.getElementById(arguments[0]).innerText", place)
        assert part in words, (part, words)


def check_empty_study(browser, pages):
    """No chart is an empty frame: each says why it is missing."""
    counts = check_study_page(browser, pages.make("empty", empty_study()), 0)
    assert counts == dict.fromkeys(CHARTS, 0), counts
    assert not browser.run("return document.querySelector('#sections figure, #sections table')")


def check_bare_study(browser, pages):
    counts = check_study_page(browser, pages.make("bare", bare_study()), 1,
                              lambda name: browser.screenshot(artefact(f"study-bare-{name}.png")))
    drawn = {chart: count for chart, count in counts.items() if count}
    assert drawn == {"chart-error": 1, "chart-gain": 1, "chart-bias": 1}, drawn


def main():
    checks = [check_whole_study, check_words_and_names, check_crops_come_first, check_minutes,
              check_one_error_scale, check_few_distinct_curves, check_time_labels,
              check_front_and_floors, check_legend_toggles, check_tips, check_focus_is_visible,
              check_theme_button,
              check_unfolded_tables, check_light_study, check_empty_study, check_bare_study]
    with Browser() as browser:
        passed, failed = run_checks(checks, browser, StudyPages(sys.argv[1]))
    print(f"{passed} passed, {failed} failed")
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
