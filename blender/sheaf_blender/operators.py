# Copyright the Sheaf authors.
# SPDX-License-Identifier: Apache-2.0
"""Operators: submit a range of frames as one job, see how it is, cancel it, fetch its images; and
write a scene without rendering it.
"""
import os
import tempfile

import bpy

from . import engine, jobs, passes
from .export.eyes import stereo_options
from .farm import program
from .farm.program import SheafError
from .scene.ray_visibility import known_techniques
from .scene.report import cause


def _farm(context):
    """(program, address, insecure)."""
    chosen = engine.preferences()
    return (program.find_program(bpy.path.abspath(chosen.program_folder)),
            context.scene.sheaf.address or chosen.address, chosen.insecure)


def export_frames(scene, pattern, frames, both_eyes=False):
    """Writes a scene file for each frame, by the render's own evaluation. Returns [Exported]."""
    before = scene.frame_current
    only = engine.ExportOnly.present = engine.ExportOnly(pattern, both_eyes)
    try:
        for frame in frames:
            scene.frame_set(frame)
            bpy.ops.render.render(scene=scene.name)
    finally:
        engine.ExportOnly.present = None
        scene.frame_set(before)
    return only.exported


class _SheafOperator(bpy.types.Operator):
    def execute(self, context):
        try:
            self.run(context)
        except (SheafError, OSError, RuntimeError) as error:
            words = str(error).replace("Error: Sheaf: ", "").strip()  # The engine's own prefix.
            self.report({"ERROR"}, f"Sheaf: {words}")
            return {"CANCELLED"}
        except Exception as error:
            self.report({"ERROR"}, f"Sheaf: {cause(error)}")
            return {"CANCELLED"}
        return {"FINISHED"}


class SubmitFrames(_SheafOperator):
    """Submit the frame range of the scene to the farm as one job"""
    bl_idname = "sheaf.submit_frames"
    bl_label = "Submit Frames"

    def run(self, context):
        with tempfile.TemporaryDirectory(prefix="sheaf-blender-frames-") as folder:
            self._submit(context, folder)  # The farm has all files when it returns.

    def _submit(self, context, folder):
        scene = context.scene
        sheaf, address, insecure = _farm(context)
        jobs.check_farm(sheaf, address, insecure)  # Before minutes of exporting.
        pattern = os.path.join(folder, "frame.####.pbrt")
        frames = range(scene.frame_start, scene.frame_end + 1, scene.frame_step)
        options = [*engine.job_options(scene, context.view_layer),
                   *passes.options(scene, context.view_layer)]
        eyes = stereo_options(scene, options)
        exported = export_frames(scene, pattern, frames, bool(eyes))
        if any(frame.has_ray_kinds for frame in exported):
            options = known_techniques(options)
            if eyes:  # They share paths, too.
                eyes, exported = [], export_frames(scene, pattern, frames)
        if len(exported) != len(frames):
            raise SheafError("a frame could not be exported; the messages above say why")
        step = f"x{scene.frame_step}" if scene.frame_step > 1 else ""
        text = (f"{frames[0]}-{frames[-1]}{step}" if len(frames) > 1 else str(frames[0]))
        title = bpy.path.basename(bpy.data.filepath) or "untitled.blend"
        job, notes = jobs.submit_frames(sheaf, pattern, text, [*options, *eyes], title, address,
                                        insecure)
        for note in notes:
            print("Sheaf:", note)
        scene.sheaf.frames_job, scene.sheaf.frames_state = job["name"], "submitted"
        scene.sheaf.frames_created = job.get("create_time", "")
        self.report({"INFO"}, f"Sheaf: {job['name']}: {len(frames)} frames")


class RefreshFrames(_SheafOperator):
    """Ask the farm how the submitted frames are"""
    bl_idname = "sheaf.refresh_frames"
    bl_label = "Refresh"

    def run(self, context):
        own = context.scene.sheaf
        state = jobs.job_state(_farm(context)[0], own.frames_job, *_farm(context)[1:],
                               own.frames_created)
        own.frames_state = f"{state['state']}, {program.progress_text(state)[1]}"


class CancelFrames(_SheafOperator):
    """Cancel the job of the submitted frames"""
    bl_idname = "sheaf.cancel_frames"
    bl_label = "Cancel Job"

    def run(self, context):
        sheaf, address, insecure = _farm(context)
        own = context.scene.sheaf
        jobs.cancel(sheaf, own.frames_job, address, insecure, own.frames_created)
        own.frames_state = "cancelled"


class FetchFrames(_SheafOperator):
    """Wait for the submitted frames, and write them to the scene's output path as EXR"""
    bl_idname = "sheaf.fetch_frames"
    bl_label = "Fetch Images"

    def run(self, context):
        sheaf, address, insecure = _farm(context)
        own = context.scene.sheaf
        output = jobs.output_pattern(bpy.path.abspath(context.scene.render.filepath))
        jobs.download(sheaf, own.frames_job, output, address, insecure, own.frames_created)
        own.frames_state = f"images are at {output}"


class ExportScene(_SheafOperator):
    """Write the scene as Sheaf renders it, without rendering"""
    bl_idname = "sheaf.export_scene"
    bl_label = "Export Scene"
    filepath: bpy.props.StringProperty(subtype="FILE_PATH")

    def invoke(self, context, event):
        self.filepath = bpy.path.ensure_ext(bpy.data.filepath or "scene", ".pbrt")
        context.window_manager.fileselect_add(self)
        return {"RUNNING_MODAL"}

    def run(self, context):
        scene = context.scene
        pattern = bpy.path.abspath(self.filepath)
        folder = os.path.dirname(pattern) or "."
        if not os.path.isdir(folder):
            raise SheafError(f"there is no folder {folder}; make it, or choose another")
        if not export_frames(scene, pattern, [scene.frame_current]):
            raise SheafError("the scene could not be exported; the messages above say why")


class ShowReport(_SheafOperator):
    """Open the list of what the last render approximated or left out as a text"""
    bl_idname = "sheaf.show_report"
    bl_label = "Open Report"

    def run(self, context):
        report = engine.LAST_REPORTS.get(context.scene.name)
        text = (bpy.data.texts.get(engine.REPORT_TEXT)
                or bpy.data.texts.new(engine.REPORT_TEXT))
        text.from_string("\n".join(report.lines()) if report else "Nothing was exported yet.")


CLASSES = (SubmitFrames, RefreshFrames, CancelFrames, FetchFrames, ExportScene, ShowReport)
