# Copyright the Sheaf authors.
# SPDX-License-Identifier: Apache-2.0
"""Runs inside Blender: presses F12 with all passes, and lets the compositor's Cryptomatte node pick
one object by its name.

blender -b --factory-startup --python passes_in_blender.py -- NAME cycles|sheaf SAMPLES IMAGE FOLDER
"""
import os
import sys

import bpy

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
import in_blender
import scenes_more


def pick(scene, name):
    """Composites the matte of an object of this very render."""
    scene.use_nodes = True
    nodes, links = scene.node_tree.nodes, scene.node_tree.links
    nodes.clear()
    nodes.new("CompositorNodeRLayers")  # Without it Blender composites and does not render.
    matte = nodes.new("CompositorNodeCryptomatteV2")
    matte.source, matte.scene = "RENDER", scene
    matte.layer_name = f"{scene.view_layers[0].name}.CryptoObject"
    matte.matte_id = name
    links.new(matte.outputs["Matte"], nodes.new("CompositorNodeComposite").inputs["Image"])


def main():
    name, engine, samples, output, folder = sys.argv[sys.argv.index("--") + 1:][:5]
    scene = in_blender.build("layers", folder)
    (in_blender.use_sheaf if engine == "sheaf" else in_blender.use_cycles)(scene, int(samples))
    layer = scene.view_layers[0]
    scenes_more.all_passes(layer)
    if engine == "sheaf":  # Cycles has no vectors with motion blur, Sheaf none without.
        scene.render.use_motion_blur, scene.render.motion_blur_shutter = True, 0.5
        scene.sheaf.pass_denoising = scene.sheaf.pass_light_paths = True
    else:
        layer.cycles.denoising_store_passes = True
    pick(scene, name)
    image = scene.render.image_settings
    image.file_format, image.color_depth = "OPEN_EXR_MULTILAYER", "32"
    scene.render.filepath = output
    bpy.ops.render.render(write_still=True)


if __name__ == "__main__":
    main()
