# Copyright the Sheaf authors.
# SPDX-License-Identifier: Apache-2.0
"""Runs inside Blender: makes a scene and renders it.

blender -b --factory-startup --python in_blender.py -- SCENE cycles|sheaf SAMPLES OUTPUT [FOLDER]
"""
import os
import sys
import time

import bpy

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
import random_scenes
import scenes
import scenes_findings
import scenes_layers
import scenes_meaning
import scenes_more
import scenes_catchers
import scenes_colors
import scenes_patterns
import scenes_rays

BOUNCES = 16


def build(name, folder):
    builder = scenes.Builder(folder)
    if name.startswith("handled"):
        random_scenes.handled(int(name[7:]))(builder)
        return builder.scene
    if name.startswith("wild"):
        random_scenes.RandomScene(builder, int(name[4:])).build()
        return builder.scene
    module = next(module for module in (scenes, scenes_more, scenes_findings, scenes_meaning,
                                    scenes_colors, scenes_layers, scenes_patterns,
                                    scenes_rays, scenes_catchers)
                  if hasattr(module, name))
    getattr(module, name)(builder)
    return builder.scene


def use_sheaf(scene, samples):
    bpy.ops.preferences.addon_enable(module="sheaf_blender")
    scene.render.engine = "SHEAF"
    own = scene.sheaf
    own.samples, own.max_depth = samples, BOUNCES
    own.where = "FARM" if os.environ.get("SHEAF_TEST_FARM") else "LOCAL"
    preferences = bpy.context.preferences.addons["sheaf_blender"].preferences
    preferences.program_folder = os.environ["SHEAF_BIN"]
    preferences.content_folder = os.environ["SHEAF_TEST_CONTENT"]
    if own.where == "FARM":
        preferences.address = os.environ["SHEAF_TEST_FARM"]
        preferences.http_port = int(os.environ["SHEAF_TEST_HTTP_PORT"])
    return preferences


def make_worlds_small():
    """Maps that Cycles renders in a second; random worlds have no small sun."""
    bpy.ops.preferences.addon_enable(module="sheaf_blender")
    from sheaf_blender.export import world_bake
    world_bake.WIDTH_PX, world_bake.HEIGHT_PX, world_bake.EDGE_TEXELS = 512, 256, 256


def use_cycles(scene, samples):
    scene.render.engine = "CYCLES"
    cycles = scene.cycles
    cycles.device, cycles.samples = "CPU", samples
    cycles.use_denoising = cycles.use_adaptive_sampling = False
    cycles.sample_clamp_indirect = cycles.sample_clamp_direct = cycles.blur_glossy = 0
    cycles.light_sampling_threshold = 0
    cycles.max_bounces = BOUNCES
    for kind in ("diffuse", "glossy", "transmission", "volume"):
        setattr(cycles, f"{kind}_bounces", BOUNCES)
    cycles.transparent_max_bounces = 1024  # Sheaf has no limit.


def main():
    name, engine, samples, output, folder = (sys.argv[sys.argv.index("--") + 1:] + [None])[:5]
    scene = build(name, folder or os.path.dirname(output))
    scene.render.threads_mode, scene.render.threads = "FIXED", int(os.environ.get("THREADS", "1"))
    image = scene.render.image_settings
    image.file_format, image.color_depth, image.color_mode = "OPEN_EXR", "32", "RGBA"
    scene.render.filepath = output
    if name.startswith("wild"):
        make_worlds_small()
    (use_sheaf if engine == "sheaf" else use_cycles)(scene, int(samples))
    if os.environ.get("SHEAF_TEST_MULTILAYER"):
        image.file_format = "OPEN_EXR_MULTILAYER"
    start = time.monotonic()
    bpy.ops.render.render(write_still=True)
    print(f"RENDER_SECONDS {time.monotonic() - start:.2f}")


if __name__ == "__main__":
    main()
