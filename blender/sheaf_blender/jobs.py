# Copyright the Sheaf authors.
# SPDX-License-Identifier: Apache-2.0
"""A render of one frame, on a farm or in one process: begin, poll, cancel. Needs no Blender."""
import json
import os
import re
import secrets
import shutil
import time

from .farm import program
from .farm.page import Page
from .farm.program import Process, SheafError

POLL_SECONDS = 0.1
PREVIEW_SECONDS_MIN = 0.5  # Between two previews.
CANCEL_ATTEMPTS_MAX = 5
# Endings of Blender's file formats.
IMAGE_ENDINGS = (".bmp", ".cin", ".dpx", ".exr", ".hdr", ".jp2", ".j2c", ".jpeg", ".jpg", ".png",
                 ".psd", ".rgb", ".rgba", ".sgi", ".tga", ".tif", ".tiff", ".tx", ".webp")
CANCEL_RETRY_SECONDS = 1.0


class RenderJob:
    """One frame that is rendered. output: the EXR that update() makes. Ends by cancel() or when
    update() returns True.
    """

    def __init__(self, sheaf, scene_path, output, options, title):
        self._sheaf, self._scene, self.output = sheaf, scene_path, output
        self._options, self.title = list(options), title
        self._process = None
        self._page = None
        self._page_problem = ""
        self._preview_time = 0.0
        self._shown_samples = 0
        self.state = None     # The last JSON of the job.
        self.preview_count = 0

    @property
    def notes(self):
        """The messages of `sheaf` about the scene."""
        messages = self._process.messages if self._process else []
        return [m.text for m in messages if m.severity in ("note", "warning")]

    @property
    def problem(self):
        """Why there are no tiles while the image is rendered; empty if there are."""
        if self.preview_count:
            return ""
        return self._page.problem if self._page else self._page_problem

    def preview(self):
        """The image so far (farm/images.decode_light), if there is a newer one; else None."""
        now = time.monotonic()
        if self.state is None or now - self._preview_time < PREVIEW_SECONDS_MIN:
            return None
        done = self.state["progress"]["sample_count_done"]
        if done == self._shown_samples or self._page is None:
            return None
        self._preview_time = now
        frame = self.state["frames"][0]["frame_number"] if self.state.get("frames") else 1
        pixels = self._page.preview(self.state["name"], frame)
        if pixels is not None:
            self._shown_samples = done
            self.preview_count += 1
        return pixels

    def _read(self):
        for state in self._process.read():
            if "progress" in state:
                self.state = state


class LocalRender(RenderJob):
    """`sheaf render`: coordinator and worker in one process, whose page gives the tiles."""

    def __init__(self, *arguments, threads=0):
        super().__init__(*arguments)
        # A folder of our own for the parts, which otherwise stay after an interruption.
        self._state_folder = self.output + ".state"
        self._process = Process(self._sheaf, [
            "render", self._scene, "-o", self.output, "--http", "127.0.0.1:0",
            "--threads", str(threads), "--keep-state", self._state_folder, *self._options])

    def update(self):
        """Whether the image is complete. Raises SheafError."""
        self._read()
        if self._page is None:
            urls = [match[1] for m in self._process.messages
                    if (match := re.match(r"watch at (http\S+)", m.text))]
            if urls:
                self._page = Page(urls[0])
        code = self._process.exit_code
        if code is None:
            return False
        if code != 0:
            raise SheafError(self._process.failure())
        self._clean()
        return True

    def cancel(self):
        self._process.end()
        self._clean()

    def _clean(self):
        shutil.rmtree(self._state_folder, ignore_errors=True)


class FarmRender(RenderJob):
    """`sheaf submit`, then `sheaf watch`. The title is unique: a cancelled submission finds by it
    a job whose name it never read.
    """

    def __init__(self, *arguments, address="", insecure=False, http_port=0):
        super().__init__(*arguments)
        self.title += f" [{secrets.token_hex(4)}]"
        self._address, self._insecure, self._http_port = address, insecure, http_port
        self._farm = program.address_arguments(address, insecure)
        self.name = None       # The job's, once known.
        self._created = ""     # When it was created.
        self._is_submitted = False
        self._submit_messages = []
        self._process = Process(self._sheaf, ["submit", self._scene, "--no-quote", "--title",
                                              self.title, *self._farm, *self._options])

    @property
    def notes(self):
        return [m.text for m in self._submit_messages
                if m.severity in ("note", "warning")] + super().notes

    def update(self):
        """Whether the image is here. Raises SheafError."""
        if not self._is_submitted:
            self._update_submission()
            return False
        self._read()
        if self.state is not None:
            check_identity(self.state, self._created)
        code = self._process.exit_code
        if code is None:
            return False
        if code != 0:
            raise SheafError(self._process.failure())
        return True

    def _update_submission(self):
        self._read_name()
        code = self._process.exit_code
        if code is None:
            return
        if code != 0:
            raise SheafError(self._process.failure())
        self._is_submitted, self._submit_messages = True, self._process.messages
        if self.name is None:
            raise SheafError("sheaf submit named no job; its version does not fit the add-on")
        self._process = Process(self._sheaf, ["watch", self.name, "-o", self.output, *self._farm])
        try:
            self._page = Page.of_farm(self._sheaf, self._address, self._insecure, self._http_port)
        except SheafError as error:
            self._page_problem = f"tiles are not shown: {error}"

    def cancel(self):
        """Leaves no job of this render on the farm. Raises SheafError if the coordinator does not
        answer."""
        self._process.end()
        self._read_name()
        for attempt in range(CANCEL_ATTEMPTS_MAX):
            try:
                names = [self.name] if self.name else program.unfinished_jobs(
                    self._sheaf, self.title, self._address, self._insecure)
                for name in names:
                    cancel(self._sheaf, name, self._address, self._insecure, self._created)
                return
            except SheafError:
                if attempt + 1 == CANCEL_ATTEMPTS_MAX:
                    raise
                time.sleep(CANCEL_RETRY_SECONDS)

    def _read_name(self):
        for answer in self._process.read():
            if self.name is None and "name" in answer:
                self.name, self._created = answer["name"], answer.get("create_time", "")


def submit_frames(sheaf, pattern, frames, options, title, address, insecure):
    """Submits 'shot.####.pbrt' as one job. Returns (its JSON, notes). Raises SheafError."""
    process = Process(sheaf, ["submit", pattern, "--frames", frames, "--no-quote", "--title", title,
                              *program.address_arguments(address, insecure), *options])
    answers = []
    while process.exit_code is None:
        answers += process.read()
        time.sleep(POLL_SECONDS)
    answers += process.read()
    if process.exit_code != 0 or not any("name" in answer for answer in answers):
        raise SheafError(process.failure())
    return ([answer for answer in answers if "name" in answer][-1],
            [m.text for m in process.messages])


def check_farm(sheaf, address, insecure):
    """Raises SheafError if the coordinator does not answer."""
    program.call(sheaf, ["list", "--limit", "1", *program.address_arguments(address, insecure)])


def job_state(sheaf, name, address, insecure, created=""):
    """The JSON of a job. created: its create_time when it was submitted, if that is known; numbers
    are given again when a coordinator's state is replaced. Raises SheafError.
    """
    state = json.loads(program.call(
        sheaf, ["show", name, *program.address_arguments(address, insecure)]).splitlines()[-1])
    check_identity(state, created)
    return state


def check_identity(state, created):
    if created and state["create_time"] != created:
        raise SheafError(f"{state['name']}: is another job now, since the coordinator's state was "
                         "replaced; submit again")


def cancel(sheaf, name, address, insecure, created=""):
    """Cancels a job. Raises SheafError."""
    job_state(sheaf, name, address, insecure, created)
    program.cancel(sheaf, name, address, insecure)


def output_pattern(path):
    """The EXR files that an output path of Blender means, with # where the number goes: the last
    run of # in the file's name, or four of them at its end. Blender replaces the ending of a known
    image format.
    """
    folder, name = os.path.split(path)
    if "#" not in name:
        name += "####"
    root, ending = os.path.splitext(name)
    return os.path.join(folder, (root if ending.lower() in IMAGE_ENDINGS else name) + ".exr")


def frame_path(pattern, frame):
    """A pattern's path for a frame."""
    folder, name = os.path.split(pattern)
    first, last = [match.span() for match in re.finditer("#+", name)][-1]
    return os.path.join(folder, f"{name[:first]}{frame:0{last - first}d}{name[last:]}")


def download(sheaf, name, output, address, insecure, created=""):
    """Waits for a job, and writes each image when it is complete. output: an output_pattern, or
    the path of a single frame's image. Raises SheafError, also if a frame has no image.
    """
    frames = job_state(sheaf, name, address, insecure, created)["frames"]
    if len(frames) == 1 and "#" in os.path.basename(output):
        output = frame_path(output, frames[0]["frame_number"])
    os.makedirs(os.path.dirname(output) or ".", exist_ok=True)
    process = Process(sheaf, ["watch", name, "-o", output,
                              *program.address_arguments(address, insecure)])
    while process.exit_code is None:
        for state in process.read():
            check_identity(state, created)
        time.sleep(POLL_SECONDS)
    if process.exit_code != 0:
        raise SheafError(process.failure())
