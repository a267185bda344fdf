# Copyright the Sheaf authors.
# SPDX-License-Identifier: Apache-2.0
"""Rendered shading in the 3D viewport: exports the scene when it changes, asks `sheaf view` for
images when the view does, and draws the newest one.
"""
import functools
import hashlib
import os
import shutil
import tempfile
import time
import weakref

import bpy
import numpy

from . import passes
from .chosen import content_folder
from .export import region_view
from .export.camera import camera_from_world
from .export.scene_export import export_scene, view_text
from .farm.program import SheafError
from .farm.view_process import ViewProcess
from .scene.report import cause

TICK_SECONDS = 0.05
# A scene that was exported in less time is exported at each change, another one when nothing has
# changed for as long as the pause.
QUICK_EXPORT_SECONDS = 0.1
PAUSE_SECONDS = 0.4
PRESENT = weakref.WeakSet()  # All Viewports.
STARTS_MAX = 3  # A process that ends by itself is started again, if there was an image since.


class Viewport:
    """One region's render. close() ends its process; so does the end of the engine."""

    def __init__(self, engine, settings_of, sheaf_of):
        """settings_of(scene): its Settings without a size; sheaf_of(): the program's path and the
        number of threads, may raise SheafError.
        """
        self._engine = weakref.ref(engine)
        self._settings_of, self._sheaf_of = settings_of, sheaf_of
        self._folder = tempfile.mkdtemp(prefix="sheaf-viewport-")
        self._process = None
        self._starts = 0
        self._changed = None        # When the scene last changed; None: it is exported.
        self._export_seconds = 0.0
        self._exported = None       # The last export,
        self._path = ""             # its file,
        self._content = None        # and what tells it from others.
        self._asked = None          # The Region of the last request,
        self._regions = {}          # and those of requests whose images may still come.
        self._shown = None          # (texture, place of it in parts of the region).
        self._samples = 0
        self.problem = ""
        PRESENT.add(self)
        bpy.app.timers.register(functools.partial(_tick, weakref.ref(self)),
                                first_interval=TICK_SECONDS)

    @property
    def has_scene(self):
        return self._exported is not None

    def note_change(self):
        self._changed = time.monotonic()

    @property
    def is_export_due(self):
        """Whether the scene has changed, and not just now."""
        if self._changed is None:
            return False
        return (self._exported is None or self._export_seconds < QUICK_EXPORT_SECONDS
                or time.monotonic() - self._changed >= PAUSE_SECONDS)

    def export(self, depsgraph, region, camera_object, is_shown):
        """Exports the scene, and asks for its image. Raises nothing."""
        self._changed = None
        self._starts = 0
        path = os.path.join(self._folder, f"{time.monotonic_ns()}.pbrt")
        try:
            settings = self._settings(depsgraph.scene_eval, region)
            settings.is_shown = is_shown
            start = time.monotonic()
            self._exported = export_scene(
                depsgraph, path, content_folder(), settings, None,
                region_view.RegionView(region, camera_object))
            self._export_seconds = time.monotonic() - start
            self._take(path, depsgraph, region)
        except (SheafError, ValueError, OSError) as error:
            self.problem = str(error)
        except Exception as error:  # As for render(): none may leave the engine's functions.
            self.problem = f"the scene cannot be exported: {cause(error)}"
        return self._exported

    def _take(self, path, depsgraph, region):
        """Shows an exported scene, unless it is the one that is shown: a selection is a change for
        Blender, too.
        """
        scene, seen = depsgraph.scene_eval, self._exported.sky.background.seen
        content = (_content_of(path), scene.render.film_transparent,
                   passes.hides_sky(scene, depsgraph.view_layer_eval))
        if (content == self._content and seen is None and not self.problem
                and self._process is not None and self._process.is_alive):
            _remove(path)
            return
        if self._path:
            _remove(self._path)
        self._path, self._content = path, content
        self._ask(scene, region, path)

    def look(self, scene, region):
        """Asks for an image of the exported scene from this side, if it is another one."""
        if self._exported is None or region.is_like(self._asked):
            return
        try:
            self._ask(scene, region)
        except (SheafError, ValueError, OSError) as error:
            self.problem = str(error)

    def _settings(self, scene, region):
        settings = self._settings_of(scene)
        settings.width, settings.height = region.size
        settings.window = region.window
        return settings

    def _ask(self, scene, region, path=""):
        if self._process is not None and not self._process.is_alive:
            self.problem = self._process.problem
            self._process = None
        if self._process is None:
            if self._starts >= STARTS_MAX:
                raise SheafError(self.problem or "sheaf view ends at once")
            self._starts += 1
            self._process, self._regions = ViewProcess(*self._sheaf_of()), {}
            path = self._path
        asked = self._process.ask(path, view_text(self._settings(scene, region), region))
        self._asked, self._samples = region, 0
        self._regions = {id: one for id, one in self._regions.items() if id >= asked - 100}
        self._regions[asked] = region
        self.problem = ""

    def tick(self):
        """Has the engine called where something is to be done. False if the engine is gone."""
        engine = self._engine()
        if engine is None:
            return False
        try:
            if self.is_export_due:
                engine.tag_update()
            elif self._process is not None and (self._process.has_news or self._is_lost()):
                engine.tag_redraw()
        except ReferenceError:  # Blender has freed it.
            return False
        return True

    def _is_lost(self):
        """Whether the process ended by itself, or could not do what was asked."""
        found = self._process.problem
        if not found or found == self.problem:
            return False
        self.problem = found
        if not self._process.is_alive:
            self._asked = None  # The next draw() starts another one.
        return True

    def newest(self, scene, view_layer):
        """(pixels, place) of an image that was not drawn yet; else None. pixels: (height, width, 4)
        with rows from the bottom, premultiplied, or opaque where the film is; place: left, bottom,
        width and height in parts of the region.
        """
        frame = self._process.take() if self._process is not None else None
        if frame is None or frame.id not in self._regions:
            return None
        self._starts = 0
        if frame.id == max(self._regions):
            self._samples = frame.samples if frame.divisor == 1 else 0
        pixels = frame.pixels.copy()
        self._finish(pixels, frame, self._regions[frame.id], scene, view_layer)
        x0, y0, x1, y1 = frame.place
        width, height = frame.film
        return (numpy.ascontiguousarray(pixels[::-1]),
                (x0 / width, 1 - y1 / height, (x1 - x0) / width, (y1 - y0) / height))

    def _finish(self, pixels, frame, region, scene, view_layer):
        """The sky as the camera sees it, and alpha."""
        hides, background = passes.hides_sky(scene, view_layer), self._exported.sky.background
        seen = background.seen
        if hides or seen is not None:
            sky = type(self._exported.sky)(
                background, camera_from_world(region.state.matrix).inverted_safe(),
                region.state.window, region.kind)
            size = frame.film[0] / frame.divisor, frame.film[1] / frame.divisor
            crop = (frame.place[0] // frame.divisor,
                    frame.place[0] // frame.divisor + pixels.shape[1],
                    frame.place[1] // frame.divisor,
                    frame.place[1] // frame.divisor + pixels.shape[0])
            lit = sky.radiance(size, crop)
            if hides:
                passes.take_out_sky(pixels, pixels[..., 3].copy(), lit)
            else:
                passes.replace_sky(pixels, pixels[..., 3].copy(), lit,
                                   sky.radiance(size, crop, seen))
        if not scene.render.film_transparent:
            pixels[..., 3] = 1

    def draw(self, scene, view_layer, size):
        """Draws the newest image over the region. Called with the region's frame buffer bound."""
        found = self.newest(scene, view_layer)
        if found is not None:
            self._shown = _texture(found[0]), found[1]
        if self._shown is None:
            return
        import gpu
        from gpu_extras.presets import draw_texture_2d
        texture, (left, bottom, width, height) = self._shown
        gpu.state.blend_set("ALPHA_PREMULT")
        draw_texture_2d(texture, (left * size[0], bottom * size[1]), width * size[0],
                        height * size[1])
        gpu.state.blend_set("NONE")

    @property
    def status(self):
        """A line for the corner of the region."""
        if self.problem:
            return f"Sheaf: {self.problem}"
        if self._changed is not None or self._process is None:
            return "Sheaf: waiting for the scene"
        return f"Sheaf: {self._samples} samples" if self._samples else "Sheaf: rendering"

    def close(self):
        if self._process is not None:
            self._process.end()
            self._process = None
        shutil.rmtree(self._folder, ignore_errors=True)

    def __del__(self):
        self.close()


def _tick(reference):
    """A timer of Blender: seconds until the next call, None for no other."""
    viewport = reference()
    if viewport is None:
        return None
    if viewport.tick():
        return TICK_SECONDS
    viewport.close()
    return None


def _texture(pixels):
    import gpu
    height, width = pixels.shape[:2]
    data = gpu.types.Buffer("FLOAT", 4 * width * height, pixels.reshape(-1))
    return gpu.types.GPUTexture((width, height), format="RGBA16F", data=data)


def _content_of(path):
    """A digest of a scene file without its view."""
    digest, is_header = hashlib.sha256(), True
    with open(path, "rb") as file:
        for line in file:
            is_header = is_header and not line.startswith(b"WorldBegin")
            if not is_header or not line.startswith((b"Film", b"Transform", b"Camera")):
                digest.update(line)
    return digest.digest()


def _remove(path):
    try:
        os.remove(path)
    except OSError:
        pass
