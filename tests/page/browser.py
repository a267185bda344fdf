# Copyright the Sheaf authors.
# SPDX-License-Identifier: Apache-2.0
"""Headless Chromium, driven through chromedriver by the WebDriver protocol.

Source: W3C WebDriver, https://www.w3.org/TR/webdriver2/. Needs the packages chromium and
chromium-driver and only Python's standard library.
"""
import base64
import json
import re
import subprocess
import time
import urllib.error
import urllib.request

from farm import wait_until

START_SECONDS_MAX = 60
CALL_SECONDS_MAX = 300  # Scripts that scroll through much take half a minute on a busy machine.
STILL_SECONDS_MAX = 10
DRAWING_SECONDS_MAX = 10
CHROMIUM_ARGUMENTS = [
    "--headless=new", "--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run",
    "--disable-background-networking", "--disable-component-update", "--disable-sync",
    "--disable-dev-shm-usage", "--hide-scrollbars", "--force-color-profile=srgb"]

# Whether the topmost element at a point is the given one or inside it.
IS_ON_TOP = """
  const [id, x, y] = arguments;
  return document.getElementById(id).contains(document.elementFromPoint(x, y));
"""
# Returns [the result of a function's body], or nothing while the page has views to draw.
IF_DRAWN = """
  const body = function() { %s
  };
  if (%s && "drawing" in document.documentElement.dataset) return [];
  return Promise.resolve(body(...arguments)).then((result) => [result]);
"""


class Browser:
    """One browser with one page; use with `with`. traced: notes tasks for task_cpu_ms."""

    def __init__(self, traced=False):
        self.traced = traced
        self.main_threads = set()  # Process and thread ids.
        self.driver = subprocess.Popen(["chromedriver", "--port=0"], stdin=subprocess.DEVNULL,
                                       stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)
        self.session = None
        for line in self.driver.stdout:
            started = re.search(r"started successfully on port (\d+)", line)
            if started:
                self.base = f"http://127.0.0.1:{started[1]}/session"
                break
        else:
            raise AssertionError("chromedriver did not start")

    def __enter__(self):
        options = {"binary": "/usr/bin/chromium", "args": CHROMIUM_ARGUMENTS}
        capabilities = {"browserName": "chrome", "goog:chromeOptions": options,
                        "acceptInsecureCerts": True, "goog:loggingPrefs": {"browser": "ALL"},
                        "timeouts": {"script": 1000 * CALL_SECONDS_MAX}}
        if self.traced:
            capabilities["goog:loggingPrefs"]["performance"] = "ALL"
            options["perfLoggingPrefs"] = {"enableNetwork": False, "enablePage": False,
                                           "traceCategories": "toplevel"}
        answer = self._call("POST", "", {"capabilities": {"alwaysMatch": capabilities}},
                            seconds=START_SECONDS_MAX)
        self.session = answer["sessionId"]
        return self

    def __exit__(self, *_):
        try:
            if self.session:
                self._call("DELETE", f"/{self.session}")
        finally:
            self.driver.terminate()
            self.driver.wait()
            self.driver.stdout.close()

    def _call(self, method, path, body=None, seconds=CALL_SECONDS_MAX):
        data = None if body is None else json.dumps(body).encode()
        request = urllib.request.Request(self.base + path, data=data, method=method,
                                         headers={"Content-Type": "application/json"})
        try:
            with urllib.request.urlopen(request, timeout=seconds) as response:
                return json.load(response)["value"]
        except urllib.error.HTTPError as error:
            value = json.load(error)["value"]
            text = f"{method} {path}: {value['error']}: {value['message']}"
            raise AssertionError(text) from error

    def _do(self, method, path, body=None):
        return self._call(method, f"/{self.session}{path}", body)

    def open(self, url):
        self._do("POST", "/url", {"url": url})

    def run(self, script, *arguments):
        """Runs the body of a function in the page and returns its result.

        Waits until every view shows what the page knows: views of one change are drawn in several
        animation frames.
        """
        end = time.monotonic() + DRAWING_SECONDS_MAX
        while True:
            waits = "true" if time.monotonic() < end else "false"
            answer = self._do("POST", "/execute/sync",
                              {"script": IF_DRAWN % (script, waits), "args": list(arguments)})
            if answer:
                return answer[0]
            time.sleep(0.01)

    def chrome(self, command, **parameters):
        """Sends a command of the DevTools protocol."""
        return self._do("POST", "/goog/cdp/execute", {"cmd": command, "params": parameters})

    def run_before_pages(self, script):
        """Runs the script in every page opened from now on, before the page's own scripts."""
        self.chrome("Page.addScriptToEvaluateOnNewDocument", source=script)

    def set_size(self, width_px, height_px, device_scale=1):
        self.chrome("Emulation.setDeviceMetricsOverride", width=width_px, height=height_px,
                    deviceScaleFactor=device_scale, mobile=False)

    def set_dark(self, dark):
        self.chrome("Emulation.setEmulatedMedia", features=[
            {"name": "prefers-color-scheme", "value": "dark" if dark else "light"}])

    def task_cpu_ms(self):
        """CPU times of the tasks of the pages' main threads since the last call, in milliseconds.

        Other programs lengthen a task's wall time, not this. Needs traced."""
        log = [json.loads(entry["message"])["message"]
               for entry in self._do("POST", "/se/log", {"type": "performance"})]
        events = [entry["params"] for entry in log if entry["method"] == "Tracing.dataCollected"]
        self.main_threads |= {(event["pid"], event["tid"]) for event in events
                              if event.get("name") == "thread_name"
                              and event["args"]["name"] == "CrRendererMain"}
        return [event["tdur"] / 1000 for event in events
                if event.get("ph") == "X" and event["name"].endswith("::RunTask")
                and "tdur" in event and (event["pid"], event["tid"]) in self.main_threads]

    def press(self, key):
        """Presses one key on the focused element."""
        self._do("POST", "/actions", {"actions": [{"type": "key", "id": "keyboard", "actions": [
            {"type": "keyDown", "value": key}, {"type": "keyUp", "value": key}]}]})

    def _mouse(self, kind, x_px, y_px, **more):
        self.chrome("Input.dispatchMouseEvent", type=kind, x=x_px, y=y_px, **more)

    def turn_wheel(self, place, delta_px):
        """Turns the wheel towards the user by `delta_px` at (x, y)."""
        self._mouse("mouseWheel", *place, deltaX=0, deltaY=delta_px)

    def click_at(self, x_px, y_px):
        place = (x_px, y_px)
        self._mouse("mousePressed", *place, button="left", buttons=1, clickCount=1)
        self._mouse("mouseReleased", *place, button="left", clickCount=1)

    def click(self, element_id):
        """Clicks in the middle of an element once it is visible and stands still: content that
        arrives above it moves it.
        """
        before = None

        def is_still():
            nonlocal before
            last, before = before, self.middle_of(element_id)
            return before == last and self.run(IS_ON_TOP, element_id, *before)

        wait_until(is_still, STILL_SECONDS_MAX, f"{element_id} to stand still in sight")
        self.click_at(*before)

    def drag(self, start, end):
        """Presses the left button at `start` and releases it at `end`."""
        self._mouse("mousePressed", *start, button="left", buttons=1, clickCount=1)
        self._mouse("mouseMoved", *end, button="left", buttons=1)
        self._mouse("mouseReleased", *end, button="left", clickCount=1)

    def middle_of(self, element_id):
        return self.run("""
          const frame = document.getElementById(arguments[0]).getBoundingClientRect();
          return [frame.left + frame.width / 2, frame.top + frame.height / 2];""", element_id)

    def screenshot(self, path):
        with open(path, "wb") as file:
            file.write(base64.b64decode(self._do("GET", "/screenshot")))

    def console_errors(self):
        """Severe console messages since the last call."""
        entries = self._do("POST", "/se/log", {"type": "browser"})
        return [entry["message"] for entry in entries if entry["level"] == "SEVERE"]
