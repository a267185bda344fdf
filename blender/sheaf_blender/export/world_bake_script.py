# Copyright the Sheaf authors.
# SPDX-License-Identifier: Apache-2.0
"""Runs in a Blender of its own: renders a world by Cycles, all directions at once.

blender -b --factory-startup --python world_bake_script.py -- \
    FILE OUTPUT FRAME WIDTH HEIGHT SAMPLES IS_FOR_CAMERA
"""
import math
import sys

import bpy


def unlink_camera_rays(tree):
    """Is Camera Ray becomes 0."""
    for link in list(tree.links):
        if link.from_node.type == "LIGHT_PATH" and link.from_socket.name == "Is Camera Ray":
            wanted = link.to_socket
            tree.links.remove(link)
            never = tree.nodes.new("ShaderNodeValue")
            never.outputs[0].default_value = 0.0
            tree.links.new(never.outputs[0], wanted)


def main():
    file, output, frame, *numbers = sys.argv[sys.argv.index("--") + 1:]
    width, height, samples, is_for_camera = map(int, numbers)
    with bpy.data.libraries.load(file) as (found, loaded):
        loaded.worlds = found.worlds
    bpy.ops.preferences.addon_enable(module="cycles")
    scene = bpy.context.scene
    for each in list(bpy.data.objects):
        if each.name in scene.collection.all_objects:
            bpy.data.objects.remove(each)
    scene.world = loaded.worlds[0]
    if not is_for_camera:
        for tree in [scene.world.node_tree, *bpy.data.node_groups]:
            unlink_camera_rays(tree)
    camera = bpy.data.objects.new("Camera", bpy.data.cameras.new("Camera"))
    scene.collection.objects.link(camera)
    camera.rotation_euler = (math.pi / 2, 0, -math.pi / 2)  # It looks along x.
    camera.data.type = "PANO"
    owner = camera.data if hasattr(camera.data, "panorama_type") else camera.data.cycles
    owner.panorama_type = "EQUIRECTANGULAR"
    scene.camera = camera
    render = scene.render
    render.engine = "CYCLES"
    render.resolution_x, render.resolution_y = width, height
    render.resolution_percentage = 100
    cycles = scene.cycles
    cycles.samples = samples
    cycles.use_denoising = cycles.use_adaptive_sampling = False
    cycles.sample_clamp_direct = cycles.sample_clamp_indirect = 0
    cycles.pixel_filter_type = "BOX"
    settings = render.image_settings
    settings.file_format, settings.color_mode, settings.color_depth = "OPEN_EXR", "RGB", "32"
    render.filepath = output
    visible = scene.world.cycles_visibility
    visible.camera = True
    whole = math.floor(float(frame))
    scene.frame_set(whole, subframe=float(frame) - whole)
    bpy.ops.render.render(write_still=True)


if __name__ == "__main__":
    main()
