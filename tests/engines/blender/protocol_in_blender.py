# Copyright the Sheaf authors.
# SPDX-License-Identifier: Apache-2.0
"""Runs inside Blender: renders two view layers, groups of lights, two eyes, and frames of odd
sizes and regions.

blender -b --factory-startup --python protocol_in_blender.py -- WHAT ENGINE SAMPLES OUTPUT FOLDER
WHAT: layers, groups, eyes or sizes; ENGINE: cycles or sheaf. Sizes are checked here: SIZES_OK.
"""
import os
import random
import sys

import bpy
import numpy

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
import in_blender

SIZES = ((300, 200, 29), (1280, 720, 7), (800, 600, 9), (160, 120, 57), (96, 64, 33))
REGIONS = 10
ALPHA_MIN = 0.999


def rendered(scene, path):
    scene.render.filepath = path
    bpy.ops.render.render(write_still=True)
    image = bpy.data.images.load(path)
    try:
        width, height = image.size
        flat = numpy.empty(width * height * image.channels, numpy.float32)
        image.pixels.foreach_get(flat)
        return flat.reshape(height, width, image.channels)
    finally:
        bpy.data.images.remove(image)


def check_sizes(scene, path):
    """The frame has Blender's size, and no row or column of it is black."""
    render = scene.render
    for width, height, percentage in SIZES:
        render.resolution_x, render.resolution_y = width, height
        render.resolution_percentage = percentage
        found = rendered(scene, path)
        assert found.shape[1::-1] == (width * percentage // 100, height * percentage // 100)
        assert found[:, :, 3].min() > ALPHA_MIN, (width, height, percentage)
    render.resolution_x, render.resolution_y, render.resolution_percentage = 160, 120, 20
    render.use_border = render.use_crop_to_border = True
    seeded = random.Random(5)
    for _ in range(REGIONS):
        render.border_min_x, render.border_max_x = sorted(seeded.random() for _ in range(2))
        render.border_min_y, render.border_max_y = sorted(seeded.random() for _ in range(2))
        edges = (render.border_min_x, render.border_max_x, render.border_min_y,
                 render.border_max_y)
        if rendered_is_small(edges, 32, 24):
            continue
        found = rendered(scene, path)
        assert found[:, :, 3].min() > ALPHA_MIN, (edges, found.shape)
    print("SIZES_OK")


def rendered_is_small(edges, width, height):
    """Blender refuses regions of less than two pixels."""
    return (edges[1] - edges[0]) * width < 3 or (edges[3] - edges[2]) * height < 3


def main():
    what, engine, samples, output, folder = sys.argv[sys.argv.index("--") + 1:][:5]
    scene = in_blender.build({"layers": "two_layers", "groups": "negative_in_group"}.get(
        what, "two_eyes"), folder)
    image = scene.render.image_settings
    image.file_format, image.color_depth, image.color_mode = "OPEN_EXR", "32", "RGBA"
    (in_blender.use_sheaf if engine == "sheaf" else in_blender.use_cycles)(scene, int(samples))
    if what == "sizes":
        scene.render.use_multiview = False
        check_sizes(scene, output)
        return
    if what in ("layers", "groups"):
        image.file_format = "OPEN_EXR_MULTILAYER"
    else:
        image.views_format = "INDIVIDUAL"
    scene.render.filepath = output
    bpy.ops.render.render(write_still=True)


if __name__ == "__main__":
    main()
