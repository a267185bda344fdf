# Copyright the Sheaf authors.
# SPDX-License-Identifier: Apache-2.0
"""Runs inside Blender: exports seeded random scenes. An export ends without an exception, and no
item of it ends by one. Prints RANDOM_OK.

blender -b --factory-startup --python random_in_blender.py -- FOLDER FIRST_SEED COUNT [render]
With "render", each scene is rendered too, at four samples.
"""
import os
import sys
import traceback

import bpy

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
import in_blender
import random_scenes
import scenes

MAPS_OF_WORLDS_MAX = 2  # Each takes a second or two.


def main():
    folder, first, count, *more = sys.argv[sys.argv.index("--") + 1:]
    bpy.ops.preferences.addon_enable(module="sheaf_blender")
    from sheaf_blender import engine
    from sheaf_blender.export import world_bake
    baked = [0]
    bake = world_bake.bake

    def bake_some(*arguments):
        baked[0] += 1
        if baked[0] > MAPS_OF_WORLDS_MAX:
            raise world_bake.BakeError("enough were rendered")
        return bake(*arguments)
    world_bake.bake = bake_some
    world_bake.WIDTH_PX, world_bake.HEIGHT_PX, world_bake.EDGE_TEXELS = 64, 32, 16
    world_bake.SAMPLES = 1
    failed = 0
    for seed in range(int(first), int(first) + int(count)):
        builder = scenes.Builder(folder)
        try:
            random_scenes.RandomScene(builder, seed).build()
        except Exception:
            traceback.print_exc()
            raise
        scene = builder.scene
        in_blender.use_sheaf(scene, 4)
        path = os.path.join(folder, f"random{seed}.pbrt")
        try:
            if more:
                scene.render.filepath = path.replace(".pbrt", ".exr")
                scene.render.image_settings.file_format = "OPEN_EXR"
                bpy.ops.render.render(write_still=True)
            else:
                bpy.ops.sheaf.export_scene(filepath=path)
        except RuntimeError as error:
            print(f"  FAILED: seed {seed}: {error}", flush=True)
            failed += 1
            continue
        found = engine.LAST_REPORTS.get(scene.name)
        wrong = [line for line in found.lines() if "cannot be exported" in line]
        if wrong:
            print(f"  FAILED: seed {seed}: {wrong}", flush=True)
            failed += 1
    if failed:
        sys.exit(1)
    print(f"RANDOM_OK {count}")


if __name__ == "__main__":
    main()
