# Copyright the Sheaf authors.
# SPDX-License-Identifier: Apache-2.0
"""Exports one frame: the scene file, and the files it names in the content folder."""
import dataclasses
import io
import os
import shutil
import time

import mathutils
import numpy

from ..scene import materials, ray_visibility
from ..scene.content import ContentFolder
from ..scene.report import Report
from ..scene.text import SceneText
from . import camera, clipping, inside_of, lights, motion, shaders, world
from .collector import Collector
from .images import Images
from .light_groups import LightGroups
from .settings import note_all as note_settings
from .scene_writer import SceneWriter, sphere_of

CAMERA_UNEVEN_MAX = 1e-3  # Difference of the elements of its matrix from those of its even motion.


@dataclasses.dataclass
class Exported:
    path: str
    report: Report
    view_window: tuple  # Edges of the film at distance 1; empty unless perspective.
    sky: object         # A Sky, to take it out of the image.
    groups: object      # LightGroups.
    holdouts: set       # Names of objects that F12 cuts out of the image,
    catchers: set       # and of its shadow catchers.
    has_ray_kinds: bool  # Whether some kinds of rays do not see all.
    seconds: float
    cpu_seconds: float
    files_written: int
    files_kept: int


@dataclasses.dataclass(frozen=True)
class Sky:
    """The sky as the camera sees it. world_from_camera: of a camera that looks along z."""
    background: world.Background
    world_from_camera: object
    window: tuple
    kind: str

    def radiance(self, size, crop, background=None):
        """(height, width, 3) at the centers of the pixels, rows from the top; None for panoramas.
        crop: x0, x1, y0, y1 or (). background: in place of that which lights the scene.
        """
        if self.kind == "spherical":
            return None
        x0, x1, y0, y1 = crop or (0, size[0], 0, size[1])
        left, right, bottom, top = self.window
        x = left + (right - left) * (numpy.arange(x0, x1) + 0.5) / size[0]
        y = top + (bottom - top) * (numpy.arange(y0, y1) + 0.5) / size[1]
        x, y = numpy.meshgrid(x, y)
        if self.kind == "orthographic":
            x, y = 0 * x, 0 * y
        turn = numpy.array(self.world_from_camera.to_3x3())
        return (background or self.background).radiance(
            numpy.stack([x, y, 0 * x + 1], axis=-1) @ turn.T)


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
    has_groups: bool = True    # Whether the image has layers of light groups,
    is_corrected: bool = True  # and F12 makes the frame of it.
    is_shown: object = None    # Whether an object is seen at all: of the viewport; None: all are.
    catchers: str = ""  # Shadow catchers: "" as usual objects, "unseen" by the camera, or "alone".


def export_scene(depsgraph, path, content_root, settings, set_frame, view):
    """Writes the scene of depsgraph to path.

    set_frame(frame, subframe) evaluates depsgraph at another time, for motion blur; view: the
    camera, see camera.state. Raises OSError, and ValueError for scenes that cannot be written.
    """
    start, cpu_start = time.monotonic(), time.thread_time()
    report = Report()
    content = ContentFolder(content_root)
    header, body = io.StringIO(), io.StringIO()
    window, sky, *others = _write_scene(depsgraph, header, body, content, report, settings,
                                        set_frame, view)
    temporary = f"{path}.{os.getpid()}.partial"
    with open(temporary, "w", encoding="utf-8") as file:
        for part in (header, body):
            part.seek(0)
            shutil.copyfileobj(part, file)
    os.replace(temporary, path)
    if content.written:
        with report.guard("content folder"):
            content.prune()
    return Exported(path, report, window, sky, *others, time.monotonic() - start,
                    time.thread_time() - cpu_start, content.written, content.kept)


def _write_scene(depsgraph, header, body, content, report, settings, set_frame, view):
    """Returns Exported.view_window to has_ray_kinds. All values are those at the frame;
    only what moves is read at other times.
    """
    scene = depsgraph.scene_eval
    exposure = getattr(getattr(scene, "cycles", None), "film_exposure", 1.0)
    if view.object is None and view.region is None:
        raise ValueError("the scene has no camera; add one (Add > Camera)")
    images = Images(content, report)
    shutter = None
    with report.guard("motion blur"):
        if depsgraph.view_layer_eval.use_motion_blur and view.region is None:
            shutter = camera.shutter_of(scene)
    collector = Collector(depsgraph, content, images, report, shutter is not None,
                          settings.catchers, settings.is_shown)
    with report.guard("scene"):
        collector.collect()
    camera_object = view.object.evaluated_get(depsgraph) if view.object else None
    item = f'camera "{camera_object.name}"' if camera_object else "view"
    kind = view.region.kind if view.region else camera.kind_of(camera_object.data)
    states = [camera.state(view, depsgraph, scene)]
    camera_parameters = camera.parameters(kind, states[0])
    with report.guard(item):
        camera_parameters.update(camera.lens_parameters(camera_object, scene, states[0], shutter,
                                                        report))
    text = SceneText(body)
    groups = LightGroups(depsgraph.view_layer_eval, settings.has_groups, settings.is_corrected,
                         report)
    writer = SceneWriter(text, materials.TextureTable(text, images.file_of), images, content,
                         exposure, report, groups)
    text.raw("WorldBegin")
    geometries = list(collector.geometries.values())
    clips = {}
    with report.guard(item):
        if not view.region:
            clips = clipping.parameters(camera_object.data, states[0], geometries)
        camera_parameters.update(clips)
    view_now = camera.views_of(states, kind)[0]
    for place in collector.lights:
        with report.guard(f'light "{place.name}"'):
            place.is_seen = view.region is not None or lights.is_in_view(
                place, view_now, states[0].window, kind)
            place.is_around = lights.is_around(place, view_now)
    sphere = mathutils.Vector((0, 0, 0)), 1.0
    with report.guard("scene"):
        sphere = sphere_of(geometries)
    with report.guard("settings"):
        note_settings(depsgraph, camera_object, collector, report)
    background = _write_sky(text, depsgraph, exposure, images, content, report, groups)
    _fill_world(writer, depsgraph, images, report)
    _write_lights(text, collector.lights, exposure, sphere, images, content, report, groups)
    moved = None
    if shutter is not None:
        with report.guard("motion blur"):
            moved = _read_motion(depsgraph, collector, states, kind, settings, set_frame, shutter,
                                 view)
            motion.write_deformed(moved, collector, content, report)
            motion.note_lights(moved, collector, report)
            states += _camera_motion(moved, camera_object, states[0], report)
    with report.guard("scene"):
        writer.write(geometries, moved)
    medium = ""
    with report.guard(item):
        medium = writer.write_camera_medium(
            inside_of.media_at(geometries, states[0].matrix.translation), item)
        if "float farclip" in clips and (medium or collector.has_media()):
            report.approximated(item, "Clip End: volumes end there, too; those of Cycles continue "
                                      "behind it")
    options = SceneText(header)
    _write_options(options, settings, shutter)
    _write_camera(options, camera.views_of(states, kind), kind, camera_parameters, medium)
    return (states[0].window if kind == "perspective" else (),
            Sky(background, camera.camera_from_world(states[0].matrix).inverted_safe(),
                states[0].window, kind), groups, collector.holdouts,
            collector.catchers, text.has_ray_kinds or bool(clips))


def _write_sky(text, depsgraph, exposure, images, content, report, groups):
    """The world of the layer; returns its world.Background."""
    layer = depsgraph.view_layer_eval
    chosen = getattr(layer, "world_override", None) or depsgraph.scene_eval.world
    background = world.Background()
    if layer.use_sky and chosen is not None:
        with report.guard(f'world "{chosen.name}"'):
            parameters = groups.parameters(getattr(chosen, "lightgroup", ""))
            hidden = ray_visibility.hidden_from_world(getattr(chosen, "cycles_visibility", None))
            parameters = {**parameters, **ray_visibility.parameter(hidden, is_lamp=True)}
            with text.whole(), text.lights_with(parameters):
                background = world.write_world(text, depsgraph.scene, chosen, exposure, images,
                                               content, report)
    return background


def _fill_world(writer, depsgraph, images, report):
    layer = depsgraph.view_layer_eval
    chosen = getattr(layer, "world_override", None) or depsgraph.scene_eval.world
    if chosen is None or not layer.use_sky or not layer.use_volumes:
        return
    with report.guard(f'world "{chosen.name}"'):
        found = shaders.read_world_volume(chosen, report, images)
        if found is not None:
            writer.fill_world(found)


def _write_lights(text, places, exposure, sphere, images, content, report, groups):
    for place in places:
        with report.guard(f'light "{place.name}"'), text.whole():
            color = lights.color_of(place.light, exposure, report, images)
            lights.write_light(text, place, color, sphere, content, report, groups)


def _read_motion(depsgraph, collector, states, kind, settings, set_frame, shutter, view):
    scene = depsgraph.scene
    frame = scene.frame_current + scene.frame_subframe
    length = shutter[1] - shutter[0]

    def set_fraction(fraction):
        _set_time(set_frame, frame + shutter[0] + fraction * length)
    try:
        return motion.read(depsgraph, collector,
                           lambda: camera.state(view, depsgraph, depsgraph.scene_eval),
                           set_fraction, -shutter[0] / length,
                           camera.pixel_sizes(states[0], kind, (settings.width, settings.height)))
    finally:
        _set_time(set_frame, frame)


def _camera_motion(moved, camera_object, at_frame, report):
    """The States when the shutter opens and closes; none if the camera stands still."""
    if not getattr(getattr(camera_object, "cycles", None), "use_motion_blur", True):
        return []
    found = [snapshot.camera for snapshot in moved.snapshots]
    item = f'camera "{camera_object.name}"'
    if any(one.lens != at_frame.lens for one in found):
        report.approximated(item, "its depth of field is that at the frame while the shutter is "
                                  "open")
    for i, one in enumerate(found):
        even = motion.interpolated(found[0].matrix, found[-1].matrix, i / (len(found) - 1))
        if max(abs(x - y) for row, other in zip(even, one.matrix)
               for x, y in zip(row, other)) > CAMERA_UNEVEN_MAX:
            report.approximated(item, "its motion while the shutter is open is made even")
            break
    return [found[0], found[-1]]


def _set_time(set_frame, time_frames):
    whole = int(time_frames // 1)
    set_frame(whole, time_frames - whole)


def view_text(settings, region):
    """The directives before WorldBegin for another view of a scene that is exported already.
    region: a region_view.Region.
    """
    text = io.StringIO()
    write = SceneText(text)
    _write_film(write, settings)
    found = camera.parameters(region.kind, region.state)
    found.update(camera.lens_parameters(region.lens_object, None, region.state, None, Report()))
    _write_camera(write, camera.views_of([region.state], region.kind), region.kind, found, "")
    return text.getvalue()


def _write_film(text, settings):
    film = {"integer xresolution": settings.width, "integer yresolution": settings.height}
    if settings.window:
        film["integer pixelbounds"] = settings.window
    text.directive("Film", "rgb", film)
    text.directive(*_filter(settings))
    text.directive("Sampler", "zsobol", {"integer pixelsamples": settings.samples,
                                         "integer seed": settings.seed})


def _write_options(text, settings, shutter):
    text.raw("# Written by Sheaf's add-on for Blender.")
    _write_film(text, settings)
    text.directive("Integrator", "volpath", {"integer maxdepth": settings.max_depth})
    if shutter is not None:
        text.raw(f"TransformTimes {shutter[0]:.9g} {shutter[1]:.9g}")


def _write_camera(text, views, kind, camera_parameters, medium):
    """medium: the name of that around the camera; empty for none."""
    if views[0] != views[-1]:
        for when, view in zip(("StartTime", "EndTime"), views):
            text.raw("ActiveTransform " + when)
            text.transform("Transform", view)
        text.raw("ActiveTransform All")
    else:
        text.transform("Transform", views[0])
    if medium:
        text.directive("MediumInterface", "", medium)
    text.directive("Camera", kind, camera_parameters)
    if medium:
        text.directive("MediumInterface", "", "")


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
