# Copyright the Sheaf authors.
# SPDX-License-Identifier: Apache-2.0
"""Errors, effects and failures of a made-up job, and the first steps. For page_test.py."""
import re

from farm import wait_until
from viewer_checks import HIDDEN, TEXT

CHANGE_SECONDS_MAX = 20
FACTS = """
  return Object.fromEntries([...document.querySelectorAll("#facts .fact")].map(
      (fact) => [...fact.children].map((part) => part.textContent)));
"""
EFFECTS = """
  return [...document.querySelectorAll("#effects .effect")].map((row) => [
    row.children[0].textContent, row.children[2].textContent,
    row.querySelector(".effect-fill").getBoundingClientRect().width /
        row.querySelector(".effect-bar").getBoundingClientRect().width]);
"""
DETAILS = "return document.getElementById('details').innerText"
COMMANDS = "return [...document.querySelectorAll(arguments[0] + ' input')].map((i) => i.value)"
SHOWN = "return document.querySelector(arguments[0]).getClientRects().length > 0"
# The first bytes and the width of the image that a link leads to.
PNG_BEHIND = """
  const link = document.getElementById("output-png");
  return fetch(link.href).then((response) => response.arrayBuffer()).then((bytes) => {
    const data = new DataView(bytes);
    return [data.getUint32(0), data.getUint32(16), link.download];
  });
"""


def check_one_error_scale(browser):
    """The list, the job and the meaning name one scale; relMSE stands in its explanation alone."""
    facts = browser.run(FACTS)
    assert re.match(r"±[\d.]+ %$", facts["Error"]), facts
    assert not [label for label in facts if "relMSE" in label], facts
    assert re.match(r"±[\d.]+ %$", facts["Target"]), facts
    row = browser.run("return document.querySelector('#jobs .job-facts').textContent")
    assert "±" in row and "relMSE" not in row, row
    meaning = browser.run(TEXT, "error-words")
    assert "relMSE" in meaning and "±2 % means" in meaning, meaning
    assert "relMSE" not in browser.run(TEXT, "chart-words")


def check_effect_shares(browser):
    """A legend; no share is negative or above 100 %, in words and bars."""
    wait_until(lambda: not browser.run(HIDDEN, "effects"), CHANGE_SECONDS_MAX, "effects")
    assert not browser.run(HIDDEN, "effects-legend"), "bars without a legend"
    assert "standard error" in browser.run(TEXT, "effects-legend")
    rows = browser.run(EFFECTS)
    for name, words, width in rows:
        assert "\u2212" not in words, (name, words)
        shares = [float(share) for share in re.findall(r"([\d.]+) ± [\d.]+ %", words)]
        assert all(0 <= share <= 100 for share in shares), (name, words)
        if words.startswith("not measured"):
            assert width is None, (name, width)
        else:
            assert 0 <= width <= 1.001, (name, width)
    words = {name: text for name, text, _ in rows}
    assert words["choice of lights"].startswith("saves 8 ± 3 % of the time"), words
    assert words["motion"].startswith("nothing measurable of the time"), words


def check_failed_job(browser, failed_job, screenshot):
    """A failed job: its message once, a log by task, commands that work anywhere, and its buttons.
    """
    browser.run("location.hash = arguments[0]", failed_job)
    wait_until(lambda: browser.run(TEXT, "job-state") == "failed" and
               browser.run(COMMANDS, "#failures"), CHANGE_SECONDS_MAX, "the failed job")
    message = browser.run(TEXT, "job-message")
    text = browser.run(DETAILS)
    assert message and text.count(message) == 1, text
    assert not browser.run(HIDDEN, "retry") and not browser.run(HIDDEN, "delete")
    commands = browser.run(COMMANDS, "#failures")
    assert commands[0].startswith(f"sheaf bundle {failed_job} --frame 7 -o "), commands
    browser.run("document.querySelector('.failure-log').open = true")
    log = browser.run("return document.querySelector('.failure-log pre').textContent")
    assert "worker-0003" in log and "roughness 1.7" in log and log.count("\n") == 1, log
    screenshot("page-failed.png")
    browser.click("delete")
    wait_until(lambda: browser.run("return document.getElementById('confirm').open"),
               CHANGE_SECONDS_MAX, "the question")
    browser.click("confirm-yes")
    wait_until(lambda: browser.run(TEXT, "job-state") != "failed" or
               browser.run("return fetch('/api/v1/' + arguments[0]).then((r) => r.status)",
                           failed_job) == 404, CHANGE_SECONDS_MAX, "the end of the job")


# Where the link leads once it is clicked, with the exposure.
PNG_LINK_EXPOSED = """
  const [stops] = arguments, link = document.getElementById("output-png");
  document.getElementById("exposure").value = stops;
  link.addEventListener("click", (event) => event.preventDefault(), {once: true});
  link.click();
  return link.href;
"""


def check_png_download(browser, width_px):
    """Requires: the shown job has succeeded."""
    wait_until(lambda: not browser.run(HIDDEN, "output-png"), CHANGE_SECONDS_MAX, "the link")
    magic, width, name = browser.run(PNG_BEHIND)
    assert magic == 0x89504E47 and width == width_px and name.endswith(".png"), (magic, width, name)
    assert browser.run(PNG_LINK_EXPOSED, "1.5").endswith("preview.png?size=full&exposure=1.5")
    assert browser.run(PNG_LINK_EXPOSED, "0").endswith("preview.png?size=full")


def check_first_steps(browser, url, screenshot):
    """A farm without jobs shows commands with its real address, and no viewer."""
    browser.set_size(1440, 900)
    browser.open("about:blank")
    browser.open(url)
    wait_until(lambda: len(browser.run(COMMANDS, "#first-steps")) >= 2, CHANGE_SECONDS_MAX,
               "the first steps")
    commands = browser.run(COMMANDS, "#first-steps")
    assert commands == ["sheaf-worker --coordinator 127.0.0.1:7411",
                        "sheaf submit scene.pbrt --coordinator 127.0.0.1:7411 --samples 64"]
    for part in ("#viewer", ".details-head", "#facts"):
        assert not browser.run(SHOWN, part), f"{part} is shown without a job"
    assert browser.run(SHOWN, "#first-steps"), "the first steps are not shown"
    assert "elect a job" not in browser.run("return document.body.innerText")
    browser.run("document.querySelector('#first-steps button').click()")
    wait_until(lambda: browser.run("return document.querySelector('#first-steps button')"
                                   ".textContent") in ("Copied", "Press Ctrl+C"),
               CHANGE_SECONDS_MAX, "the answer of the button")
    screenshot("page-first-steps.png")
