# Copyright the Sheaf authors.
# SPDX-License-Identifier: Apache-2.0
"""The render engine: exports the scene, follows the render, shows its tiles, ends with Esc."""
import dataclasses
import os
import shutil
import tempfile
import time

import bpy
import numpy

from . import catchers, jobs, passes
from .chosen import content_folder, preferences, threads
from .export.collector import affine
from .export.scene_export import Settings, export_scene
from .farm import images, program
from .farm.program import SheafError
from .scene import frame_size
from .scene.ray_visibility import known_techniques
from .scene.report import Report, cause
from .viewport_engine import ViewportEngine

# Reports of each scene's last export, by the scene's name; the panel shows them.
LAST_REPORTS = {}
REPORT_TEXT = "Sheaf report"
CATCHER_NOTE = ("Shadow Catcher: it is visible, as other objects; F12 renders its shadows, but not "
                "in panoramas")
HOLDOUT_NOTE = "Holdout: it is visible; F12 cuts it out of the image"
EYES = ("left", "right")  # Blender's names of the views of stereo cameras.


class ExportOnly:
    """While there is one, renders only write scene files; see operators.py."""
    present = None

    def __init__(self, pattern, both_eyes=False):
        """both_eyes: the files are of the camera between the eyes, for `--stereo`."""
        self.pattern, self.both_eyes, self.exported = pattern, both_eyes, []
        self._taken = set()

    def path(self, frame):
        return self.pattern.replace("####", f"{frame:04d}")

    def takes(self, frame):
        """Whether this is the first layer and view of the frame: a frame is one file."""
        if frame in self._taken:
            return False
        self._taken.add(frame)
        return True


class SheafRenderEngine(ViewportEngine, bpy.types.RenderEngine):
    bl_idname = "SHEAF"
    bl_label = "Sheaf"
    bl_use_preview = False
    bl_use_postprocess = True
    bl_use_eevee_viewport = True
    bl_use_shading_nodes_custom = False

    def update_render_passes(self, scene=None, renderlayer=None):
        self.register_pass(scene, renderlayer, "Combined", 4, "RGBA", "COLOR")
        for name, channels, ids, kind in passes.chosen_passes(scene, renderlayer):
            self.register_pass(scene, renderlayer, name, channels, ids, kind)

    def render(self, depsgraph):
        try:
            for view in self._views(depsgraph.view_layer_eval):
                self._render_view(depsgraph, view)
                if self.test_break():
                    return
        except (SheafError, images.ImageError, ValueError, OSError) as error:
            self._fail(f"Sheaf: {error}")
        except Exception as error:  # Blender 3.4 crashes later if one leaves this function.
            self._fail(f"Sheaf: the frame cannot be rendered: {cause(error)}")

    def note_view(self, depsgraph, exported):
        """Keeps the report of a viewport's scene for the panel."""
        scene, report = depsgraph.scene_eval, exported.report
        for name in sorted(exported.catchers):
            report.left_out(f'object "{name}"', CATCHER_NOTE)
        for name in sorted(exported.holdouts):
            report.approximated(f'object "{name}"', HOLDOUT_NOTE)
        LAST_REPORTS[scene.name] = report

    def _fail(self, text):
        self.report({"ERROR"}, text)
        self.error_set(text)

    def _views(self, view_layer):
        """The names of the views of the scene, as "left" and "right"; [""] if there is one."""
        if not self.render.use_multiview:
            return [""]
        result = self.begin_result(0, 0, 1, 1, layer=view_layer.name)
        names = [view.name for view in result.views]
        self.end_result(result, cancel=True, highlight=False, do_merge_results=False)
        return names if len(names) > 1 else [""]

    def _render_view(self, depsgraph, view):
        self._layer = depsgraph.view_layer_eval
        if view:
            self.active_view_set(view)
        folder = tempfile.mkdtemp(prefix="sheaf-blender-")
        try:
            only = ExportOnly.present
            if only is not None and not only.takes(depsgraph.scene.frame_current):
                return
            exported = self._export(depsgraph, folder, view)
            if only is not None:
                only.exported.append(exported)
            elif not self.test_break():
                self._render(depsgraph, exported, folder, view)
        finally:
            shutil.rmtree(folder, ignore_errors=True)

    def _export(self, depsgraph, folder, view):
        scene = depsgraph.scene_eval
        self.update_stats("", "Sheaf: exporting")
        both_eyes = ExportOnly.present is not None and ExportOnly.present.both_eyes
        views = EYES if both_eyes else (view,)
        path = (ExportOnly.present.path(depsgraph.scene.frame_current) if ExportOnly.present
                else os.path.join(folder, "main.pbrt"))
        exported = export_scene(depsgraph, path, content_folder(), self._settings(scene),
                                lambda frame, subframe: self.frame_set(frame, subframe),
                                ViewCamera(self, scene, *views))
        if ExportOnly.present is not None or not self._has_catchers(exported):
            for name in sorted(exported.catchers):
                exported.report.left_out(f'object "{name}"', CATCHER_NOTE)
        keeps_sky = ExportOnly.present is not None or exported.sky.kind == "spherical"
        passes.left_out(scene, depsgraph.view_layer_eval, exported.report, keeps_sky)
        if ExportOnly.present is not None:
            for name in sorted(exported.holdouts):
                exported.report.approximated(f'object "{name}"', HOLDOUT_NOTE)
        if keeps_sky and exported.sky.background.seen is not None:
            exported.report.approximated("world", "Is Camera Ray: the camera sees the world that "
                                                  "lights the scene; F12 shows the other one")
        if ExportOnly.present is not None:
            _note_one_image(depsgraph.scene, depsgraph.view_layer_eval, "" if both_eyes else view,
                            exported.report)
        options = job_options(scene, depsgraph.view_layer_eval)
        if exported.has_ray_kinds and known_techniques(options) != options:
            exported.report.approximated("scene", "Techniques: paths begin at the camera alone, as "
                                                  "some rays do not see all of the scene")
        self._remember(scene, exported.report)
        for line in exported.report.lines():
            print("Sheaf:", line)
        print(f"Sheaf: exported in {exported.seconds:.2f} s ({exported.cpu_seconds:.2f} s of CPU "
              f"time); {exported.files_written} files written, {exported.files_kept} kept",
              flush=True)
        return exported

    def _remember(self, scene, report):
        """For the panel: what all layers and views of this frame lack."""
        self._reports = getattr(self, "_reports", Report())
        self._reports.include(report)
        LAST_REPORTS[scene.name] = self._reports

    def _settings(self, scene):
        own, render = scene.sheaf, scene.render
        size = frame_size.size_of(render.resolution_x, render.resolution_y,
                                  render.resolution_percentage)
        window = ()
        if render.use_border:
            window = frame_size.window_of((render.border_min_x, render.border_max_x,
                                           render.border_min_y, render.border_max_y), *size)
        return Settings(*size, samples_of(scene, self._layer), own.max_depth, own.seed,
                        own.filter_type, own.filter_width, window,
                        not own.pass_light_paths, ExportOnly.present is None)

    def _render(self, depsgraph, exported, folder, view):
        scene, view_layer = depsgraph.scene_eval, depsgraph.view_layer_eval
        settings = self._settings(scene)
        window = settings.window
        size = ((window[1] - window[0], window[3] - window[2]) if window
                else (settings.width, settings.height))
        self._add_passes(scene, view_layer)
        place = {"layer": view_layer.name, "view": view}
        layers = self._layers(depsgraph, exported, os.path.join(folder, "image.exr"), size, place)
        if layers is None:
            return
        cosines = (passes.depth_cosines(exported.view_window, (settings.width, settings.height),
                                        window) if exported.view_window else None)
        arrays = passes.arrays(layers, scene, view_layer, cosines)
        if self._has_catchers(exported):
            found = self._caught(depsgraph, exported, layers, arrays, folder, view)
            if found is None:
                return
            arrays["Combined"] = found
        else:
            self._correct_sky(exported.sky, arrays["Combined"], layers.channels["A"],
                              passes.hides_sky(scene, view_layer), settings)
        if exported.holdouts:
            passes.cut_out(arrays["Combined"], layers, exported.holdouts)
        self._show(arrays, size, place)
        for field, value in passes.matte_metadata(layers.metadata, view_layer.name):
            self.get_result().stamp_data_add_field(field, value)

    def _layers(self, depsgraph, exported, output, size, place):
        """The Layers of a rendered image; None after Esc. place: for its tiles, or None."""
        job = start_job(depsgraph.scene_eval, depsgraph.view_layer_eval, exported, output,
                        self._has_catchers(exported))
        try:
            finished = self._follow(job, size, place)
        except BaseException:
            job.cancel()
            raise
        if not finished:
            self.update_stats("", "Sheaf: cancelling")
            job.cancel()
            return None
        for note in job.notes:
            print("Sheaf:", note)
        if job.problem:
            self.report({"WARNING"}, f"Sheaf: {job.problem}")
        print(f"Sheaf: {job.preview_count} previews shown", flush=True)
        return images.read_layers(job.output)

    @staticmethod
    def _has_catchers(exported):
        return bool(exported.catchers) and exported.sky.kind != "spherical"

    def _caught(self, depsgraph, exported, layers, arrays, folder, view):
        """The image with shadows in place of the catchers; None after Esc."""
        scene, view_layer = depsgraph.scene_eval, depsgraph.view_layer_eval
        settings = self._settings(scene)
        size, sky = (settings.width, settings.height), exported.sky
        lit = sky.radiance(size, settings.window)
        found = [catchers.without_sky(arrays["Combined"], layers.channels["A"], lit)]
        for which in (catchers.UNSEEN, catchers.ALONE):
            other = export_scene(
                depsgraph, os.path.join(folder, f"{which}.pbrt"), content_folder(),
                dataclasses.replace(settings, catchers=which),
                lambda frame, subframe: self.frame_set(frame, subframe),
                ViewCamera(self, scene, view))
            other.catchers = exported.catchers
            image = self._layers(depsgraph, other, os.path.join(folder, f"{which}.exr"), None, None)
            if image is None:
                return None
            found.append(catchers.without_sky(passes.arrays(image, scene, view_layer)["Combined"],
                                              image.channels["A"], lit))
        behind = None if scene.render.film_transparent else (
            numpy.zeros_like(lit) if passes.hides_sky(scene, view_layer) else
            sky.radiance(size, settings.window, sky.background.seen))
        return catchers.composed(*found, passes.coverage(layers, exported.catchers), behind)

    @staticmethod
    def _correct_sky(sky, combined, alpha, is_hidden, settings):
        """The image has the sky that lights the scene; the camera may see none, or another."""
        size, seen = (settings.width, settings.height), sky.background.seen
        if is_hidden:
            passes.take_out_sky(combined, alpha, sky.radiance(size, settings.window))
        elif seen is not None:
            passes.replace_sky(combined, alpha, sky.radiance(size, settings.window),
                               sky.radiance(size, settings.window, seen))

    def _add_passes(self, scene, view_layer):
        """Once for a layer: passes are added for all views."""
        if view_layer.name in self._layers_with_passes():
            return
        for name, channels, ids, _ in passes.chosen_passes(scene, view_layer):
            self.add_pass(name, channels, ids, layer=view_layer.name)
        self._layers_with_passes().add(view_layer.name)

    def _layers_with_passes(self):
        if not hasattr(self, "_passes_added"):
            self._passes_added = set()
        return self._passes_added

    def _follow(self, job, size, place):
        """Whether the image is complete; False after Esc."""
        while not job.update():
            if self.test_break():
                return False
            if job.state is not None:
                fraction, text = program.progress_text(job.state)
                self.update_progress(fraction)
                self.update_stats("", f"Sheaf: {text}")
                pixels = job.preview() if place is not None else None
                if pixels is not None:
                    self._show_light(pixels, size, place)
            time.sleep(jobs.POLL_SECONDS)
        return not self.test_break()

    def _show_light(self, pixels, size, place):
        pixels = images.enlarged(pixels, *size)
        alpha = numpy.ones((*pixels.shape[:2], 1), numpy.float32)
        self._show({"Combined": numpy.concatenate([pixels, alpha], axis=-1)}, size, place)

    def _show(self, arrays, size, place):
        """place: the layer and the view of the result; without them the first layer is replaced."""
        result = self.begin_result(0, 0, size[0], size[1], **place)
        try:
            passes.set_passes(result.layers[0].passes, arrays, *size)
        finally:
            self.end_result(result)


def _note_one_image(scene, view_layer, view, report):
    """Reports what a file of one layer and one view lacks."""
    others = [f'"{layer.name}"' for layer in scene.view_layers
              if layer.use and layer.name != view_layer.name]
    if others and not scene.render.use_single_layer:
        report.left_out("view layers", f"{', '.join(others)}: a scene that is submitted or "
                                       f'exported has the layer "{view_layer.name}" alone')
    if view:
        report.left_out("stereoscopy", f'the views besides "{view}": a scene that is submitted or '
                                       "exported has one view")


class ViewCamera:
    """The camera of the view that is rendered, or between those of two eyes: Blender moves and
    shifts it for each eye.
    """

    region = None  # Only of viewports: region_view.RegionView.

    def __init__(self, engine, scene, *views):
        self._engine, self._views = engine, views
        self.object = engine.camera_override or scene.camera

    def _mean(self, of_view):
        total = None
        for view in self._views:
            self._engine.active_view_set(view)
            total = of_view() if total is None else total + of_view()
        return total * (1 / len(self._views))

    def matrix(self, camera_object):
        if not all(self._views):
            return affine(camera_object.matrix_world)
        return self._mean(lambda: self._engine.camera_model_matrix(camera_object,
                                                                   use_spherical_stereo=False))

    def shift_x(self, camera_object):
        if not all(self._views):
            return self._engine.camera_shift_x(camera_object, use_spherical_stereo=False)
        return self._mean(lambda: self._engine.camera_shift_x(camera_object,
                                                              use_spherical_stereo=False))


def samples_of(scene, view_layer):
    """Those of the layer, if it has its own and the scene uses them."""
    used = getattr(getattr(scene, "cycles", None), "use_layer_samples", "USE")
    own = scene.sheaf.samples
    if view_layer.samples <= 0 or used == "IGNORE":
        return own
    return min(own, view_layer.samples) if used == "BOUNDED" else view_layer.samples


def job_options(scene, view_layer):
    """Options of `sheaf` that hold for one frame and for many."""
    own = scene.sheaf
    found = (["--samples", str(samples_of(scene, view_layer))] if own.stop == "SAMPLES" else [])
    if own.stop == "ERROR":
        found = ["--target-error", f"{own.target_error_percent:.6g}%"]
    if own.techniques != "default":
        found += ["--techniques", own.techniques]
    return found + own.more_options.split()


def start_job(scene, view_layer, exported, output, has_catchers=False):
    """has_catchers: whether its random numbers have to be those of other images."""
    own, chosen = scene.sheaf, preferences()
    sheaf = program.find_program(bpy.path.abspath(chosen.program_folder))
    title = f"{bpy.path.basename(bpy.data.filepath) or 'untitled.blend'} {scene.frame_current}"
    options = job_options(scene, view_layer)
    if exported.has_ray_kinds or has_catchers:
        options = known_techniques(options)
    arguments = (sheaf, exported.path, output, [
        *options,
        *passes.options(scene, view_layer, exported.groups.has_negative,
                        bool(exported.holdouts) or has_catchers)], title)
    if own.where == "FARM":
        return jobs.FarmRender(*arguments, address=own.address or chosen.address,
                               insecure=chosen.insecure, http_port=chosen.http_port)
    return jobs.LocalRender(*arguments, threads=threads(scene))
