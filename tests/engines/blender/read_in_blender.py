# Copyright the Sheaf authors.
# SPDX-License-Identifier: Apache-2.0
"""Runs inside Blender: opens an EXR in the compositor and writes the matte of a name.

blender -b --factory-startup --python read_in_blender.py -- IMAGE NAME WIDTHxHEIGHT OUTPUT FOLDER
"""
import sys

import bpy


def main():
    path, name, size, output = sys.argv[sys.argv.index("--") + 1:][:4]
    image = bpy.data.images.load(path)
    tuple(image.size)  # Reads the file; only then is its type known.
    if image.type != "MULTILAYER":
        raise ValueError(f"{path} is no file of layers, but {image.type}")
    scene = bpy.context.scene
    scene.use_nodes = True
    nodes, links = scene.node_tree.nodes, scene.node_tree.links
    nodes.clear()
    matte = nodes.new("CompositorNodeCryptomatteV2")
    matte.source = "IMAGE"
    matte.image = image
    matte.layer_name = "CryptoObject"
    matte.matte_id = name
    links.new(matte.outputs["Matte"], nodes.new("CompositorNodeComposite").inputs["Image"])
    render = scene.render
    render.resolution_x, render.resolution_y = map(int, size.split("x"))
    render.resolution_percentage = 100
    render.image_settings.file_format = "OPEN_EXR"
    render.image_settings.color_depth = "32"
    render.filepath = output
    bpy.ops.render.render(write_still=True)


if __name__ == "__main__":
    main()
