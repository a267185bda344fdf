# Copyright the Sheaf authors.
# SPDX-License-Identifier: Apache-2.0
"""The list of jobs and what stands beside it, over made-up jobs. For page_test.py."""
import re

from farm import wait_until
from focus_checks import TAB
from viewer_checks import FOCUS, HIDDEN, TEXT

CHANGE_SECONDS_MAX = 20
ARROW_RIGHT, ARROW_LEFT = "\ue014", "\ue012"
JOBS_SEEN_MIN = 10
# Titles of the rows that are wholly in sight.
SEEN = """
  const box = document.getElementById("jobs").getBoundingClientRect();
  return [...document.querySelectorAll("#jobs .vlist-row")].filter((row) => {
    const {top, bottom} = row.getBoundingClientRect();
    return top >= box.top - 1 && bottom <= Math.min(box.bottom, innerHeight) + 1;
  }).map((row) => row.querySelector(".job-title").textContent);
"""
# Titles that are cut although their row has room left.
CUT_BESIDE_ROOM = """
  return [...document.querySelectorAll("#jobs .vlist-row")].filter((row) => {
    const title = row.querySelector(".job-title");
    const beside = row.querySelector(".job-whose").getBoundingClientRect();
    const room = beside.left - title.getBoundingClientRect().right;
    return title.scrollWidth > title.clientWidth && room > 24;
  }).map((row) => row.textContent);
"""
FILTER = """
  const [words, state] = arguments;
  const field = document.getElementById("job-filter");
  field.value = words;
  field.dispatchEvent(new Event("input"));
  const select = document.getElementById("job-state-filter");
  select.value = state;
  select.dispatchEvent(new Event("change"));
"""
STATES = "return [...document.querySelectorAll('#jobs .badge')].map((badge) => badge.textContent)"
COLORS = """
  return ["running", "paused"].map((state) => {
    const row = document.createElement("div");
    row.innerHTML = `<span class="badge" data-state="${state}"></span>
      <div class="bar" data-state="${state}"><div class="bar-fill"></div></div>`;
    document.getElementById("jobs").append(row);
    const colors = [getComputedStyle(row.querySelector(".badge")).color,
                    getComputedStyle(row.querySelector(".bar-fill")).backgroundColor];
    row.remove();
    return colors;
  });
"""
OWNERS = "return [...document.querySelectorAll('#jobs .vlist-row')].map((row) => row.title)"


def check_jobs_in_sight(browser):
    """Ten jobs are in sight at 1440 x 900, and no title is cut beside free space."""
    browser.set_size(1440, 900)
    wait_until(lambda: len(browser.run(SEEN)) >= JOBS_SEEN_MIN, CHANGE_SECONDS_MAX,
               f"{JOBS_SEEN_MIN} jobs in sight")
    cut = browser.run(CUT_BESIDE_ROOM)
    assert not cut, f"titles are cut beside free space: {cut}"


def check_colors_of_states(browser):
    """Jobs that run and those that are paused differ in color, in the badge and in the bar."""
    running, paused = browser.run(COLORS)
    assert running[0] != paused[0] and running[1] != paused[1], (running, paused)


def check_diagnostics_tab(browser):
    """Counters are in a tab that arrow keys reach, and are scrolled by keyboard. The number of
    workers is behind the tab of that name.
    """
    tabs = browser.run("""
      return ["tab-workers", "tab-diagnostics"].map((id) => document.getElementById(id).innerText);
    """)
    assert re.search(r"^Workers\s+[\d\s]+$", tabs[0]), tabs
    assert re.search(r"^Diagnostics(\s+\d+ alerts?)?$", tabs[1].strip()), tabs
    assert browser.run(HIDDEN, "tab-panel-diagnostics"), "counters take room unasked"
    browser.run(FOCUS, "tab-workers")
    browser.press(ARROW_RIGHT)
    assert not browser.run(HIDDEN, "tab-panel-diagnostics")
    assert browser.run(HIDDEN, "tab-panel-workers")
    assert "leases expired" in browser.run(TEXT, "counters"), browser.run(TEXT, "counters")
    assert browser.run("return document.activeElement.id") == "tab-diagnostics"
    browser.press(TAB)
    assert browser.run("return document.activeElement.id") == "counters-box"
    browser.run(FOCUS, "tab-diagnostics")
    browser.press(ARROW_LEFT)
    assert not browser.run(HIDDEN, "tab-panel-workers")


def check_search(browser):
    """By state, by user and by words of the title, alone and together."""
    browser.run(FILTER, "", "failed")
    wait_until(lambda: set(browser.run(STATES)) == {"failed"}, CHANGE_SECONDS_MAX, "failed jobs")
    browser.run(FILTER, "user:anna", "failed")
    wait_until(lambda: all(" of anna" in title for title in browser.run(OWNERS)) and
               browser.run(OWNERS), CHANGE_SECONDS_MAX, "failed jobs of one user")
    browser.run(FILTER, "shot 18 show:film", "")
    # Words are those of the title or of the name: 18 is in jobs/4918, too.
    wait_until(lambda: all("18" in title and "show film" in title
                           for title in browser.run(OWNERS)) and browser.run(OWNERS),
               CHANGE_SECONDS_MAX, "jobs of one title")
    browser.run(FILTER, "user:nobody", "")
    wait_until(lambda: browser.run(TEXT, "jobs-empty") == "No job matches.", CHANGE_SECONDS_MAX,
               "words on nothing found")
    browser.run(FILTER, "", "")


def check_job_list(browser):
    check_jobs_in_sight(browser)
    check_colors_of_states(browser)
    check_diagnostics_tab(browser)
    check_search(browser)
