# Copyright the Sheaf authors.
# SPDX-License-Identifier: Apache-2.0
"""Runs inside Blender without a window: the engine's functions for the 3D viewport, called with
regions of our own.

blender -b --factory-startup --python region_in_blender.py
Prints REGION_OK.
"""
import gc
import os
import sys
import time
import types

import bpy
import mathutils
import numpy

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
import in_blender

SECONDS_MAX = 120
SAMPLES = 16


def check(condition, message):
    print(("  ok: " if condition else "  FAILED: ") + message, flush=True)
    if not condition:
        raise AssertionError(message)


def projection(edges, near=0.1, far=100.0, is_perspective=True):
    """Blender's matrix of a view with these edges, in tangents or units."""
    left, right, bottom, top = edges
    found = mathutils.Matrix.Diagonal((2 / (right - left), 2 / (top - bottom), 0, 0))
    if is_perspective:
        found[0][2], found[1][2] = (right + left) / (right - left), (top + bottom) / (top - bottom)
        found[2][2], found[2][3] = (far + near) / (near - far), 2 * far * near / (near - far)
        found[3][2] = -1
    else:
        found[0][3], found[1][3] = (left + right) / (left - right), (bottom + top) / (bottom - top)
        found[2][2], found[2][3], found[3][3] = 2 / (near - far), (far + near) / (near - far), 1
    return found


class Region:
    """A region of the 3D viewport, and the context of calls for it."""

    def __init__(self, width, height, place=(0, -6, 1), is_perspective=True):
        self.region = types.SimpleNamespace(width=width, height=height)
        self.space_data = Space()
        self.region_data = types.SimpleNamespace(view_perspective="PERSP")
        self.look(place, is_perspective)

    def look(self, place, is_perspective=True):
        data, half = self.region_data, 0.5 if is_perspective else 3.0
        turn = mathutils.Vector((0, 0, 0)) - mathutils.Vector(place)
        matrix = mathutils.Matrix.LocRotScale(place, turn.to_track_quat("-Z", "Y"), None)
        data.view_matrix = matrix.inverted()
        data.is_perspective = is_perspective
        data.view_perspective = "PERSP" if is_perspective else "ORTHO"
        tall = half * self.region.height / self.region.width
        data.window_matrix = projection((-half, half, -tall, tall), is_perspective=is_perspective)

    def look_through(self, camera_object, scene, zoom=1.0):
        """As Blender fits a camera in a region of the same shape. zoom: parts of the region."""
        frame = camera_object.data.view_frame(scene=scene)
        is_perspective = camera_object.data.type != "ORTHO"
        xs = [corner.x / (-corner.z if is_perspective else 1) for corner in frame]
        ys = [corner.y / (-corner.z if is_perspective else 1) for corner in frame]
        middle = (min(xs) + max(xs)) / 2, (min(ys) + max(ys)) / 2
        half = (max(xs) - min(xs)) / 2 / zoom, (max(ys) - min(ys)) / 2 / zoom
        data = self.region_data
        data.view_matrix = camera_object.matrix_world.normalized().inverted()
        data.is_perspective, data.view_perspective = is_perspective, "CAMERA"
        data.window_matrix = projection(
            (middle[0] - half[0], middle[0] + half[0], middle[1] - half[1], middle[1] + half[1]),
            is_perspective=is_perspective)


class Space(types.SimpleNamespace):
    def __init__(self):
        super().__init__(camera=None, use_local_camera=False, clip_end=100.0,
                         use_render_border=False, render_border_min_x=0.0, render_border_max_x=1.0,
                         render_border_min_y=0.0, render_border_max_y=1.0)


def make_engine():
    """The mixed-in functions, on an engine that counts what Blender is asked for. Each image that
    would be drawn is in `drawn`.
    """
    from sheaf_blender import engine, viewport_engine

    class Engine(viewport_engine.ViewportEngine):
        note_view = engine.SheafRenderEngine.note_view

        def __init__(self):
            self.redraws, self.updates, self.status, self.drawn = 0, 0, "", []

        def tag_redraw(self):
            self.redraws += 1

        def tag_update(self):
            self.updates += 1

        def update_stats(self, _, status):
            self.status = status

        def bind_display_space_shader(self, scene):
            pass

        def unbind_display_space_shader(self):
            pass
    return Engine()


class Bench:
    """An engine with a region, driven as Blender does: a timer ticks, and what it asks for is
    called.
    """

    def __init__(self, region):
        from sheaf_blender import viewport, viewport_engine
        viewport_engine._shown_in = lambda space: None  # The space is no one of Blender's.
        self.engine, self.context = make_engine(), region
        drawn = self.engine.drawn

        def draw(viewport_self, scene, view_layer, size):
            found = viewport_self.newest(scene, view_layer)
            if found is not None:
                drawn.append(found)
        viewport.Viewport.draw = draw
        self.call_update()

    @property
    def viewport(self):
        return self.engine._of_region

    @property
    def process(self):
        return self.viewport._process._process

    def depsgraph(self):
        return bpy.context.evaluated_depsgraph_get()

    def call_update(self):
        self.engine.view_update(self.context, self.depsgraph())

    def call_draw(self):
        self.engine.view_draw(self.context, self.depsgraph())

    def wait(self, condition):
        end = time.monotonic() + SECONDS_MAX
        while not condition():
            assert time.monotonic() < end, f"it takes too long: {self.engine.status}"
            redraws, updates = self.engine.redraws, self.engine.updates
            assert self.viewport.tick()
            if self.engine.updates > updates:
                self.call_update()
            if self.engine.redraws > redraws:
                self.call_draw()
            time.sleep(0.01)

    def image(self):
        """Draws until the view's image is complete. Returns (pixels, place)."""
        self.call_draw()
        self.wait(lambda: self.engine.drawn and self.engine.status.endswith(f" {SAMPLES} samples"))
        return self.engine.drawn[-1]


def f12(scene, size):
    """The same view by F12: (height, width, 4), rows from the bottom."""
    path = os.path.join(os.environ["HOME"], "f12.exr")
    render = scene.render
    render.resolution_x, render.resolution_y, render.resolution_percentage = *size, 100
    render.image_settings.file_format, render.filepath = "OPEN_EXR", path
    scene.sheaf.samples, scene.sheaf.techniques = SAMPLES, "camera"
    bpy.ops.render.render(write_still=True)
    image = bpy.data.images.load(path)
    flat = numpy.empty(size[0] * size[1] * image.channels, numpy.float32)
    image.pixels.foreach_get(flat)
    bpy.data.images.remove(image)
    return flat.reshape(size[1], size[0], -1)


def means(pixels):
    return pixels[..., :3].reshape(-1, 3).mean(axis=0)


def are_close(one, other, part=0.03):
    return (abs(means(one) - means(other)) <= part * means(other)).all()


def check_views(bench, scene):
    """Perspective, orthographic and camera views; a moved view keeps the scene."""
    first, place = bench.image()
    check(first.shape == (60, 90, 4) and place == (0, 0, 1, 1), "an image fills the region")
    check(bool((first[..., 3] == 1).all()), "it is opaque")
    process, path = bench.process, bench.viewport._path
    bench.context.look((2, -5, 2))
    moved, _ = bench.image()
    check(abs(moved - first).mean() > 0.01, "another view is another image")
    bench.context.look((0, -6, 1))
    again, _ = bench.image()
    check(bool((abs(again - first) < 1e-6).all()), "the view before gives the image before")
    bench.context.look((0, -6, 1), is_perspective=False)
    flat, _ = bench.image()
    check(abs(flat - first).mean() > 0.01, "orthographic views are others")
    check((bench.process, bench.viewport._path) == (process, path),
          "all of that with one process and one export")

    camera = scene.camera
    for kind in ("PERSP", "ORTHO"):
        camera.data.type, camera.data.shift_x = kind, 0.1
        bpy.context.view_layer.update()
        scene.render.resolution_x, scene.render.resolution_y = 90, 60
        bench.context.look_through(camera, scene)
        bench.call_update()
        bench.wait(lambda: bench.viewport._changed is None)
        seen, _ = bench.image()
        check(are_close(seen, f12(scene, (90, 60))),
              f"the view through a camera ({kind}) is that of F12")
        bench.wait(lambda: bench.viewport._changed is None)
    camera.data.type, camera.data.shift_x = "PERSP", 0.0
    bpy.context.view_layer.update()


def check_sizes(bench, scene):
    bench.context.region.width, bench.context.region.height = 47, 81
    bench.context.look((0, -6, 1))
    found, _ = bench.image()
    check(found.shape == (81, 47, 4), "another size is another image")
    space = bench.context.space_data
    space.use_render_border, space.render_border_min_x, space.render_border_max_y = True, 0.5, 0.25
    part, place = bench.image()
    check(part.shape == (20, 23, 4), f"a border is a part of it: {part.shape}")
    check(abs(place[0] - 24 / 47) < 1e-6 and abs(place[1]) < 1e-6, f"at its place: {place}")
    check(bool((abs(part - found[:20, 24:]) < 1e-6).all()), "with the same pixels")
    space.use_render_border = False
    bench.context.region.width, bench.context.region.height = 90, 60

    scene.render.use_border, scene.render.border_max_x = True, 0.5
    scene.render.border_max_y = 1.0
    bench.context.look_through(scene.camera, scene, zoom=0.5)
    _, place = bench.image()
    check(abs(place[0] - 0.25) < 0.02 and abs(place[2] - 0.25) < 0.02
          and abs(place[3] - 0.5) < 0.04, f"a camera's border lies in its frame: {place}")
    scene.render.use_border = False
    bench.context.region.width = bench.context.region.height = 0
    bench.call_draw()
    check(not bench.viewport.problem, "a region without pixels is left alone")
    bench.context.region.width, bench.context.region.height = 90, 60
    bench.context.look((0, -6, 1))


def check_edits(bench, scene):
    def edited(change):
        before, path = bench.image()[0], bench.viewport._path
        change()
        bpy.context.view_layer.update()
        bench.call_update()
        bench.viewport.note_change()
        bench.wait(lambda: bench.viewport._path != path)
        return abs(bench.image()[0] - before).mean() > 0.002
    process = bench.process
    ball = bpy.data.objects["Ball"]
    material = ball.data.materials[0]

    def move():
        ball.location.x += 0.8

    def paint():
        node = next(each for each in material.node_tree.nodes if each.type == "BSDF_DIFFUSE")
        node.inputs["Color"].default_value = (0, 1, 0, 1)

    def brighten():
        for each in bpy.data.lights:
            each.energy *= 4
    for change in (move, paint, brighten):
        check(edited(change), f"{change.__name__} changes the image")
    check(bench.process is process, "edits keep the process")
    path = bench.viewport._path
    bench.viewport.note_change()
    bench.wait(lambda: bench.viewport._changed is None)
    check(bench.viewport._path == path and bench.viewport.status.endswith(f" {SAMPLES} samples"),
          "what changes nothing, such as a selection, keeps the image")


def check_film(bench, scene):
    scene.render.film_transparent = True
    bpy.context.view_layer.update()
    bench.context.look((0.01, -6, 1))
    found, _ = bench.image()
    check(found[..., 3].min() == 0 and bool((found[found[..., 3] == 0] == 0).all()),
          "a transparent film has no sky")
    scene.render.film_transparent = False


def check_deaths(bench, scene):
    process = bench.process
    process.kill()
    process.wait()
    bench.wait(lambda: bench.viewport._process is not None and bench.process is not process)
    check(bench.image()[0].shape == (60, 90, 4), "a killed process is replaced")

    from sheaf_blender import viewport
    path = bench.viewport._path
    os.remove(path)
    bench.process.kill()
    bench.process.wait()
    bench.wait(lambda: path in bench.engine.status)
    check(path in bench.engine.status, "a lost scene is told")
    bench.viewport.note_change()
    bench.wait(lambda: bench.viewport._path != path)
    check(bench.image()[0].shape == (60, 90, 4), "the next change brings it back")

    folder, process = bench.viewport._folder, bench.process
    bench.context.look((0, -7, 1))
    scene.sheaf.viewport_samples = 65536
    bench.call_draw()
    del bench.engine
    gc.collect()
    process.wait(SECONDS_MAX)
    check(process.returncode == 0, "the process ends with the engine, also while it renders")
    check(not os.path.exists(folder) and not list(viewport.PRESENT), "nothing is left")


def check_failures(scene):
    """Whatever is wrong is a line in the region."""
    from sheaf_blender import viewport
    preferences = bpy.context.preferences.addons["sheaf_blender"].preferences
    folder, preferences.program_folder = preferences.program_folder, "/nowhere"
    bench = Bench(Region(90, 60))
    bench.call_draw()
    check("no program sheaf" in bench.engine.status, "a missing program is told")
    preferences.program_folder = folder
    bench.viewport.note_change()
    scene.sheaf.viewport_samples = SAMPLES
    check(bench.image()[0].shape == (60, 90, 4), "it is found later")
    original = viewport.export_scene

    def fail(*_):
        raise KeyError("planted")
    viewport.export_scene = fail
    bench.viewport.note_change()
    bench.wait(lambda: "planted" in bench.viewport.problem)
    bench.call_draw()
    check("planted" in bench.engine.status, "an exception of the export is told")
    viewport.export_scene = original
    camera, scene.camera = scene.camera, None
    bpy.context.view_layer.update()
    bench.viewport.note_change()
    bench.wait(lambda: not bench.viewport.problem)
    check(bench.image()[0].shape == (60, 90, 4), "a scene without a camera is shown")
    scene.camera = camera
    process = bench.process
    bpy.ops.preferences.addon_disable(module="sheaf_blender")
    process.wait(SECONDS_MAX)
    check(process.returncode == 0, "the process ends with the add-on")


def main():
    scene = in_blender.build("lights", os.environ["HOME"])
    scene.world.use_nodes = False
    scene.world.color = (0.1, 0.2, 0.3)
    in_blender.use_sheaf(scene, SAMPLES)
    scene.sheaf.viewport_samples = SAMPLES
    bench = Bench(Region(90, 60))
    bpy.context.view_layer.update()
    check_views(bench, scene)
    check_sizes(bench, scene)
    check_edits(bench, scene)
    check_film(bench, scene)
    check_deaths(bench, scene)
    check_failures(scene)
    print("REGION_OK", flush=True)


try:
    main()
finally:
    # Blender waits for threads that read from processes.
    from sheaf_blender.farm import view_process
    view_process._kill_all()
