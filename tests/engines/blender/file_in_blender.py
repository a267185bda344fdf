# Copyright the Sheaf authors.
# SPDX-License-Identifier: Apache-2.0
"""Runs inside Blender: renders a .blend file as it is, but small and without the compositor.

blender -b --factory-startup --python file_in_blender.py -- FILE cycles|sheaf SAMPLES OUTPUT
"""
import math
import os
import sys
import time

import bpy
import mathutils

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
import in_blender

PIXELS = 96 * 54
CAMERA_FIELD_RADIANS = 0.7


def make_small(render):
    """Keeps the aspect; both engines get the same size."""
    width = render.resolution_x * render.pixel_aspect_x
    height = render.resolution_y * render.pixel_aspect_y
    scale = math.sqrt(PIXELS / (width * height))
    render.resolution_x = max(8, round(render.resolution_x * scale))
    render.resolution_y = max(8, round(render.resolution_y * scale))
    render.resolution_percentage = 100
    render.use_border = False


def add_camera(scene):
    """A camera in front of all meshes, for files without one."""
    corners = [found.matrix_world @ mathutils.Vector(corner) for found in scene.objects
               if found.type == "MESH" and not found.hide_render for corner in found.bound_box]
    corners = corners or [mathutils.Vector((-1, -1, -1)), mathutils.Vector((1, 1, 1))]
    low, high = ([select(c[i] for c in corners) for i in range(3)] for select in (min, max))
    center = (mathutils.Vector(low) + mathutils.Vector(high)) / 2
    radius = max((c - center).length for c in corners)
    data = bpy.data.cameras.new("Added")
    data.angle = CAMERA_FIELD_RADIANS
    data.clip_end = 100 * radius
    data.clip_start = min(0.1, 0.01 * radius)
    camera = bpy.data.objects.new("Added", data)
    direction = mathutils.Vector((0.6, -1, 0.6)).normalized()
    camera.location = center + direction * 3.5 * radius
    camera.rotation_euler = (-direction).to_track_quat("-Z", "Y").to_euler()
    scene.collection.objects.link(camera)
    scene.camera = camera


def main():
    path, engine, samples, output = sys.argv[sys.argv.index("--") + 1:][:4]
    bpy.ops.wm.open_mainfile(filepath=path, load_ui=False, use_scripts=False)
    if bpy.data.version[:2] > bpy.app.version[:2]:
        print(f"NEWER {'.'.join(map(str, bpy.data.version))}")  # Blender itself may crash on it.
        return
    scene = bpy.context.scene
    render = scene.render
    render.use_compositing = render.use_sequencer = render.use_freestyle = False
    render.use_multiview = False
    render.threads_mode, render.threads = "FIXED", int(os.environ.get("THREADS", "1"))
    for layer in scene.view_layers:
        layer.use = layer == bpy.context.view_layer
        layer.samples = 0
    make_small(render)
    if scene.camera is None:
        add_camera(scene)
    image = render.image_settings
    image.file_format, image.color_depth, image.color_mode = "OPEN_EXR", "32", "RGBA"
    render.filepath = output
    before = render.engine
    (in_blender.use_sheaf if engine == "sheaf" else in_blender.use_cycles)(scene, int(samples))
    start = time.monotonic()
    bpy.ops.render.render(write_still=True)
    print(f"FILE_OF {'.'.join(map(str, bpy.data.version))} {before}")
    print(f"RENDER_SECONDS {time.monotonic() - start:.2f}")


if __name__ == "__main__":
    main()
