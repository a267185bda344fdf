# Copyright the Sheaf authors.
# SPDX-License-Identifier: Apache-2.0
"""Properties, preferences, and the list of what Blender registers."""
import bpy

from . import engine, operators, panels, viewport
from .farm import program
from .scene import techniques


class SheafPreferences(bpy.types.AddonPreferences):
    bl_idname = __package__

    program_folder: bpy.props.StringProperty(
        name="Programs", subtype="DIR_PATH", default=program.default_program_folder(),
        description="Folder of Sheaf's programs; empty: PATH")
    address: bpy.props.StringProperty(
        name="Coordinator", description="HOST:PORT of the farm; empty: SHEAF_COORDINATOR, or "
        "127.0.0.1:7400. Log in once with: sheaf login HOST")
    http_port: bpy.props.IntProperty(
        name="Page port", min=0, max=65535, default=0,
        description="Port of the coordinator's page, from which tiles come; 0: 7480. Coordinators "
        "with certificates say it themselves")
    insecure: bpy.props.BoolProperty(
        name="Insecure", description="For experiments: connect without encryption to another "
        "machine")
    content_folder: bpy.props.StringProperty(
        name="Exported files", subtype="DIR_PATH",
        description="Folder of exported meshes and images, named by their content; empty: in the "
        "temporary folder")

    def draw(self, context):
        for name in ("program_folder", "address", "http_port", "insecure", "content_folder"):
            self.layout.prop(self, name)


class SheafSettings(bpy.types.PropertyGroup):
    where: bpy.props.EnumProperty(name="Render", items=(
        ("LOCAL", "On this machine", "sheaf render, in one process"),
        ("FARM", "On the farm", "sheaf submit, to the coordinator")), default="LOCAL")
    address: bpy.props.StringProperty(
        name="Coordinator", description="HOST:PORT; empty: that of the preferences")
    stop: bpy.props.EnumProperty(name="Until", items=(
        ("SAMPLES", "Samples", "The same number of samples for all pixels"),
        ("ERROR", "Error", "Until a pixel is off by at most this, in the root mean square")),
        default="SAMPLES")
    samples: bpy.props.IntProperty(name="Samples", min=1, max=65536, default=128)
    target_error_percent: bpy.props.FloatProperty(name="Error (%)", min=0.1, max=100, default=10)
    viewport_samples: bpy.props.IntProperty(
        name="Viewport Samples", min=1, max=65536, default=64,
        description="Samples at which an image of the viewport is complete")
    max_depth: bpy.props.IntProperty(name="Bounces", min=0, max=100, default=12,
                                     description="A limit for each path, whatever it "
                                     "meets: Total of Cycles")
    seed: bpy.props.IntProperty(name="Seed", min=0, default=0)
    techniques: bpy.props.EnumProperty(
        name="Techniques", items=techniques.ITEMS, default="default",
        description="How light is found. All give the same image in the end, with more or less "
        "noise for the time")
    filter_type: bpy.props.EnumProperty(name="Pixel Filter", items=(
        ("BLACKMAN_HARRIS", "Blackman-Harris", "The Gaussian of the same width"),
        ("GAUSSIAN", "Gaussian", ""), ("BOX", "Box", "")), default="BLACKMAN_HARRIS")
    filter_width: bpy.props.FloatProperty(name="Width", min=0.01, max=10, default=1.5,
                                          subtype="PIXEL")
    more_options: bpy.props.StringProperty(
        name="More options",
        description="Options of sheaf render or submit, such as --color spectral")
    pass_denoising: bpy.props.BoolProperty(
        name="Denoising Data", description="Normal and albedo, as the Denoise node takes them")
    pass_light_paths: bpy.props.BoolProperty(
        name="Kinds of Light", description="The light by its way to the camera: seen, direct, "
        "indirect, caustic, of volumes and subsurface; together they are the image")
    pass_error: bpy.props.BoolProperty(name="Standard error")
    pass_samples: bpy.props.BoolProperty(name="Samples")
    frames_created: bpy.props.StringProperty(description="Creation time of that job")
    frames_job: bpy.props.StringProperty(name="Job", description="Job of the frames submitted last")
    frames_state: bpy.props.StringProperty(name="State")


_CLASSES = (SheafSettings, SheafPreferences, engine.SheafRenderEngine, *operators.CLASSES,
            *panels.CLASSES)


def register():
    for each in _CLASSES:
        bpy.utils.register_class(each)
    bpy.types.Scene.sheaf = bpy.props.PointerProperty(type=SheafSettings)
    panels.share_panels(True)


def unregister():
    panels.share_panels(False)
    for each in list(viewport.PRESENT):
        each.close()
    del bpy.types.Scene.sheaf
    for each in reversed(_CLASSES):
        bpy.utils.unregister_class(each)
