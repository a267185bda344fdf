# Copyright the Sheaf authors.
# SPDX-License-Identifier: Apache-2.0
"""The functions of the render engine that Blender calls for a region of the 3D viewport."""
import bpy

from .chosen import preferences, threads
from .export import region_view
from .export.scene_export import Settings
from .farm import program
from .scene.report import cause
from .viewport import Viewport


class ViewportEngine:
    """Mixed into the render engine. Blender makes an engine for each region with rendered shading,
    and frees it with the shading.
    """

    def view_update(self, context, depsgraph):
        """The scene has changed, or a timer finds that it can be exported now."""
        viewport = self._viewport()
        if len(depsgraph.updates) or not viewport.has_scene:
            viewport.note_change()
        self._guarded(viewport, self._export_if_due, context, depsgraph)

    def view_draw(self, context, depsgraph):
        viewport = self._viewport()
        self._guarded(viewport, self._draw, context, depsgraph)
        self.update_stats("", viewport.status)

    def _guarded(self, viewport, work, *arguments):
        """None may leave the functions that Blender calls."""
        try:
            work(viewport, *arguments)
        except Exception as error:
            viewport.problem = f"the view cannot be shown: {cause(error)}"

    def _viewport(self):
        if not hasattr(self, "_of_region"):
            self._of_region = Viewport(self, _settings, _program)
        return self._of_region

    def _export_if_due(self, viewport, context, depsgraph):
        region, camera_object = _region(context, depsgraph)
        if not viewport.is_export_due or not region_view.is_finite(region):
            return
        exported = viewport.export(depsgraph, region, camera_object, _shown_in(context.space_data))
        if exported is not None:
            self.note_view(depsgraph, exported)

    def _draw(self, viewport, context, depsgraph):
        scene = depsgraph.scene_eval
        region, _ = _region(context, depsgraph)
        if not region_view.is_finite(region):
            return
        if viewport.is_export_due:
            self._export_if_due(viewport, context, depsgraph)
        viewport.look(scene, region)
        self.bind_display_space_shader(depsgraph.scene)
        try:
            viewport.draw(scene, depsgraph.view_layer_eval, region.size)
        finally:
            self.unbind_display_space_shader()

    def __del__(self):
        viewport = self.__dict__.pop("_of_region", None)
        if viewport is not None:
            viewport.close()


def _region(context, depsgraph):
    """(its Region, the evaluated camera that is looked through or None)."""
    space, scene = context.space_data, depsgraph.scene_eval
    camera = space.camera if space.use_local_camera else scene.camera
    if camera is not None:
        camera = camera.evaluated_get(depsgraph)
    found = region_view.read((context.region.width, context.region.height), context.region_data,
                             space, scene, camera)
    is_camera = context.region_data.view_perspective == "CAMERA"
    return found, camera if is_camera and camera is not None and camera.type == "CAMERA" else None


def _shown_in(space):
    """Whether an instance is visible in this space, which may have a view of a few objects."""
    def is_shown(instance):
        owner = instance.parent if instance.is_instance and instance.parent else instance.object
        return owner.visible_in_viewport_get(space)
    return is_shown


def _settings(scene):
    own = scene.sheaf
    return Settings(1, 1, own.viewport_samples, own.max_depth, own.seed, own.filter_type,
                    own.filter_width, (), is_corrected=False)


def _program():
    folder = bpy.path.abspath(preferences().program_folder)
    return program.find_program(folder), threads(bpy.context.scene)
