# Copyright the Sheaf authors.
# SPDX-License-Identifier: Apache-2.0
"""Exports one frame: the scene file, and the files it names in the content folder."""
import dataclasses
import os
import time

from ..scene import materials
from ..scene.content import ContentFolder
from ..scene.report import Report
from ..scene.text import SceneText
from . import camera, lights, world
from .collector import Collector
from .images import Images
from .scene_writer import SceneWriter, sphere_of



@dataclasses.dataclass
class Exported:
    path: str
    report: Report
    view_window: tuple  # Edges of the film at distance 1; empty unless perspective.
    seconds: float
    cpu_seconds: float
    files_written: int
    files_kept: int


@dataclasses.dataclass
class Settings:
    width: int
    height: int
    samples: int
    max_depth: int
    seed: int
    filter_type: str = "BLACKMAN_HARRIS"
    filter_width: float = 1.5
    window: tuple = ()  # x0, x1, y0, y1 of the film to render, from the top; empty: all.


def export_scene(depsgraph, path, content_root, settings, set_frame):
    """Writes the scene of depsgraph to path.

    set_frame(frame, subframe) evaluates depsgraph at another time, for motion blur. Raises OSError,
    and ValueError for scenes that cannot be written.
    """
    start, cpu_start = time.monotonic(), time.thread_time()
    scene = depsgraph.scene
    report = Report()
    content = ContentFolder(content_root)
    images = Images(content, report)
    shutter = camera.shutter_of(scene)
    frame = scene.frame_current + scene.frame_subframe
    if shutter is not None:
        _set_time(set_frame, frame + shutter[0])
    collector = Collector(depsgraph, content, images, report, shutter is not None)
    collector.collect()
    camera_object = scene.camera
    if camera_object is None:
        raise ValueError("the scene has no camera; add one (Add > Camera)")
    views = [camera.camera_from_world(camera_object.evaluated_get(depsgraph))]
    kind, camera_parameters = camera.parameters(camera_object.evaluated_get(depsgraph), scene,
                                                shutter, report)
    later = {}
    if shutter is not None:
        _set_time(set_frame, frame + shutter[1])
        later = collector.read_later()
        views.append(camera.camera_from_world(camera_object.evaluated_get(depsgraph)))
        _set_time(set_frame, frame)
    temporary = f"{path}.{os.getpid()}.partial"
    with open(temporary, "w", encoding="utf-8") as file:
        text = SceneText(file)
        _write_options(text, settings, views, kind, camera_parameters, shutter)
        text.raw("WorldBegin")
        textures = materials.TextureTable(text, images.file_of)
        world.write_world(text, scene.world, images, content, report)
        geometries = list(collector.geometries.values())
        sphere = sphere_of(geometries)
        for light_object, matrix in collector.lights:
            color = lights.color_of(light_object.data, report, images)
            lights.write_light(text, light_object, matrix, color, sphere, content, report)
        writer = SceneWriter(text, textures, images, report)
        writer.write(geometries, later)
    os.replace(temporary, path)
    if content.written:
        content.prune()
    return Exported(path, report,
                    camera_parameters.get("float screenwindow", ())
                    if kind == "perspective" else (), time.monotonic() - start,
                    time.thread_time() - cpu_start, content.written, content.kept)


def _set_time(set_frame, time_frames):
    whole = int(time_frames // 1)
    set_frame(whole, time_frames - whole)


def _write_options(text, settings, views, kind, camera_parameters, shutter):
    text.raw("# Written by Sheaf's add-on for Blender.")
    film = {"integer xresolution": settings.width, "integer yresolution": settings.height}
    if settings.window:
        film["integer pixelbounds"] = settings.window
    text.directive("Film", "rgb", film)
    text.directive(*_filter(settings))
    text.directive("Sampler", "zsobol", {"integer pixelsamples": settings.samples,
                                         "integer seed": settings.seed})
    text.directive("Integrator", "volpath", {"integer maxdepth": settings.max_depth})
    if shutter is not None:
        text.raw(f"TransformTimes {shutter[0]:.9g} {shutter[1]:.9g}")
    if len(views) == 2 and views[0] != views[1]:
        for when, view in zip(("StartTime", "EndTime"), views):
            text.raw("ActiveTransform " + when)
            text.transform("Transform", view)
        text.raw("ActiveTransform All")
    else:
        text.transform("Transform", views[0])
    text.directive("Camera", kind, camera_parameters)


# Cycles' filters: Gaussian exp(-2 (6 x / width)^2) within width / 2; the Blackman-Harris window,
# whose variance is that of a Gaussian of 0.1385 of its width.
_GAUSSIAN_SIGMA, _BLACKMAN_HARRIS_SIGMA = 1 / 12, 0.1385


def _filter(settings):
    if settings.filter_type == "BOX":
        return "PixelFilter", "box", {"float xradius": 0.5, "float yradius": 0.5}
    radius = settings.filter_width / 2
    sigma = settings.filter_width * (_GAUSSIAN_SIGMA if settings.filter_type == "GAUSSIAN"
                                     else _BLACKMAN_HARRIS_SIGMA)
    return "PixelFilter", "gaussian", {"float xradius": radius, "float yradius": radius,
                                       "float sigma": sigma}
