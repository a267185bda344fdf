# Copyright the Sheaf authors.
# SPDX-License-Identifier: Apache-2.0
"""Runs inside Blender: prints the views that it finds in an image, and the mean of each.

blender -b --factory-startup --python views_in_blender.py -- IMAGE FOLDER WIDTH HEIGHT
"""
import os
import sys

import bpy

path, folder, width, height = sys.argv[sys.argv.index("--") + 1:][:4]
scene = bpy.context.scene
scene.render.resolution_x, scene.render.resolution_y = int(width), int(height)
scene.render.resolution_percentage = 100
scene.render.image_settings.file_format = "OPEN_EXR"
scene.render.image_settings.color_depth = "32"
scene.use_nodes = True
tree = scene.node_tree
tree.nodes.clear()
node = tree.nodes.new("CompositorNodeImage")
node.image = bpy.data.images.load(path)
composite = tree.nodes.new("CompositorNodeComposite")
tree.links.new(node.outputs["Combined"], composite.inputs["Image"])
for view in ("left", "right"):
    node.view = view  # TypeError: the image has no such view.
    scene.render.filepath = os.path.join(folder, view + ".exr")
    bpy.ops.render.render(write_still=True)
    written = bpy.data.images.load(scene.render.filepath)
    values = [value for i, value in enumerate(written.pixels[:]) if i % 4 == 1]
    print(f"VIEW {view} {sum(values) / len(values):.6g}")
