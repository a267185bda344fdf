# Copyright the Sheaf authors.
# SPDX-License-Identifier: Apache-2.0
"""Runs inside Blender with a window (Xvfb): rendered shading in the 3D viewport, as a user has it.

blender --factory-startup --python viewport_in_blender.py
Prints VIEWPORT_OK. SHEAF_TEST_SCREEN: the frame buffer of Xvfb (-fbdir); viewport_test.py sets it.
"""
import os
import struct
import sys
import time
import traceback

import bpy
import numpy

SAMPLES = 8
STEP_SECONDS_MAX = 120
GRAY, GRAY_SHOWN = 0.5, 188  # Linear, and as 8 bits of sRGB.


def area():
    return next(each for each in bpy.context.window.screen.areas if each.type == "VIEW_3D")


def viewports():
    from sheaf_blender import viewport
    return list(viewport.PRESENT)


def the_viewport():
    found = viewports()
    assert len(found) == 1, found
    return found[0]


def process_of(viewport):
    return viewport._process._process


def is_complete():
    return bool(viewports()) and the_viewport().status.endswith(f" {SAMPLES} samples")


def image_after(viewport):
    """A condition: there is an image that was asked for after this call."""
    before = max(viewport._regions)
    return lambda: max(viewport._regions) > before and is_complete()


def screenshot():
    """The 3D view as (height, width, 3), rows from the top: the frame buffer file of Xvfb, as some
    Blenders cannot read their window, and images of Blender's own are changes of the scene.
    """
    bpy.ops.wm.redraw_timer(type="DRAW_WIN_SWAP", iterations=1)
    with open(os.environ["SHEAF_TEST_SCREEN"], "rb") as file:
        content = file.read()
    header = struct.unpack(">25I", content[:100])
    start, height, row_bytes, colors = header[0], header[5], header[12], header[19]
    pixels = numpy.frombuffer(content, numpy.uint8, offset=start + 12 * colors,
                              count=height * row_bytes).reshape(height, row_bytes // 4, 4)
    region = next(each for each in area().regions if each.type == "WINDOW")
    top = height - region.y - region.height
    return pixels[top:top + region.height, region.x:region.x + region.width, 2::-1].astype(int)


def is_changed(one, other):
    return (abs(one - other).max(axis=-1) > 8).sum() > 200


def prepare():
    scene, space = bpy.context.scene, area().spaces[0]
    scene.render.engine = "SHEAF"
    scene.sheaf.viewport_samples = SAMPLES
    scene.view_settings.view_transform = "Standard"
    scene.world.use_nodes = False
    scene.world.color = (GRAY, GRAY, GRAY)
    space.overlay.show_overlays = space.show_gizmo = False
    space.region_3d.view_perspective = "PERSP"
    space.shading.type = "RENDERED"


def steps():
    """Yields what to wait for."""
    scene = bpy.context.scene
    prepare()
    yield is_complete
    viewport = the_viewport()
    first = screenshot()
    assert abs(first[-40, 60:80] - GRAY_SHOWN).max() <= 2, first[-40, 60]
    process, path = process_of(viewport), viewport._path

    next_image = image_after(viewport)
    area().spaces[0].region_3d.view_location.x += 1.5
    yield next_image
    moved = screenshot()
    assert is_changed(moved, first), "a move of the view changes the image"
    assert (process_of(viewport), viewport._path) == (process, path), "the scene is kept"

    bpy.data.objects["Cube"].location.z += 1.5
    yield lambda: viewport._path != path
    yield is_complete
    assert is_changed(screenshot(), moved), "a move of an object changes the image"
    assert process_of(viewport) is process, "the process is kept"

    path = viewport._path
    cube = bpy.data.objects["Cube"].data.materials[0]
    cube.node_tree.nodes["Principled BSDF"].inputs[0].default_value = (1, 0, 0, 1)
    yield lambda: viewport._path != path
    yield is_complete
    red = screenshot()
    assert (red[..., 0] - red[..., 1]).max() > 60, "a material changes the image"

    next_image = image_after(viewport)
    area().spaces[0].region_3d.view_perspective = "CAMERA"
    scene.render.use_border, scene.render.border_max_x = True, 0.5
    yield lambda: viewport._asked.window and next_image()
    framed = screenshot()
    assert (abs(framed - GRAY_SHOWN).max(axis=-1) <= 2).sum() > 1000, "the border is rendered"
    outside = framed[:, -20:]
    assert abs(outside - GRAY_SHOWN).min() > 20, "nothing is rendered outside of it"

    scene.render.use_border = False
    process_of(viewport).kill()
    yield lambda: viewport._process is None or process_of(viewport) is not process
    yield is_complete
    assert process_of(viewport) is not process, "another process has taken over"

    next_image = image_after(viewport)
    scene.render.film_transparent = True
    yield next_image

    process = process_of(viewport)
    del viewport, next_image  # An engine that is freed has the last reference.
    area().spaces[0].shading.type = "SOLID"
    yield lambda: not viewports() and process.poll() is not None
    assert process.poll() == 0, process.poll()

    area().spaces[0].shading.type = "RENDERED"
    yield is_complete
    print(f"LEFT {process_of(the_viewport()).pid}.", flush=True)


class Driver:
    """Runs the steps from a timer of Blender."""

    def __init__(self):
        self.steps, self.waits_for, self.since = steps(), lambda: True, time.monotonic()

    def tick(self):
        try:
            if self.waits_for():
                self.waits_for, self.since = next(self.steps), time.monotonic()
            elif time.monotonic() - self.since > STEP_SECONDS_MAX:
                raise AssertionError(f"it takes too long: {[v.status for v in viewports()]}, "
                                     f"{self.waits_for.__code__}")
            return 0.02
        except StopIteration:
            print("VIEWPORT_OK", flush=True)
        except Exception:
            traceback.print_exc()
        sys.stdout.flush()
        bpy.ops.wm.quit_blender()
        return None


bpy.context.preferences.view.show_splash = False
bpy.ops.preferences.addon_enable(module="sheaf_blender")
bpy.app.timers.register(Driver().tick, first_interval=1.0, persistent=True)
