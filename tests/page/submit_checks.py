# Copyright the Sheaf authors.
# SPDX-License-Identifier: Apache-2.0
"""Submitting a scene by dropping it on the page. For page_test.py."""
import base64
import io
import json
import os
import urllib.error
import urllib.request
import zipfile

from axe_checks import check_accessible
from farm import wait_until
from secure_farm_test import SecureFarm
from session_checks import PATH, SIGN_IN
from viewer_checks import FOCUS, HIDDEN, TEXT

SECONDS_MAX = 20
READ_SECONDS_MAX = 60
ENTER, ESCAPE = "\ue007", "\ue00c"
SCENE = """LookAt 0 0 -5  0 0 0  0 1 0
Camera "perspective"
Film "rgb" "integer xresolution" 16 "integer yresolution" 16
Sampler "independent" "integer pixelsamples" 4
WorldBegin
LightSource "infinite" "rgb L" [1 1 1]
Include "parts/ball.pbrt"
"""
BALL = 'Shape "sphere"\n'
USD = """#usda 1.0
def NurbsPatch "Patch" {
}
def Mesh "Triangle" { int[] faceVertexCounts = [3]
    int[] faceVertexIndices = [0, 1, 2]
    point3f[] points = [(0, 0, 0), (1, 0, 0), (0, 1, 0)]
}
"""
BROKEN = SCENE.replace("Include", "Inklude")
DIALOG_IS_OPEN = "return document.getElementById('submit-dialog').open"
DISABLED = "return document.getElementById(arguments[0]).disabled"
# Drops files, each a name and its bytes in base64, as a script can.
DROP = """
  const transfer = new DataTransfer();
  for (const [name, bytes] of arguments[0]) {
    const decoded = Uint8Array.from(atob(bytes), (letter) => letter.charCodeAt(0));
    transfer.items.add(new File([decoded], name));
  }
  const options = {dataTransfer: transfer, bubbles: true, cancelable: true};
  document.body.dispatchEvent(new DragEvent("drop", options));"""
SET = """
  const field = document.getElementById(arguments[0]);
  field.value = arguments[1];"""


def put(folder, name, text):
    path = os.path.join(folder, name)
    os.makedirs(os.path.dirname(path), exist_ok=True)
    with open(path, "w", encoding="utf-8") as file:
        file.write(text)
    return path


def zip_of(files):
    packed = io.BytesIO()
    with zipfile.ZipFile(packed, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, text in files.items():
            archive.writestr(name, text)
    return packed.getvalue()


def drop_paths(browser, paths):
    """Drags files or folders of this machine over the page and drops them, as a user does."""
    def send(kind):
        browser.chrome("Input.dispatchDragEvent", type=kind, x=500, y=400,
                       data={"items": [], "files": paths, "dragOperationsMask": 1})

    def is_shown():
        # A drag lasts as long as the user holds the button; the first event reaches no element if
        # the page has not been painted.
        send("dragOver")
        return not browser.run(HIDDEN, "drop-overlay")

    def is_dropped():
        # The browser forgets a drag whose last event is old: a slow machine drags anew.
        if browser.run(DIALOG_IS_OPEN):
            return True
        if not browser.run(HIDDEN, "drop-overlay"):
            send("dragOver")
            send("drop")
        return browser.run(DIALOG_IS_OPEN)

    send("dragEnter")
    wait_until(is_shown, SECONDS_MAX, "the drop zone")
    words = browser.run(TEXT, "drop-words")
    assert words.startswith("Drop a scene"), words
    wait_until(is_dropped, SECONDS_MAX, "the dialog")
    assert browser.run(HIDDEN, "drop-overlay")


def drop_bytes(browser, files):
    encoded = [(name, base64.b64encode(data).decode()) for name, data in files.items()]
    browser.run(DROP, encoded)
    wait_until(lambda: browser.run(DIALOG_IS_OPEN), SECONDS_MAX, "the dialog")


def submit(browser):
    """Submits what was dropped by keyboard, and returns what the page then says."""
    wait_until(lambda: not browser.run(DISABLED, "submit-yes"), SECONDS_MAX, "the button")
    browser.run(FOCUS, "submit-yes")
    browser.press(ENTER)

    def end():
        state = browser.run(TEXT, "submit-state")
        return state if not state.endswith("…") else None

    return wait_until(end, READ_SECONDS_MAX, "the end of the submission")


def close(browser):
    browser.press(ESCAPE)
    wait_until(lambda: not browser.run(DIALOG_IS_OPEN), SECONDS_MAX, "the dialog's end")


def job_of(farm, state):
    assert state.startswith("Submitted as jobs/"), state
    name = state.removeprefix("Submitted as ").split(",")[0].rstrip(".")
    with urllib.request.urlopen(f"http://{farm.http}/api/v1/{name}", timeout=SECONDS_MAX) as answer:
        return json.load(answer)


def check_submission(browser, farm, screenshot):
    """A folder, a zip file and several scenes become jobs; a wrong scene is shown with its line.

    Needs no worker.
    """
    browser.set_size(1440, 900)
    browser.open("about:blank")
    browser.open(f"http://{farm.http}/")
    wait_until(lambda: not browser.run(HIDDEN, "submit-open"), SECONDS_MAX, "the button")
    folder = farm.path("dropped shot")
    put(folder, "ball scene.pbrt", SCENE)
    put(folder, "parts/ball.pbrt", BALL)
    drop_paths(browser, [folder])
    assert browser.run(TEXT, "submit-words").startswith("2 files, "), browser.run(
        TEXT, "submit-words")
    browser.run(SET, "submit-name", "dropped ball")
    browser.run(SET, "submit-samples", "8")
    screenshot("page-submit.png")
    check_accessible(browser)
    browser.set_size(1440, 900)
    state = submit(browser)
    job = job_of(farm, state)
    assert job["title"] == "dropped ball" and job["owner"] == "local", job
    assert job["frames"][0]["sample_count"] == 8, job["frames"]
    close(browser)
    wait_until(lambda: browser.run(TEXT, "job-title") == "dropped ball", SECONDS_MAX, "the job")

    packed = zip_of({"shot/room.pbrt": SCENE, "shot/parts/ball.pbrt": BALL})
    drop_bytes(browser, {"shot.zip": packed})
    job = job_of(farm, submit(browser))
    assert job["title"] == "room.pbrt" and job["frames"][0]["sample_count"] == 4, job
    close(browser)

    check_choice(browser, farm)
    check_usd(browser, farm)
    drop_bytes(browser, {"broken.pbrt": BROKEN.encode()})
    state = submit(browser)
    messages = browser.run(TEXT, "submit-messages")
    assert state == "The scene was refused:" and "broken.pbrt:7:" in messages, (state, messages)
    screenshot("page-submit-refused.png")
    close(browser)
    check_reach(browser, farm)
    check_keyboard(browser)
    assert not os.listdir(farm.path("state", "dropped")), "files of submissions are left"
    check_refused_requests(farm)


def check_choice(browser, farm):
    """The user chooses one of two scenes."""
    drop_bytes(browser, {"a.pbrt": SCENE.replace('Include "parts/ball.pbrt"', BALL).encode(),
                         "b.pbrt": BROKEN.encode()})
    state = submit(browser)
    assert state == "There are several scenes: choose one.", state
    choices = browser.run(
        "return [...document.getElementById('submit-scene').options].map((o) => o.text)")
    assert choices == ["a.pbrt", "b.pbrt"], choices
    browser.run(FOCUS, "submit-yes")
    browser.press(ENTER)
    wait_until(lambda: browser.run(TEXT, "submit-state").startswith("Submitted as"),
               READ_SECONDS_MAX, "the job of the chosen scene")
    assert job_of(farm, browser.run(TEXT, "submit-state"))["title"] == "a.pbrt"
    close(browser)


def check_usd(browser, farm):
    """USD becomes glTF in the browser, with notes; a broken file is refused with its line."""
    drop_bytes(browser, {"toy.usda": USD.encode()})
    assert job_of(farm, submit(browser))["title"] == "toy.usda.glb"
    messages = browser.run(TEXT, "submit-messages")
    assert "note: prims of the type NurbsPatch are left out (/Patch)" in messages, messages
    close(browser)
    drop_bytes(browser, {"toy.usda": USD.replace("[3]", "[3").encode()})
    state = submit(browser)
    messages = browser.run(TEXT, "submit-messages")
    assert state == "The scene was not submitted:" and "toy.usda: line " in messages, messages
    close(browser)


def check_reach(browser, farm):
    """A scene reads no file of the coordinator, by its name or through the folder."""
    secret = put(farm.path("state"), "secret.pbrt", BALL)
    for name in (secret, "../../../secret.pbrt"):
        scene = SCENE.replace("parts/ball.pbrt", name)
        drop_bytes(browser, {"reach.pbrt": scene.encode()})
        state = submit(browser)
        assert state == "The scene was refused:", (name, state)
        close(browser)


def check_keyboard(browser):
    """Without a mouse: the button, the choice of files, and back."""
    browser.run(FOCUS, "submit-open")
    browser.press(ENTER)
    wait_until(lambda: browser.run(DIALOG_IS_OPEN), SECONDS_MAX, "the dialog")
    assert browser.run("return document.activeElement.id") == "submit-files"
    assert browser.run(DISABLED, "submit-yes"), "nothing to submit"
    close(browser)
    assert browser.run("return document.activeElement.id") == "submit-open", "the focus is lost"


def post(farm, path, body=b""):
    """The status and the message of an answer."""
    request = urllib.request.Request(f"http://{farm.http}/api/v1/{path}", data=body, method="POST",
                                     headers={"X-Sheaf-Request": "1"})
    try:
        with urllib.request.urlopen(request, timeout=SECONDS_MAX) as answer:
            return answer.status, json.load(answer)
    except urllib.error.HTTPError as error:
        return error.code, json.load(error)["error"]["message"]


def check_refused_requests(farm):
    status, begun = post(farm, "submissions")
    assert status == 200, begun
    files = begun["name"] + "/files?name="
    for name in ("..%2Fa.pbrt", "%2Fetc%2Fpasswd", "a%2F..%2F..%2Fb", "a%5Cb", ""):
        status, message = post(farm, files + name, b"x")
        assert status == 400 and "is refused" in message, (name, status, message)
    piece = b"x" * (2 << 20)
    status, answer = post(farm, files + "a.pbrt", piece)
    assert (status, answer) == (200, {"size_bytes": len(piece)}), answer
    status, message = post(farm, files + f"a.pbrt&offset={3 << 20}", b"x")
    assert status == 400 and "continue there" in message, message
    assert post(farm, begun["name"] + ":discard")[0] == 200
    assert post(farm, begun["name"] + ":read")[0] == 404


def check_submission_of_a_user(browser, _):
    """With certificates the job belongs to who is signed in; the role view submits nothing."""
    with SecureFarm() as farm:
        for user, role in (("vera", "view"), ("sam", "submit")):
            farm.log_in(user, role)
            page, token = farm.person(user, "page").stdout.split()
            browser.open(page)
            browser.run(SIGN_IN, token)
            wait_until(lambda: browser.run(PATH) == "/" and
                       browser.run(TEXT, "connection-text") == "Live", SECONDS_MAX, "the page")
            wait_until(lambda: not browser.run(HIDDEN, "sign-out"), SECONDS_MAX, "the session")
            if role == "view":
                assert browser.run(HIDDEN, "submit-open"), "vera cannot submit"
                browser.run(FOCUS, "sign-out")
                browser.press(ENTER)
                wait_until(lambda: browser.run(PATH) == "/login", SECONDS_MAX, "the form")
        wait_until(lambda: not browser.run(HIDDEN, "submit-open"), SECONDS_MAX, "the button")
        drop_bytes(browser, {"shot.zip": zip_of({"a.pbrt": SCENE, "parts/ball.pbrt": BALL})})
        state = submit(browser)
        messages = browser.run(TEXT, "submit-messages")
        assert state.startswith("Submitted as jobs/1"), (state, messages)
        job = json.loads(farm.person("sam", "show", "jobs/1", "--json").stdout)
        assert job["owner"] == "sam", job
        assert any(line["what"] == "CreateJob" and line["who"].startswith("user:sam at 127.0.0.1")
                   for line in farm.audit())
        browser.open("about:blank")
