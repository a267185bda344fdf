# Copyright the Sheaf authors.
# SPDX-License-Identifier: Apache-2.0
"""Runs inside Blender: imports a glTF model and renders it by Cycles, in a uniform surrounding.

blender -b --factory-startup --python gltf_in_blender.py -- MODEL RADIANCE SAMPLES OUTPUT FOLDER
"""
import os
import sys

import bpy
import numpy

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
import in_blender
import scenes


def main():
    model, radiance, samples, output, folder = sys.argv[sys.argv.index("--") + 1:][:5]
    builder = scenes.Builder(folder)
    builder.background(float(radiance))
    if not hasattr(numpy, "bool"):  # Debian's numpy is newer than the importer of Blender 3.4.
        numpy.bool = bool
    bpy.ops.preferences.addon_enable(module="io_scene_gltf2")
    # Blender's radiance of 1 is then 1 cd/m^2, as in Sheaf's images of glTF.
    known = bpy.ops.import_scene.gltf.get_rna_type().properties.keys()
    mode = next(name for name in known if name.endswith("convert_lighting_mode"))
    bpy.ops.import_scene.gltf(filepath=model, **{mode: "COMPAT"})
    scene = builder.scene
    scene.camera = next(each for each in scene.objects if each.type == "CAMERA")
    for lamp in bpy.data.lights:
        lamp.use_custom_distance = False
        if lamp.type == "SUN":
            lamp.angle = 0.0
        else:
            lamp.shadow_soft_size = 0.0
    for material in bpy.data.materials:
        for node in material.node_tree.nodes if material.node_tree else ():
            if node.type == "BSDF_PRINCIPLED":  # As Sheaf: rough surfaces lose no light.
                node.distribution = "MULTI_GGX"
    scene.frame_set(scene.frame_start)
    in_blender.use_cycles(scene, int(samples))
    scene.render.threads_mode, scene.render.threads = "FIXED", int(os.environ.get("THREADS", "1"))
    scene.render.film_transparent = False
    image = scene.render.image_settings
    image.file_format, image.color_depth, image.color_mode = "OPEN_EXR", "32", "RGBA"
    scene.render.filepath = output
    bpy.ops.render.render(write_still=True)


if __name__ == "__main__":
    main()
