# Copyright the Sheaf authors.
# SPDX-License-Identifier: Apache-2.0
"""The dashboard in real headless Chromium.

  page_test.py farm      over a coordinator and a worker that render a scene
  page_test.py made-up   over sheaf_page_server: thousands of jobs, odd titles, narrow and wide
  page_test.py session   over a coordinator with certificates: sign in and out
  page_test.py           all of them

Times are judged by tests/run --all alone.

Screenshots are kept in SHEAF_ARTEFACTS. Ends with "N passed, N failed".
"""
import os
import re
import subprocess
import sys
import time
import traceback

HERE = os.path.dirname(os.path.abspath(__file__))
sys.path += [HERE, os.path.join(HERE, "..", "integration")]
from action_checks import MORE_FRAMES, check_clicks, check_dismissed  # noqa: E402
from action_checks import check_more_frames, check_unknown_job, is_of_missing_job  # noqa: E402
from action_checks import wait_for_problems  # noqa: E402
from browser import Browser  # noqa: E402
from aside_checks import check_set_aside  # noqa: E402
from axe_checks import check_accessible, check_first_screen  # noqa: E402
from axe_checks import check_views_accessible  # noqa: E402
from chart_checks import ADD_TARGETS, check_chart  # noqa: E402
from compare_checks import check_compare  # noqa: E402
from control_checks import check_control, check_effects, check_refine  # noqa: E402
from farm import ALL_TESTS, Farm, PATIENCE, ROOT, programs, wait_until  # noqa: E402
from focus_checks import TAB, check_tab_stops  # noqa: E402
from figure_checks import NOTE_IMAGES, check_large_image  # noqa: E402
from inspection_checks import check_both_eyes, check_close_looks, check_settings  # noqa: E402
from frame_checks import MANY_FRAMES, check_frame_grid, check_many_frames  # noqa: E402
from job_checks import check_effect_shares, check_failed_job, check_first_steps  # noqa: E402
from job_checks import check_one_error_scale, check_png_download  # noqa: E402
from list_checks import check_job_list  # noqa: E402
from load_checks import NOTE_LONG_TASKS, check_lists, check_loading  # noqa: E402
from look_checks import check_looking  # noqa: E402
from round_checks import check_rounds  # noqa: E402
from session_checks import check_session  # noqa: E402
from submit_checks import check_submission, check_submission_of_a_user  # noqa: E402
from table_checks import check_help, check_history, check_jobs_table  # noqa: E402
from table_checks import check_tables_are_quick, check_workers_table  # noqa: E402
from viewer_checks import PIXELS, TEXT, check_viewer  # noqa: E402
from worker_checks import check_drain, check_failures, check_workers  # noqa: E402

PAGE_SECONDS_MAX = 20
# Tracing slows a browser down.
TRACED_SECONDS_MAX = 60
IMAGE_SECONDS_MAX = 120
# Samples per pixel of the first job: one of each replicate, so that its errors are known.
SAMPLES = 16
MADE_UP_JOB_COUNT = 5000
MADE_UP_WORKER_COUNT = 1000
MADE_UP_WIDTH_PX = 640
MADE_UP_STEREO_JOB = "jobs/4998"  # As in page_server.cc.
# A number that page_server.cc lets fail.
MADE_UP_FAILED_JOB = "jobs/4988"
assert int(MADE_UP_FAILED_JOB[5:]) % 11 == 5
# A page that has not heard of its deletion asks for it. Lists ask for its thumbnail, which is no
# error.
IS_GONE = f"/api/v1/{MADE_UP_FAILED_JOB}"
# Limit from the server's start, with a wide margin.
MADE_UP_RENDER_SECONDS_MAX = 60
MADE_UP_SECONDS = int(420 * PATIENCE)
ARROW_DOWN, ENTER, ESCAPE = "\ue015", "\ue007", "\ue00c"
DIALOG_IS_OPEN = "return document.getElementById('confirm').open"
TAB_STOP_COUNT_MAX = 60
TAB_STOPS = {"skip", "theme", "job-filter", "job-state-filter", "jobs", "layer", "exposure",
             "zoom-out", "zoom-in", "zoom-fit", "image-zoom", "image-box", "frames",
             "abscissa", "workers", "tab-workers", "beside-job", "view-jobs", "view-workers",
             "view-history", "help-open", "full-screen", "false-color", "histogram-show",
             "exposure-auto"}
# Name of the focused element, and whether an outline shows the focus; a switch shows it on its
# label.
FOCUSED = """
  const focused = document.activeElement;
  if (focused === document.body) return ["body", true];
  const shown = focused.type === "radio" ? focused.nextElementSibling : focused;
  const style = getComputedStyle(shown);
  const seen = style.outlineStyle !== "none" && parseFloat(style.outlineWidth) >= 2;
  return [focused.id || focused.name || focused.className, seen];
"""
NO_SIDEWAYS = "return document.documentElement.scrollWidth <= window.innerWidth"


# Source of the newest job's thumbnail; empty while none is shown.
LISTED_IMAGE = """
  const image = document.querySelector("#jobs .job-row img");
  return image && !image.hidden && image.naturalWidth > 0 ? image.src : "";"""


def artefact(name):
    folder = os.environ.get("SHEAF_ARTEFACTS", os.path.join(ROOT, "build", "artefacts"))
    os.makedirs(folder, exist_ok=True)
    return os.path.join(folder, name)


def check_page_follows_a_job(browser, farm):
    """Jobs and workers are listed, and the image changes at least twice without a reload."""
    browser.set_size(1440, 900)
    browser.open(f"http://{farm.http}/")
    wait_until(lambda: browser.run(TEXT, "connection-text") == "Live", PAGE_SECONDS_MAX, "events")
    # Submitted after the page was opened: only events can make it appear.
    farm.sheaf("submit", os.path.join(ROOT, "scenes", "cornell-box.pbrt"), "--samples", SAMPLES,
               "--light-paths")
    seen = []

    def image_changed():
        pixels = browser.run(PIXELS)
        if pixels and pixels not in seen:
            seen.append(pixels)
            if len(seen) == 1:
                browser.screenshot(artefact("page-first.png"))
        return len(seen) >= 3

    wait_until(image_changed, IMAGE_SECONDS_MAX, "two changes of the image")
    wait_until(lambda: browser.run(LISTED_IMAGE), PAGE_SECONDS_MAX, "an image in the list")
    early = browser.run(LISTED_IMAGE)
    assert browser.run(TEXT, "worker-count") == "1", browser.run(TEXT, "worker-count")
    assert "cornell" in browser.run(TEXT, "job-title").lower()
    wait_until(lambda: browser.run(TEXT, "job-state") == "succeeded", IMAGE_SECONDS_MAX, "end")
    wait_until(lambda: not browser.run("return document.getElementById('output').hidden"),
               PAGE_SECONDS_MAX, "the download")
    assert browser.run("return document.getElementById('cancel').hidden"), "nothing to cancel"
    wait_until(lambda: browser.run(LISTED_IMAGE) not in ("", early), PAGE_SECONDS_MAX,
               "the last image in the list")
    browser.screenshot(artefact("page-done.png"))


def check_output_is_an_exr(browser, farm):
    size = browser.run("""
      return fetch(document.getElementById("output").href)
        .then((response) => response.arrayBuffer())
        .then((bytes) => [...new Uint8Array(bytes.slice(0, 4))]);""")
    assert size == [0x76, 0x2F, 0x31, 0x01], size


def check_what_is_known_of_errors(browser, _):
    """FLIP, the unreliable tiles, and the kinds of paths that cause them."""
    facts = {label: (value, title) for label, value, title in browser.run("""
      return [...document.querySelectorAll("#facts .fact")].map(
          (fact) => [...[...fact.children].map((part) => part.textContent), fact.title]);""")}
    assert 0 < float(facts["FLIP"][0]) < 0.5, facts
    assert "Tiles with fireflies" not in facts, "an alarm that changes no decision"
    words = browser.run(TEXT, "error-words")
    found = re.search(r"In (\d+) of (\d+) tiles a few very bright samples", words)
    assert found and int(found[2]) > 100, words
    blamed = re.findall(r"(\S+) \((\d+) tiles\)", words.split(" Main cause: ")[1])
    assert blamed[0][0] == "caustic", words
    assert sum(int(tiles) for _, tiles in blamed) == int(found[1]) > 0, facts


def check_pause_and_priority(browser, farm):
    """The job is long enough for the next check to cancel it."""
    farm.sheaf("submit", os.path.join(ROOT, "scenes", "cornell-box.pbrt"), "--samples", 1 << 16)
    wait_until(lambda: browser.run(TEXT, "job-state") == "running", PAGE_SECONDS_MAX, "new job")
    check_control(browser, farm, "jobs/2")
    browser.screenshot(artefact("page-control.png"))


def check_workers_and_failures(browser, farm):
    check_workers(browser)
    check_drain(browser)
    check_failures(browser, farm, farm.folder)
    browser.screenshot(artefact("page-failures.png"))


def check_cancel(browser, farm):
    """The button, its dialog, both answers by keyboard, and the resulting state."""
    assert browser.run(TEXT, "job-state") == "running"
    ask(browser)
    assert "Cancel" in browser.run(TEXT, "confirm-title")
    browser.screenshot(artefact("page-question.png"))
    # The harmless answer has the focus; Escape selects it too.
    browser.press(ENTER)
    wait_until(lambda: not browser.run(DIALOG_IS_OPEN), PAGE_SECONDS_MAX, "no by Enter")
    ask(browser)
    browser.press(ESCAPE)
    wait_until(lambda: not browser.run(DIALOG_IS_OPEN), PAGE_SECONDS_MAX, "no by Escape")
    assert browser.run(TEXT, "job-state") == "running", "a job was cancelled by a no"
    assert browser.run("return document.activeElement.id") == "cancel", "the focus is lost"
    ask(browser)
    browser.press(TAB)
    assert browser.run("return document.activeElement.id") == "confirm-yes"
    browser.press(ENTER)
    wait_until(lambda: browser.run(TEXT, "job-state") == "cancelled", PAGE_SECONDS_MAX, "the end")
    # An image named by an event may be gone when it is requested: that must not be an error.
    status = browser.run("""
      const path = new URL("/api/v1/jobs/2/frames/1/preview.png", location.href);
      return fetch(path).then((response) => response.status);""")
    assert status == 204, status


def ask(browser):
    browser.run("document.getElementById('cancel').focus()")
    browser.press(ENTER)
    wait_until(lambda: browser.run(DIALOG_IS_OPEN), PAGE_SECONDS_MAX, "the question")


def check_layers_of_a_real_image(browser, farm):
    """All layers of the delivered image are available."""
    ranges = browser.run("""
      const path = "/api/v1/jobs/1/frames/1/preview.png?layer=";
      const range = (layer) => fetch(path + layer).then((response) => {
        if (!response.ok) throw new Error(layer + ": " + response.status);
        return response.headers.get("X-Sheaf-Range");
      });
      return Promise.all(["image", "light", "error", "samples", "time"].map(range));""")
    assert ranges[:2] == [None, None] and ranges[3] == f"{SAMPLES} {SAMPLES}", ranges
    for layer in (2, 4):
        low, high = map(float, ranges[layer].split())
        assert 0 < low < high < 10, ranges


def check_frames(browser, farm):
    check_frame_grid(browser, farm)
    browser.screenshot(artefact("page-range.png"))


def check_slider_between_rounds(browser, farm):
    check_rounds(browser, farm)
    browser.run("document.getElementById('round').focus()")
    browser.press("\ue011")
    browser.screenshot(artefact("page-rounds.png"))
    browser.press("\ue010")


def check_side_by_side(browser, _):
    check_compare(browser, lambda name: browser.screenshot(artefact(name)))


def check_refining(browser, farm):
    check_refine(browser, farm, lambda name: browser.screenshot(artefact(name)))


def check_cost_by_effect(browser, farm):
    browser.run("document.getElementById('effects-section').scrollIntoView()")
    browser.screenshot(artefact("page-effects.png"))
    check_effects(browser, farm)


def check_figures(browser, farm):
    browser.run_before_pages(NOTE_LONG_TASKS)
    browser.run_before_pages(NOTE_IMAGES)
    check_large_image(browser, farm)
    browser.screenshot(artefact("page-large.png"))


def check_what_is_set_aside(browser, farm):
    check_set_aside(browser, farm, lambda name: browser.screenshot(artefact(name)))


def check_dropped_scenes(browser, farm):
    check_submission(browser, farm, lambda name: browser.screenshot(artefact(name)))


def check_no_console_errors(browser, _):
    errors = [error for error in browser.console_errors() if not is_of_missing_job(error) and
              (IS_GONE not in error or "size=thumbnail" in error)]
    assert not errors, "\n".join(errors)


def open_made_up(browser, server, seconds_max=PAGE_SECONDS_MAX):
    """Reopens the page and waits until everything is listed."""
    browser.open("about:blank")
    browser.open(server.url)
    for name, count in (("job-count", MADE_UP_JOB_COUNT), ("worker-count", MADE_UP_WORKER_COUNT)):
        text = f"{count:,}".replace(",", "\u2009")
        wait_until(lambda: browser.run(TEXT, name) == text, seconds_max, f"{text} {name}")


def check_the_chart(browser, server):
    """While the job runs, the page draws the curve from observed progress."""
    browser.set_size(1440, 900)
    browser.run_before_pages(NOTE_LONG_TASKS)
    browser.run_before_pages(ADD_TARGETS)
    open_made_up(browser, server)
    wait_until(lambda: browser.run(PIXELS), PAGE_SECONDS_MAX, "an image")
    check_chart(browser)
    browser.screenshot(artefact("page-light.png"))


def check_thousands_of_jobs_and_workers(browser, server):
    with Browser(traced=True) as traced:
        traced.set_size(1440, 900)
        check_loading(traced, lambda: open_made_up(traced, server, TRACED_SECONDS_MAX))
    check_lists(browser)


def check_titles_are_text(browser, _):
    """A title with markup is shown literally."""
    browser.run("const f = document.getElementById('job-filter'); f.value = 'script';"
                "f.dispatchEvent(new Event('input'))")
    wait_until(lambda: "<script>alert(1)</script>" in browser.run(TEXT, "jobs"), PAGE_SECONDS_MAX,
               "the title")
    browser.run("const f = document.getElementById('job-filter'); f.value = '';"
                "f.dispatchEvent(new Event('input'))")


def check_tables(browser, _):
    check_jobs_table(browser, lambda name: browser.screenshot(artefact(name)))
    check_workers_table(browser, lambda name: browser.screenshot(artefact(name)))
    check_history(browser, lambda name: browser.screenshot(artefact(name)))
    check_tables_are_quick(browser)


def check_keys_of_the_page(browser, _):
    check_help(browser, lambda name: browser.screenshot(artefact(name)))
    browser.run("location.hash = 'jobs/' + arguments[0]", MADE_UP_JOB_COUNT)
    wait_until(lambda: browser.run(TEXT, "job-title").startswith("turntable"), PAGE_SECONDS_MAX,
               "the selected job")


def check_inspection(browser, _):
    check_settings(browser)
    check_close_looks(browser, lambda name: browser.screenshot(artefact(name)))
    check_both_eyes(browser, MADE_UP_STEREO_JOB, lambda name: browser.screenshot(artefact(name)))
    wait_until(lambda: browser.run(TEXT, "job-title").startswith("turntable"), PAGE_SECONDS_MAX,
               "the job before")


def check_keyboard(browser, _):
    browser.run("document.getElementById('jobs').focus()")
    before = browser.run("return location.hash")
    browser.press(ARROW_DOWN)
    wait_until(lambda: browser.run("return location.hash") != before, PAGE_SECONDS_MAX, "selection")
    browser.run("location.hash = 'jobs/' + arguments[0]", MADE_UP_JOB_COUNT)


def check_address_of_no_job(browser, _):
    check_unknown_job(browser, MADE_UP_JOB_COUNT)


def check_focus_is_visible(browser, _):
    """The Tab key reaches every control in turn, and each shows its focus."""
    browser.run("location.hash = 'jobs/' + arguments[0]", MADE_UP_JOB_COUNT)
    wait_until(lambda: browser.run(TEXT, "job-title").startswith("turntable"), PAGE_SECONDS_MAX,
               "the selected job")
    browser.run("document.activeElement.blur()")
    check_tab_stops(browser, TAB_STOPS, FOCUSED, TAB_STOP_COUNT_MAX)


def check_the_viewer(browser, _):
    """Uses the job that has ended, so that its image does not change."""
    browser.run("location.hash = 'jobs/' + arguments[0]", MADE_UP_JOB_COUNT)
    wait_until(lambda: browser.run(TEXT, "job-state") == "succeeded", MADE_UP_RENDER_SECONDS_MAX,
               "the end of the made-up job")
    check_viewer(browser, lambda name: browser.screenshot(artefact(name)))


def check_mouse(browser, _):
    check_clicks(browser)
    browser.run("location.hash = 'jobs/' + arguments[0]", MADE_UP_JOB_COUNT)
    wait_until(lambda: browser.run(TEXT, "job-title").startswith("turntable"), PAGE_SECONDS_MAX,
               "the selected job")


def check_frames_come_in_pages(browser, _):
    other = MadeUpServer()
    other.start(job_count=3, worker_count=3, frame_count=MORE_FRAMES)
    try:
        check_more_frames(browser, other.url)
    finally:
        browser.open("about:blank")
        other.stop()


def check_list_and_tabs(browser, _):
    check_job_list(browser)


def check_errors_and_effects(browser, _):
    check_one_error_scale(browser)
    check_effect_shares(browser)


def check_looks(browser, _):
    check_png_download(browser, MADE_UP_WIDTH_PX)
    check_looking(browser, f"jobs/{MADE_UP_JOB_COUNT - 1}",
                  lambda name: browser.screenshot(artefact(name)))


def check_failures_of_a_job(browser, _):
    check_failed_job(browser, MADE_UP_FAILED_JOB, lambda name: browser.screenshot(artefact(name)))
    browser.run("location.hash = 'jobs/' + arguments[0]", MADE_UP_JOB_COUNT)
    wait_until(lambda: browser.run(TEXT, "job-title").startswith("turntable"), PAGE_SECONDS_MAX,
               "the selected job")


def check_accessibility(browser, _):
    check_first_screen(browser)
    check_accessible(browser)
    check_views_accessible(browser, lambda name: browser.screenshot(artefact(name)))


def check_an_empty_farm(browser, _):
    other = MadeUpServer()
    other.start(job_count=0, worker_count=0)
    try:
        check_first_steps(browser, other.url, lambda name: browser.screenshot(artefact(name)))
    finally:
        browser.open("about:blank")
        other.stop()


def check_every_width(browser, _):
    """No horizontal scrolling from a phone to a wall display, in light and dark."""
    for name, width_px, height_px, dark in (("narrow", 400, 1800, False), ("dark", 1440, 900, True),
                                            ("tablet", 820, 1180, True), ("4k", 3840, 2160, True)):
        browser.set_size(width_px, height_px)
        browser.set_dark(dark)
        time.sleep(1)
        browser.screenshot(artefact(f"page-{name}.png"))
        assert browser.run(NO_SIDEWAYS), f"{width_px} px wide scrolls sideways"
        if width_px <= 820:
            browser.run("document.getElementById('refine').click()")
            wait_until(lambda: "(" in browser.run(TEXT, "refine-cpu"), PAGE_SECONDS_MAX, "a price")
            browser.screenshot(artefact(f"page-refine-{name}.png"))
            assert browser.run(NO_SIDEWAYS), f"the question scrolls {width_px} px sideways"
            browser.press(ESCAPE)
    assert browser.run("return document.documentElement.dataset.theme") == "dark"


def check_a_thousand_frames(browser, _):
    other = MadeUpServer()
    other.start(job_count=3, worker_count=3, frame_count=MANY_FRAMES)
    try:
        check_many_frames(browser, other.url)
        browser.screenshot(artefact("page-frames.png"))
    finally:
        browser.open("about:blank")
        other.stop()


def check_page_survives_a_restart(browser, server):
    """The page reports a lost coordinator and follows it again without a reload; the next loss is
    reported although the first was dismissed.
    """
    connection = lambda: browser.run(TEXT, "connection-text")  # noqa: E731
    browser.open(server.url)
    wait_until(lambda: connection() == "Live", PAGE_SECONDS_MAX, "events")
    server.stop()
    wait_until(lambda: connection() == "Reconnecting", PAGE_SECONDS_MAX, "the loss")
    check_dismissed(browser)
    server.start(job_count=7, worker_count=3)
    wait_until(lambda: connection() == "Live", PAGE_SECONDS_MAX, "the return")
    wait_until(lambda: browser.run(TEXT, "job-count") == "7", PAGE_SECONDS_MAX, "the new jobs")
    server.stop()
    wait_for_problems(browser)
    server.start(job_count=7, worker_count=3)
    wait_until(lambda: connection() == "Live", PAGE_SECONDS_MAX, "the return")


class MadeUpServer:
    """sheaf_page_server on a fixed port while the test needs it."""

    def __init__(self):
        self.port = 0
        self.url = ""
        self.process = None

    def start(self, job_count, worker_count, frame_count=24):
        program = os.path.join(programs(), "sheaf_page_server")
        arguments = map(str, (job_count, MADE_UP_SECONDS, self.port, worker_count, frame_count))
        self.process = subprocess.Popen([program, *arguments], stdout=subprocess.PIPE, text=True)
        self.url = self.process.stdout.readline().split()[-1]
        self.port = self.url.rsplit(":", 1)[1]

    def stop(self):
        self.process.terminate()
        self.process.wait()
        self.process.stdout.close()


def run_checks(checks, browser, subject):
    failed = 0
    for check in checks:
        begin = time.monotonic()
        try:
            check(browser, subject)
            print(f"ok      {check.__name__}, {time.monotonic() - begin:.1f} s", flush=True)
        except Exception:  # Every check is reported, whatever ended it.
            failed += 1
            print("FAILED ", check.__name__)
            traceback.print_exc()
    return len(checks) - failed, failed


def run_farm():
    checks = [check_page_follows_a_job, check_output_is_an_exr, check_layers_of_a_real_image,
              check_what_is_known_of_errors, check_pause_and_priority, check_workers_and_failures,
              check_cancel, check_frames, check_slider_between_rounds, check_side_by_side,
              check_refining, check_cost_by_effect, *([check_figures] if ALL_TESTS else []),
              check_what_is_set_aside, check_dropped_scenes, check_no_console_errors]
    with Farm(["--poison-workers", "1"]) as farm, Browser() as browser:
        farm.start_worker()
        return run_checks(checks, browser, farm)


def run_made_up():
    # The restart comes last: a browser reports every refused connection as an error.
    # The observed error of a job is forgotten when another one is selected, which
    # check_keyboard does.
    checks = [check_the_chart, check_focus_is_visible, check_the_viewer, check_looks,
              check_inspection, check_tables, check_keys_of_the_page,
              check_thousands_of_jobs_and_workers, check_list_and_tabs, check_errors_and_effects,
              check_titles_are_text, check_keyboard, check_address_of_no_job,
              check_failures_of_a_job,
              check_accessibility, check_mouse, check_every_width, check_a_thousand_frames,
              check_frames_come_in_pages, check_an_empty_farm,
              check_no_console_errors, check_page_survives_a_restart]
    server = MadeUpServer()
    server.start(MADE_UP_JOB_COUNT, MADE_UP_WORKER_COUNT)
    try:
        with Browser() as browser:
            return run_checks(checks, browser, server)
    finally:
        server.stop()


def run_session():
    with Browser() as browser:
        return run_checks([check_session, check_submission_of_a_user], browser, None)


def main():
    parts = {"farm": run_farm, "made-up": run_made_up, "session": run_session}
    counts = [parts[name]() for name in sys.argv[1:] or parts]
    passed, failed = map(sum, zip(*counts))
    print(f"{passed} passed, {failed} failed")
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
