# Copyright the Sheaf authors.
# SPDX-License-Identifier: Apache-2.0
"""The tables of jobs and workers, the history, and the keys of the page, over made-up ones.

For page_test.py.
"""
import re

from farm import ALL_TESTS, TIME_SCALE, wait_until
from load_checks import TASK_MS_MAX, TAKE_LONG_TASKS, check_is_quick
from viewer_checks import FOCUS, HIDDEN, TEXT

CHANGE_SECONDS_MAX = 20
ARROW_DOWN, ENTER, ESCAPE, SPACE = "\ue015", "\ue007", "\ue00c", " "
FILTER_MS_MAX = 200 * TIME_SCALE
ROW_COUNT_MAX = 80
# The cells of the rows from the first on, in their order.
CELLS = """
  const [table] = arguments;
  return [...document.querySelectorAll(`#${table} .vlist-row`)]
      .sort((a, b) => a.dataset.index - b.dataset.index)
      .map((row) => [...row.children].map((cell) => cell.innerText.trim()));
"""
CHOSEN = """
  return [...document.querySelectorAll(`#${arguments[0]} .vlist-row[aria-selected="true"]`)].length;
"""
SORT = """
  [...document.querySelectorAll(`#${arguments[0]} .sort`)]
      .find((button) => button.textContent === arguments[1]).click();
"""
SET = """
  const [id, value] = arguments;
  const field = document.getElementById(id);
  field.value = value;
  field.dispatchEvent(new Event(field.tagName === "SELECT" ? "change" : "input"));
"""
CLICK_ROW = """
  const [table, index, ctrl, shift] = arguments;
  document.querySelector(`#${table} .vlist-row[data-index="${index}"] .cell:nth-child(3)`)
      .dispatchEvent(new MouseEvent("click", {bubbles: true, ctrlKey: ctrl, shiftKey: shift}));
"""
OPEN = "location.hash = arguments[0]"
CLICK = "document.getElementById(arguments[0]).click()"
# Milliseconds from the input to the next frame in which the table shows the answer.
FILTER_TIME = """
  const [field, value, table, count] = arguments;
  const input = document.getElementById(field);
  const start = performance.now();
  input.value = value;
  input.dispatchEvent(new Event("input"));
  return new Promise((done) => requestAnimationFrame(() => setTimeout(() =>
      done([performance.now() - start, document.getElementById(count).textContent]))));
"""


def column(browser, table, index):
    return [cells[index] for cells in browser.run(CELLS, table)]


def check_jobs_table(browser, screenshot):
    """Sorted by any column, filtered, chosen by mouse and keyboard, and changed together."""
    browser.set_size(1440, 900)
    browser.run(OPEN, "/jobs")
    wait_until(lambda: len(browser.run(CELLS, "jobs-table")) > 10, CHANGE_SECONDS_MAX, "the table")
    rows = browser.run(CELLS, "jobs-table")
    assert len(rows) < ROW_COUNT_MAX, f"{len(rows)} rows in the document"
    numbers = [int(row[1]) for row in rows]
    assert numbers == sorted(numbers, reverse=True), numbers
    assert {row[3] for row in rows} == {"anna", "ben"}, rows[0]
    reasons = {row[5]: row[9] for row in rows}
    assert 'has the tag "gpu"' in reasons["queued"], reasons
    browser.run(SORT, "jobs-table", "Job")
    titles = [title.lower() for title in column(browser, "jobs-table", 2)]
    assert titles == sorted(titles) and titles[0].startswith("<script>"), titles[:3]
    browser.run(SORT, "jobs-table", "Job")
    titles = [title.lower() for title in column(browser, "jobs-table", 2)]
    assert titles == sorted(titles, reverse=True) and titles[0].startswith("turntable"), titles[:3]
    browser.run(SORT, "jobs-table", "No.")
    assert column(browser, "jobs-table", 1)[0] == "1"
    # Several rows by the mouse.
    browser.run(SET, "table-state-filter", "queued")
    wait_until(lambda: set(column(browser, "jobs-table", 5)) == {"queued"}, CHANGE_SECONDS_MAX,
               "the queued jobs")
    browser.run(CLICK_ROW, "jobs-table", 0, False, False)
    browser.run(CLICK_ROW, "jobs-table", 3, False, True)
    assert browser.run(TEXT, "table-chosen") == "4 jobs chosen", browser.run(TEXT, "table-chosen")
    browser.run(CLICK_ROW, "jobs-table", 1, True, False)
    assert browser.run(TEXT, "table-chosen") == "3 jobs chosen"
    assert browser.run(TEXT, "table-pause") == "Pause 3", browser.run(TEXT, "table-pause")
    assert browser.run("return document.getElementById('table-delete').disabled")
    screenshot("page-jobs-table.png")
    # The jobs leave the filter when they are paused, and are not chosen any longer.
    count = int(browser.run(TEXT, "table-count").split()[0])
    names = column(browser, "jobs-table", 1)
    paused = [names[index] for index in (0, 2, 3)]
    browser.run(CLICK, "table-pause")
    wait_until(lambda: int(browser.run(TEXT, "table-count").split()[0]) == count - 3,
               CHANGE_SECONDS_MAX, "three paused jobs")
    wait_until(lambda: browser.run(CHOSEN, "jobs-table") == 0, CHANGE_SECONDS_MAX, "no choice")
    browser.run(SET, "table-state-filter", "paused")
    browser.run(FOCUS, "jobs-table")
    browser.press(ARROW_DOWN)
    assert set(paused) <= set(column(browser, "jobs-table", 1)), "the jobs are not paused"
    assert browser.run(TEXT, "table-chosen") == "1 job chosen"
    browser.press(ARROW_DOWN)
    browser.press(SPACE)
    assert browser.run(CHOSEN, "jobs-table") == 0
    browser.press(SPACE)
    browser.run(SET, "table-priority", "7")
    browser.run(CLICK, "table-priority-set")
    wait_until(lambda: "+7" in column(browser, "jobs-table", 8), CHANGE_SECONDS_MAX, "a priority")
    browser.press(ESCAPE)
    browser.run(SET, "table-state-filter", "")
    check_opening(browser)
    check_actions_on_a_phone(browser)


def check_actions_on_a_phone(browser):
    """Actions take no room until a job is chosen."""
    shown = "return document.getElementById('table-delete').getClientRects().length > 0"
    browser.run(CLICK, "table-choose-none")
    browser.set_size(400, 900)
    browser.run(SET, "table-state-filter", "failed")
    wait_until(lambda: browser.run(CELLS, "jobs-table"), CHANGE_SECONDS_MAX, "the failed jobs")
    assert not browser.run(shown), "an action without a chosen job"
    browser.run(CLICK_ROW, "jobs-table", 0, False, False)
    assert browser.run(shown), "no action for a chosen job"
    browser.run(CLICK, "table-choose-none")
    browser.run(SET, "table-state-filter", "")
    browser.set_size(1440, 900)


def check_opening(browser):
    """Enter shows the job's image, and the browser leads back to the table."""
    browser.run(SET, "table-filter", "jobs/4900")
    wait_until(lambda: column(browser, "jobs-table", 1) == ["4900"], CHANGE_SECONDS_MAX, "one job")
    browser.run(FOCUS, "jobs-table")
    browser.press(ARROW_DOWN)
    browser.press(ENTER)
    wait_until(lambda: browser.run(TEXT, "job-whose").startswith("jobs/4900 · "),
               CHANGE_SECONDS_MAX, "the job of the row")
    assert browser.run("return document.getElementById('jobs-table').getClientRects().length") == 0
    browser.run("history.back()")
    wait_until(lambda: column(browser, "jobs-table", 1) == ["4900"], CHANGE_SECONDS_MAX, "rows")
    browser.run(SET, "table-filter", "")


def check_workers_table(browser, screenshot):
    """Identities, totals of what is shown, and workers that are drained and work again."""
    browser.run(OPEN, "/workers")
    wait_until(lambda: len(browser.run(CELLS, "workers-table")) > 10, CHANGE_SECONDS_MAX, "workers")
    height = browser.run("return document.getElementById('workers-table').clientHeight")
    assert height > 600, f"the workers have {height} px"
    assert column(browser, "workers-table", 1)[0] == "node1"
    totals = browser.run(TEXT, "worker-totals")
    assert re.match(r"1\u2009000 workers: 667 busy, 333 lost · 667 threads · 1\.22 G samples/s$",
                    totals), totals
    browser.run(SET, "worker-filter", "render-17")
    wait_until(lambda: browser.run(TEXT, "worker-totals").startswith("11 of 1000 workers"),
               CHANGE_SECONDS_MAX, "the workers of some hosts")
    browser.run(SET, "worker-state-filter", "busy")
    browser.run(CLICK_ROW, "workers-table", 0, False, False)
    browser.run(CLICK_ROW, "workers-table", 1, True, False)
    names = column(browser, "workers-table", 1)[:2]
    assert browser.run(TEXT, "worker-drain") == "Drain 2"
    screenshot("page-workers-table.png")
    browser.run(CLICK, "worker-drain")
    browser.run(SET, "worker-state-filter", "draining")
    wait_until(lambda: column(browser, "workers-table", 1) == names, CHANGE_SECONDS_MAX, "drained")
    browser.run(CLICK_ROW, "workers-table", 0, False, False)
    assert browser.run(TEXT, "worker-undrain") == "Undrain 1"
    browser.run(CLICK, "worker-undrain")
    wait_until(lambda: column(browser, "workers-table", 1) == names[1:], CHANGE_SECONDS_MAX,
               "a worker that works again")
    browser.run(SET, "worker-state-filter", "")
    browser.run(SET, "worker-filter", "worker-0001")
    wait_until(lambda: column(browser, "workers-table", 1) == ["node1"], CHANGE_SECONDS_MAX, "one")
    browser.run(FOCUS, "workers-table")
    browser.press(ARROW_DOWN)
    browser.press(ENTER)
    wait_until(lambda: browser.run("return location.hash") == "#jobs/5000/frames/1",
               CHANGE_SECONDS_MAX, "the frame of the worker")
    browser.run(SET, "worker-filter", "")


def check_history(browser, screenshot):
    """A row for each day, with the coordinator's accounts and the queue."""
    browser.run(OPEN, "/history")
    rows = """
      return [...document.querySelectorAll("#history-rows tr")].map(
          (row) => [...row.children].map((cell) => cell.innerText.trim()));"""
    found = wait_until(lambda: (now := browser.run(rows)) and "anna" in now[0][3] and now,
                       CHANGE_SECONDS_MAX, "the accounts")
    assert len(found) == 14, len(found)
    days = [row[0] for row in found]
    assert days == sorted(days, reverse=True) and re.match(r"\d{4}-\d\d-\d\d$", days[0]), days
    assert found[0][1] == "14 h 00 min" and found[0][2] == "2.00 G", found[0]
    # One job is submitted each three minutes.
    assert found[1][5] == found[2][5] == "480", found[:3]
    assert int(found[1][4]) >= 1, found[1]
    screenshot("page-history.png")
    browser.set_size(400, 900)
    cut = """
      const box = document.getElementById("history-box");
      return box.scrollWidth - box.clientWidth;"""
    assert browser.run(cut) <= 0, f"the history is cut by {browser.run(cut)} px"
    browser.set_size(1440, 900)


def check_help(browser, screenshot):
    """The list of keys, the keys that change the view, and the switch that turns them off."""
    browser.run(OPEN, "jobs/4990")
    browser.run("document.activeElement.blur()")
    is_open = "return document.getElementById('help').open"
    browser.press("?")
    assert browser.run(is_open)
    keys = browser.run(TEXT, "help-list")
    assert "full screen" in keys and "choose all between" in keys, keys
    screenshot("page-keys.png")
    browser.press(ESCAPE)
    assert not browser.run(is_open)
    view = "return document.querySelector('main').dataset.view"
    for key, name in (("t", "jobs"), ("w", "workers"), ("y", "history"), ("v", "image")):
        browser.press(key)
        wait_until(lambda: browser.run(view) == name, CHANGE_SECONDS_MAX, name)
        current = "return document.querySelector('.views [aria-current]').id"
        assert browser.run(current) == f"view-{name}"
    browser.press("j")
    wait_until(lambda: browser.run("return location.hash") == "#jobs/4989", CHANGE_SECONDS_MAX,
               "the next job")
    browser.press("k")
    wait_until(lambda: browser.run("return location.hash") == "#jobs/4990", CHANGE_SECONDS_MAX,
               "the job before")
    browser.press("/")
    assert browser.run("return document.activeElement.id") == "job-filter"
    browser.press("t")
    assert browser.run("return document.getElementById('job-filter').value") == "t"
    browser.run(SET, "job-filter", "")
    browser.run(CLICK, "help-single")
    browser.run("document.activeElement.blur()")
    browser.press("w")
    assert browser.run(view) == "image", "a key that is turned off changes the view"
    browser.run(CLICK, "help-single")
    browser.run("localStorage.clear()")
    assert browser.run(HIDDEN, "problems"), browser.run(TEXT, "problems-text")


def check_tables_are_quick(browser):
    """No long task while thousands of jobs and workers change, and filters that answer at once."""
    def watch():
        browser.run("return new Promise((done) => setTimeout(done, 3000))")
        return max(browser.run(TAKE_LONG_TASKS), default=0)

    for view, field, table, count in (("/jobs", "table-filter", "jobs-table", "table-count"),
                                      ("/workers", "worker-filter", "workers-table",
                                       "worker-totals")):
        browser.run(OPEN, view)
        check_is_quick(browser, f"longest task in {view}", TASK_MS_MAX, watch)
        times = []

        def filter_times():
            worst = 0
            for words in ("1", "17", "173", ""):
                time_ms, text = browser.run(FILTER_TIME, field, words, table, count)
                assert (" of " in text) == bool(words), text
                times.append(time_ms)
                worst = max(worst, time_ms)
            return worst

        check_is_quick(browser, f"filter in {view}", FILTER_MS_MAX, filter_times)
        if not ALL_TESTS:
            print(f"  {view}: filters answer within {max(times):.0f} ms")
