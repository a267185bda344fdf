# Copyright the Sheaf authors.
# SPDX-License-Identifier: Apache-2.0
"""Panels of the render, output and view layer properties."""
import bpy

from . import engine

REPORT_LINES_MAX = 40  # More are in the text that "Open Report" makes.
# Panels of other engines that say what Sheaf does not do.
_FOREIGN = {"VIEWLAYER_PT_filter", "VIEWLAYER_PT_layer_passes", "RENDER_PT_simplify",
            "RENDER_PT_gpencil", "RENDER_PT_freestyle"}
_SHARED_ENGINES = {"BLENDER_RENDER", "BLENDER_EEVEE", "BLENDER_EEVEE_NEXT"}
_SHARED_EEVEE = {"EEVEE_MATERIAL_PT_context_material", "EEVEE_MATERIAL_PT_surface",
                 "EEVEE_MATERIAL_PT_volume", "EEVEE_WORLD_PT_surface", "EEVEE_WORLD_PT_volume",
                 "EEVEE_WORLD_PT_mist", "DATA_PT_EEVEE_light"}


class _Panel:
    bl_space_type = "PROPERTIES"
    bl_region_type = "WINDOW"
    COMPAT_ENGINES = {"SHEAF"}

    @classmethod
    def poll(cls, context):
        return context.engine in cls.COMPAT_ENGINES

    def column(self):
        self.layout.use_property_split = True
        self.layout.use_property_decorate = False
        return self.layout.column()


class SHEAF_PT_render(_Panel, bpy.types.Panel):
    bl_label = "Sheaf"
    bl_context = "render"

    def draw(self, context):
        own, column = context.scene.sheaf, self.column()
        column.prop(own, "where")
        if own.where == "FARM":
            column.prop(own, "address")
        column.prop(own, "stop")
        column.prop(own, "samples" if own.stop == "SAMPLES" else "target_error_percent")
        column.prop(own, "viewport_samples")
        for name in ("max_depth", "techniques", "seed", "filter_type", "filter_width",
                     "more_options"):
            column.prop(own, name)
        column.operator("sheaf.export_scene")


class SHEAF_PT_motion(_Panel, bpy.types.Panel):
    bl_label = "Motion Blur"
    bl_context = "render"
    bl_options = {"DEFAULT_CLOSED"}

    def draw_header(self, context):
        self.layout.prop(context.scene.render, "use_motion_blur", text="")

    def draw(self, context):
        self.column().prop(context.scene.render, "motion_blur_shutter")


class SHEAF_PT_frames(_Panel, bpy.types.Panel):
    bl_label = "Sheaf: Frames as One Job"
    bl_context = "output"

    def draw(self, context):
        own, column = context.scene.sheaf, self.column()
        column.operator("sheaf.submit_frames")
        if own.frames_job:
            column.label(text=f"{own.frames_job}: {own.frames_state}")
            row = column.row()
            for name in ("refresh", "fetch", "cancel"):
                row.operator(f"sheaf.{name}_frames")


class SHEAF_PT_passes(_Panel, bpy.types.Panel):
    bl_label = "Passes"
    bl_context = "view_layer"

    def draw(self, context):
        own, layer, column = context.scene.sheaf, context.view_layer, self.column()
        for name in ("z", "mist", "normal", "position", "uv", "vector"):
            column.prop(layer, f"use_pass_{name}")
        for name in ("pass_denoising", "pass_light_paths", "pass_error", "pass_samples"):
            column.prop(own, name)
        for kind in ("object", "material", "asset"):
            column.prop(layer, f"use_pass_cryptomatte_{kind}", text=f"Cryptomatte {kind.title()}")


class SHEAF_PT_report(_Panel, bpy.types.Panel):
    bl_label = "Sheaf: Approximated and Left Out"
    bl_context = "render"

    def draw(self, context):
        report = engine.LAST_REPORTS.get(context.scene.name)
        layout = self.layout
        if report is None:
            layout.label(text="A render or an export fills this list.")
            return
        lines = report.lines()
        for line in lines[:REPORT_LINES_MAX]:
            layout.label(text=line, icon="ERROR" if line.endswith("(left out)") else "INFO")
        if not lines:
            layout.label(text="Everything was exported as it is.", icon="CHECKMARK")
        if len(lines) > REPORT_LINES_MAX:
            layout.label(text=f"and {len(lines) - REPORT_LINES_MAX} more")
        layout.operator("sheaf.show_report")


CLASSES = (SHEAF_PT_render, SHEAF_PT_motion, SHEAF_PT_frames, SHEAF_PT_passes, SHEAF_PT_report)


def share_panels(shares):
    """Lets Blender's own panels of cameras, lights, materials and outputs appear with Sheaf."""
    for panel in bpy.types.Panel.__subclasses__():
        engines = getattr(panel, "COMPAT_ENGINES", None)
        name = panel.__name__
        if engines is None or name in _FOREIGN or name.startswith("SHEAF_"):
            continue
        if name.startswith("EEVEE_") or "_EEVEE_" in name:
            fits = name in _SHARED_EEVEE
        else:
            fits = bool(engines & _SHARED_ENGINES)
        if shares and fits:
            engines.add("SHEAF")
        else:
            engines.discard("SHEAF")
