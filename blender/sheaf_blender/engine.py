# Copyright the Sheaf authors.
# SPDX-License-Identifier: Apache-2.0
"""The render engine: exports the scene, follows the render, shows its tiles, ends with Esc."""
import os
import shutil
import tempfile
import time

import bpy
import numpy

from . import jobs, passes
from .export.scene_export import Settings, export_scene
from .farm import images, program
from .farm.program import SheafError

# Reports of each scene's last export, by the scene's name; the panel shows them.
LAST_REPORTS = {}
REPORT_TEXT = "Sheaf report"


class ExportOnly:
    """While there is one, renders only write scene files; see operators.py."""
    present = None

    def __init__(self, pattern):
        self.pattern, self.exported = pattern, []

    def path(self, frame):
        return self.pattern.replace("####", f"{frame:04d}")


class SheafRenderEngine(bpy.types.RenderEngine):
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
        scene = depsgraph.scene
        folder = tempfile.mkdtemp(prefix="sheaf-blender-")
        try:
            exported = self._export(depsgraph, folder)
            if ExportOnly.present is not None:
                ExportOnly.present.exported.append(exported)
                return
            if self.test_break():
                return
            self._render(depsgraph, scene, exported, folder)
        except (SheafError, images.ImageError, ValueError, OSError) as error:
            self.report({"ERROR"}, f"Sheaf: {error}")
            self.error_set(f"Sheaf: {error}")
        finally:
            shutil.rmtree(folder, ignore_errors=True)

    def _export(self, depsgraph, folder):
        scene = depsgraph.scene
        self.update_stats("", "Sheaf: exporting")
        path = (ExportOnly.present.path(scene.frame_current) if ExportOnly.present
                else os.path.join(folder, "main.pbrt"))
        exported = export_scene(depsgraph, path, content_folder(), self._settings(scene),
                                lambda frame, subframe: self.frame_set(frame, subframe))
        passes.left_out(scene, depsgraph.view_layer_eval, exported.report)
        LAST_REPORTS[scene.name] = exported.report
        for line in exported.report.lines():
            print("Sheaf:", line)
        print(f"Sheaf: exported in {exported.seconds:.2f} s ({exported.cpu_seconds:.2f} s of CPU "
              f"time); {exported.files_written} files written, {exported.files_kept} kept",
              flush=True)
        return exported

    def _settings(self, scene):
        own, render = scene.sheaf, scene.render
        scale = render.resolution_percentage / 100
        width = max(1, int(render.resolution_x * scale))
        height = max(1, int(render.resolution_y * scale))
        window = ()
        if render.use_border:
            left, right = (int(x * width) for x in (render.border_min_x, render.border_max_x))
            bottom, top = (int(y * height) for y in (render.border_min_y, render.border_max_y))
            window = (left, max(right, left + 1), height - max(top, bottom + 1), height - bottom)
        return Settings(width, height, own.samples, own.max_depth, own.seed, own.filter_type,
                        own.filter_width, window)

    def _render(self, depsgraph, scene, exported, folder):
        view_layer = depsgraph.view_layer_eval
        job = start_job(scene, exported.path, os.path.join(folder, "image.exr"),
                        passes.options(scene, view_layer))
        settings = self._settings(scene)
        window = settings.window
        size = ((window[1] - window[0], window[3] - window[2]) if window
                else (settings.width, settings.height))
        for name, channels, ids, _ in passes.chosen_passes(scene, view_layer):
            self.add_pass(name, channels, ids, layer=view_layer.name)
        try:
            finished = self._follow(job, size)
        except BaseException:
            job.cancel()
            raise
        if not finished:
            self.update_stats("", "Sheaf: cancelling")
            job.cancel()
            return
        for note in job.notes:
            print("Sheaf:", note)
        if job.problem:
            self.report({"WARNING"}, f"Sheaf: {job.problem}")
        print(f"Sheaf: {job.preview_count} previews shown", flush=True)
        cosines = (passes.depth_cosines(exported.view_window, (settings.width, settings.height),
                                        window) if exported.view_window else None)
        layers = images.read_layers(job.output)
        self._show(passes.arrays(layers, scene, view_layer, cosines), size, view_layer)
        for field, value in passes.matte_metadata(layers.metadata, view_layer.name):
            self.get_result().stamp_data_add_field(field, value)

    def _follow(self, job, size):
        """Whether the image is complete; False after Esc."""
        while not job.update():
            if self.test_break():
                return False
            if job.state is not None:
                fraction, text = program.progress_text(job.state)
                self.update_progress(fraction)
                self.update_stats("", f"Sheaf: {text}")
                pixels = job.preview()
                if pixels is not None:
                    self._show_light(pixels, size)
            time.sleep(jobs.POLL_SECONDS)
        return not self.test_break()

    def _show_light(self, pixels, size):
        pixels = images.enlarged(pixels, *size)
        alpha = numpy.ones((*pixels.shape[:2], 1), numpy.float32)
        self._show({"Combined": numpy.concatenate([pixels, alpha], axis=-1)}, size, None)

    def _show(self, arrays, size, view_layer):
        layer_name = {"layer": view_layer.name} if view_layer else {}
        result = self.begin_result(0, 0, size[0], size[1], **layer_name)
        try:
            passes.set_passes(result.layers[0].passes, arrays, *size)
        finally:
            self.end_result(result)


def preferences():
    return bpy.context.preferences.addons[__package__].preferences


def content_folder():
    return bpy.path.abspath(preferences().content_folder) or os.path.join(
        tempfile.gettempdir(), f"sheaf-blender-content-{os.getuid()}")


def job_options(scene):
    """Options of `sheaf` that hold for one frame and for many."""
    own = scene.sheaf
    found = ["--samples", str(own.samples)] if own.stop == "SAMPLES" else []
    if own.stop == "ERROR":
        found = ["--target-error", f"{own.target_error:.6g}"]
    if own.techniques != "default":
        found += ["--techniques", own.techniques]
    return found + own.more_options.split()


def start_job(scene, path, output, pass_options):
    own, chosen = scene.sheaf, preferences()
    sheaf = program.find_program(bpy.path.abspath(chosen.program_folder))
    title = f"{bpy.path.basename(bpy.data.filepath) or 'untitled.blend'} {scene.frame_current}"
    arguments = (sheaf, path, output, [*job_options(scene), *pass_options], title)
    if own.where == "FARM":
        return jobs.FarmRender(*arguments, address=own.address or chosen.address,
                               insecure=chosen.insecure, http_port=chosen.http_port)
    return jobs.LocalRender(*arguments, threads=threads(scene))


def threads(scene):
    return scene.render.threads if scene.render.threads_mode == "FIXED" else 0
