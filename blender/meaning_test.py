#!/usr/bin/env python3
# Copyright the Sheaf authors.
# SPDX-License-Identifier: Apache-2.0
"""Tests the add-on's reading of Blender as far as it needs no Blender: sizes of frames, alpha and
tiles of images, mixed and added shaders, points within meshes, failures of single items.

Run: meaning_test.py. Needs numpy.
"""
import dataclasses
import io
import math
import os
import random
import sys
import types
import unittest

sys.dont_write_bytecode = True
sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))

import numpy

import settings_document
from sheaf_blender import catchers, passes
from sheaf_blender.export import placed_nodes, texture_nodes
from sheaf_blender.scene import (closures, containment, frame_size, image_pixels, materials,
                                 pixel_ops, ray_visibility, report, settings_table,
                                 settings_without_effect, sphere_map, text, units, values)
from sheaf_blender.scene.closures import BLACK, EMPTY, NOTHING, Closure

RED, WHITE = materials.diffuse((0.8, 0.1, 0.1)), materials.diffuse((0.8, 0.8, 0.8))
IMAGE = values.ImageValue("image")
RESOLUTIONS = ((300, 200), (1280, 720), (800, 600), (1920, 1080), (3840, 2160), (4096, 1716),
               (160, 120), (1, 1), (7, 5), (1080, 1920))


NODE = values.NodeValue("noise", (("scale", 3.0), ("dimensions", 2.0)), "world",
                        tuple(map(float, numpy.diag((2.0, 4.0, 1.0, 1.0)).ravel())),
                        wants_color=True)


class NodeValueTest(unittest.TestCase):
    def written(self, value, as_color):
        file = io.StringIO()
        table = materials.TextureTable(text.SceneText(file), None)
        return table.parameter("reflectance", value, as_color), file.getvalue()

    def test_nodes_are_textures_in_their_space(self):
        parameter, scene = self.written(NODE, True)
        self.assertEqual(parameter, {"texture reflectance": "t1"})
        self.assertIn("Transform [0.5 0 0 0 0 0.25 0 0 0 0 1 0 0 0 0 1]", scene)
        self.assertIn('Texture "t1" "spectrum" "node" "string node" "noise" '
                      '"string from" "position" "float scale" 3 "float dimensions" 2', scene)

    def test_operations_become_a_ramp_over_the_factor(self):
        doubled = values.apply(values.gray(NODE), "multiply", 2.0, 2.0, 2.0)
        self.assertTrue(doubled.is_simplified)
        parameter, scene = self.written(doubled, False)
        self.assertEqual(parameter, {"texture reflectance": "t2"})
        self.assertIn('Texture "t1" "float" "node"', scene)
        ramp = scene.splitlines()[-1]
        self.assertIn('"texture input" "t1" "float positions" [0 ', ramp)
        self.assertTrue(ramp.endswith(" 2]"), ramp)

    def test_a_factor_as_a_color_is_gray(self):
        _, scene = self.written(dataclasses.replace(NODE, wants_color=False), True)
        self.assertIn('"float positions" [0 1] "float colors" [0 0 0 1 1 1]', scene)

    def test_attributes_keep_their_colors(self):
        color = values.attribute_of_vertices("Col")
        _, scene = self.written(color, True)
        self.assertIn('"spectrum" "node" "string node" "attribute"', scene)
        tinted = values.apply(color, "multiply", 0.5, 1.0, 1.0)
        self.assertEqual(values.color_of_vertices(tinted),
                         ("Col", (("multiply", (0.5, 1.0, 1.0)),)))
        self.assertTrue(values.is_exact_at_vertices(tinted))
        self.assertFalse(values.is_exact_at_vertices(values.apply(color, "gamma", 2.0)))
        green = values.apply(color, "channel", 1)
        self.assertFalse(green.is_simplified)
        _, scene = self.written(green, False)
        self.assertIn('"float" "node" "string node" "attribute" "string from" "uv"', scene)
        self.assertIn('"string channel" "green"', scene)
        ramped = values.apply(color, "ramp", ((0.0,) * 3, (1.0,) * 3))
        self.assertEqual((ramped.at_vertices, ramped.parameters), ((), (("channel", "luminance"),)))
        self.assertIsNone(values.color_of_vertices(NODE))

    def test_places_of_objects_have_materials_of_their_own(self):
        node = dataclasses.replace(NODE, space="generated", matrix=tuple(
            map(float, numpy.identity(4).ravel())))
        shading = materials.diffuse(values.MixValue(node, RED.colors, 0.5))
        part = types.SimpleNamespace(shading=shading)
        moved = numpy.identity(4)
        moved[0, 3] = 10.0
        found = placed_nodes.in_world_space(node, ((1.0, 2.0, 3.0), (0.5, 2.0, 0.0)), moved)
        self.assertEqual(found.space, "world")
        matrix = numpy.array(found.matrix).reshape(4, 4)
        # The corners of the box, 10 to the right, are those of the unit cube.
        numpy.testing.assert_allclose(matrix @ (10.5, 0.0, 3.0, 1.0), (0, 0, 0.5, 1))
        numpy.testing.assert_allclose(matrix @ (11.5, 4.0, 4.0, 1.0), (1, 1, 1, 1))
        self.assertEqual(values.nodes_of(part.shading), [node])

    def test_rotations_turn_about_x_first(self):
        turned = texture_nodes.rotation_matrix((math.pi / 2, 0.0, math.pi / 2))
        numpy.testing.assert_allclose(turned @ (0, 1, 0), (0, 0, 1), atol=1e-12)
        numpy.testing.assert_allclose(turned @ (1, 0, 0), (0, 1, 0), atol=1e-12)


class CompositeTest(unittest.TestCase):
    """Numbers that two textures make."""
    TWO = dataclasses.replace(NODE, node="voronoi", wants_color=False, reach=(0.0, 2.0))
    ONE = dataclasses.replace(NODE, wants_color=False)

    def at(self, value, one, two):
        """The number where the textures have these."""
        if values.is_constant(value):
            return value
        if isinstance(value, values.NodeValue):
            number = one if value.node == "noise" else two
            if not value.operations:
                return number
        elif isinstance(value, values.RampValue):
            number = self.at(value.value, one, two)
            self.assertTrue(value.reach[0] - 1e-6 <= number <= value.reach[1] + 1e-6)
        elif isinstance(value, values.ScaleValue):
            return self.at(value.value, one, two) * self.at(value.factor, one, two)
        else:
            amount = self.at(value.amount, one, two)
            return (1 - amount) * self.at(value.first, one, two) + (
                amount * self.at(value.second, one, two))
        return float(pixel_ops.run(numpy.full((1, 3), number), value.operations)[0, 0])

    def test_math_of_two_textures(self):
        for one, two in ((0.25, 1.5), (0.75, 0.5), (0.1, 0.1)):
            for operation, wanted in (
                    ("ADD", one + two), ("SUBTRACT", one - two), ("MULTIPLY", one * two),
                    ("DIVIDE", one / two), ("MINIMUM", min(one, two)), ("MAXIMUM", max(one, two)),
                    ("LESS_THAN", one < two), ("GREATER_THAN", one > two)):
                found = values.math(operation, self.ONE, self.TWO)
                self.assertAlmostEqual(self.at(found, one, two), wanted, 6, operation)
                self.assertFalse(values.is_color(found))
                squared = values.apply(found, "math", "POWER", 2.0, True)
                self.assertAlmostEqual(self.at(squared, one, two), wanted**2, 6, operation)
        self.assertIsNone(values.math("POWER", self.ONE, self.TWO))

    def test_operations_follow_a_mix(self):
        mixed = values.mix(self.ONE, self.TWO, 0.5)
        steps = values.apply(mixed, "math", "GREATER_THAN", 0.6, True)
        self.assertEqual(self.at(steps, 0.9, 0.4), 1.0)  # Each of them alone gives 1 and 0.
        self.assertEqual(values.reach_of(mixed), (0.0, 2.0))
        colored = values.apply(mixed, "ramp", ((1.0, 0.0, 0.0), (0.0, 0.0, 1.0)))
        self.assertTrue(values.is_color(colored))
        self.assertFalse(values.is_color(values.gray(colored)))

    def test_colors_change_by_channels(self):
        red, blue = (0.8, 0.1, 0.05), (0.1, 0.3, 0.7)
        ramps = [values.apply(each, "ramp", (red, blue)) for each in (
            self.ONE, dataclasses.replace(self.TWO, reach=(0.0, 1.0)))]
        colors = [numpy.array(red) * (1 - at) + numpy.array(blue) * at for at in (0.25, 0.75)]

        def channels(value):
            return [self.at(values.apply(value, "channel", i), 0.25, 0.75) for i in range(3)]
        for kind, wanted in (("MULTIPLY", colors[0] * colors[1]),
                             ("SCREEN", 1 - (1 - colors[0]) * (1 - colors[1])),
                             ("DIFFERENCE", abs(colors[0] - colors[1])),
                             ("DARKEN", numpy.minimum(*colors))):
            numpy.testing.assert_allclose(channels(values.blend(kind, *ramps)), wanted, atol=2e-3)
        bright = values.apply(values.add(*ramps), "clamp", 0.0, 0.7)
        numpy.testing.assert_allclose(channels(bright), numpy.minimum(sum(colors), 0.7), atol=2e-3)
        self.assertIsNone(values.blend("SOFT_LIGHT", *ramps))

    def test_they_are_ramps_over_textures(self):
        file = io.StringIO()
        table = materials.TextureTable(text.SceneText(file), None)
        added = values.math("SUBTRACT", self.ONE, self.TWO)
        table.parameter("reflectance", values.apply(added, "clamp", 0.0, 1.0), True)
        written = file.getvalue()
        self.assertIn('"float" "mix"', written)
        self.assertIn('"float" "scale"', written)
        self.assertIn('"spectrum" "ramp" "texture input"', written)
        table.parameter("base_color", added, True)  # A color, which is not negative.
        self.assertEqual(file.getvalue().count('"spectrum" "ramp"'), 2)


class FrameSizeTest(unittest.TestCase):
    def test_percentages_are_integers_rounded_down(self):
        self.assertEqual(frame_size.size_of(300, 200, 29), (87, 58))
        for width, height in RESOLUTIONS:
            for percentage in range(1, 201):
                found = frame_size.size_of(width, height, percentage)
                exact = [max(1, (size * percentage - size * percentage % 100) // 100)
                         for size in (width, height)]
                self.assertEqual(list(found), exact)

    def test_edges_of_regions_are_float32(self):
        self.assertEqual(frame_size.window_of((0.1, 0.7, 0.0, 1.0), 160, 120), (16, 112, 0, 120))

    def test_regions_lie_within_the_frame(self):
        seeded = random.Random(7)
        for width, height in RESOLUTIONS:
            for _ in range(100):
                x, y = (sorted(seeded.random() for _ in range(2)) for _ in range(2))
                x0, x1, y0, y1 = frame_size.window_of((*x, *y), width, height)
                self.assertTrue(0 <= x0 < x1 <= width and 0 <= y0 < y1 <= height)


class ImagePixelsTest(unittest.TestCase):
    def setUp(self):
        self.pixels = numpy.full((2, 2, 4), 0.5, numpy.float32)

    def test_alpha_scales_the_encoded_color(self):
        found = image_pixels.colors(self.pixels, "multiply", True)
        self.assertAlmostEqual(float(found[0, 0, 0]), ((0.25 + 0.055) / 1.055) ** 2.4, 6)
        self.assertAlmostEqual(float(image_pixels.colors(self.pixels, "divide", False)[0, 0, 0]),
                               1.0)
        self.assertAlmostEqual(float(image_pixels.colors(self.pixels, "keep", False)[0, 0, 0]), 0.5)

    def test_nothing_is_divided_by_an_alpha_of_0(self):
        self.pixels[...] = 0
        self.assertEqual(float(image_pixels.colors(self.pixels, "divide", False).max()), 0.0)

    def test_images_of_one_channel_are_gray(self):
        found = image_pixels.colors(self.pixels[:, :, :1], "multiply", False)
        numpy.testing.assert_array_equal(found, numpy.full((2, 2, 3), 0.5))
        self.assertFalse(image_pixels.has_alpha(self.pixels[:, :, :3]))
        self.assertTrue(image_pixels.has_alpha(self.pixels))

    def test_mean_tilt(self):
        n = numpy.array([math.sin(0.3), 0.0, math.cos(0.3)])
        pixels = numpy.tile(numpy.float32(n * 0.5 + 0.5), (4, 4, 1))
        self.assertAlmostEqual(image_pixels.mean_tilt_degrees(pixels), math.degrees(0.3), 3)

    def test_tiles_lie_side_by_side_and_missing_ones_are_pink(self):
        small, large = numpy.zeros((1, 1, 3)), numpy.ones((2, 2, 3))
        pixels, columns, rows = image_pixels.atlas({1001: small, 1012: large})
        self.assertEqual((pixels.shape, columns, rows), ((4, 4, 3), 2, 2))
        self.assertEqual(pixels[0, 0].tolist(), [0, 0, 0])
        self.assertEqual(pixels[3, 3].tolist(), [1, 1, 1])
        self.assertEqual(pixels[0, 3].tolist(), list(closures.PINK))

    def test_tiles_have_a_limit(self):
        with self.assertRaisesRegex(ValueError, "shrink them"):
            image_pixels.atlas({1001: numpy.zeros((1, 1, 3)), 1900: numpy.zeros((4096, 4096, 3))})


class ClosureTest(unittest.TestCase):
    def setUp(self):
        self.report = report.Report()

    def mix(self, first, second, factor):
        return closures.mix(first, second, factor, "m", self.report)

    def add(self, first, second):
        return closures.add(first, second, "m", self.report)

    def shown(self, closure):
        """The light that a surface adds, and the part of what is behind that is seen."""
        alpha = closures.opacity(closure)
        return alpha * closure.emission[0], 1 - alpha

    def test_transparent_and_emission_weigh_once(self):
        for factor in (0.25, 0.5):
            found = self.mix(EMPTY, Closure(None, 1.0, (2.0, 1.0, 0.0)), factor)
            self.assertEqual(self.shown(found), (2.0 * factor, 1 - factor))
        found = self.mix(Closure(None, 1.0, (2.0, 1.0, 0.0)), EMPTY, IMAGE)
        self.assertEqual(found.emission, (2.0, 1.0, 0.0))

    def test_mixes_of_partly_transparent_light(self):
        half = Closure(None, 0.5, (2.0, 0.0, 0.0))
        light, passes = self.shown(self.mix(half, Closure(RED, 1.0), 0.5))
        self.assertAlmostEqual(light, 0.5)
        self.assertAlmostEqual(passes, 0.25)

    def test_added_light_does_not_hide_what_is_behind(self):
        light, passes = self.shown(self.add(EMPTY, Closure(None, 1.0, (0.5, 0.2, 0.1))))
        self.assertAlmostEqual(light, 0.5)
        self.assertGreaterEqual(passes, 0.9)
        self.assertIn("shines casts 10% of a shadow", self.report.lines()[0])

    def test_added_light_of_opaque_surfaces(self):
        found = self.add(Closure(RED, 1.0, (1.0, 0.0, 0.0)), Closure(None, 1.0, (0.5, 0.0, 0.0)))
        self.assertEqual((found.material, self.shown(found)), (RED, (1.5, 0.0)))
        self.assertEqual(self.report.lines(), [])

    def test_empty_inputs_add_nothing_and_mix_black(self):
        surface = Closure(RED, 1.0)
        self.assertEqual(self.add(surface, NOTHING), surface)
        self.assertEqual(self.add(NOTHING, surface), surface)
        self.assertEqual(self.mix(surface, NOTHING, 0.5).material,
                         materials.mix(RED, materials.diffuse(BLACK), 0.5))
        self.assertEqual(self.report.lines(), [])

    def test_factors_are_clamped(self):
        self.assertEqual(self.mix(Closure(RED), Closure(WHITE), 3.0).material, WHITE)
        over = values.apply(IMAGE, "multiply", 3, 3, 3)
        found = values.mix((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), over)
        self.assertEqual([name for name, _ in found.amount.operations][-2:], ["clamp", "gray"])
        self.assertEqual(values.clamped(IMAGE), IMAGE)


class ContainmentTest(unittest.TestCase):
    def setUp(self):
        corners = numpy.array([(x, y, z) for z in (-1, 1) for y in (-1, 1) for x in (-1, 1)],
                              numpy.float32)
        faces = [(0, 2, 3, 1), (4, 5, 7, 6), (0, 1, 5, 4), (2, 6, 7, 3), (0, 4, 6, 2), (1, 3, 7, 5)]
        triangles = [t for a, b, c, d in faces for t in ((a, b, c), (a, c, d))]
        self.cube = (corners, numpy.int32(triangles))

    def test_points_in_a_cube(self):
        seeded = random.Random(3)
        for _ in range(200):
            point = [seeded.uniform(-2, 2) for _ in range(3)]
            found = containment.nearest_around(point, [self.cube])
            self.assertEqual(found is not None, max(map(abs, point)) < 1, point)

    def test_the_nearest_part_bounds(self):
        corners, triangles = self.cube
        parts = [(corners, triangles[:2]), (corners, triangles[2:])]
        self.assertIsNotNone(containment.nearest_around((0, 0, 0), parts))
        self.assertIsNone(containment.nearest_around((0, 0, 3), parts))

    def test_between_two_spheres_of_one_mesh(self):
        corners, triangles = self.cube
        hollow = (numpy.concatenate([corners, corners / 2]),
                  numpy.concatenate([triangles, triangles + 8]))
        self.assertIsNone(containment.nearest_around((0.1, 0, 0), [hollow]))
        self.assertEqual(containment.nearest_around((0.7, 0, 0), [hollow]), 0)


class ColorTest(unittest.TestCase):
    def test_curves_are_followed_and_continued(self):
        line = tuple(i / 4 for i in range(5))
        square = tuple(x * x for x in line)
        pixels = numpy.array([[0.5, 0.5, 2.0], [0.25, -1.0, 0.0]])
        tables = (square, line, square)
        found = pixel_ops.run(pixels, (("curves", (tables, 0.0, 1.0, False, 1.0)),))
        numpy.testing.assert_allclose(found, [[0.25, 0.5, 1.0], [0.0625, 0.0, 0.0]])
        found = pixel_ops.run(pixels, (("curves", (tables, 0.0, 1.0, True, 0.5)),))
        numpy.testing.assert_allclose(found[0, 2], 2 + (1 + 1.75 - 2) / 2)
        numpy.testing.assert_allclose(found[1, 1], -1.0)

    def test_black_bodies_run_from_red_to_blue(self):
        for kelvin in (965, 1167, 1449, 1902, 3315, 6365):
            before, after = units.blackbody_rgb(kelvin - 0.01), units.blackbody_rgb(kelvin)
            numpy.testing.assert_allclose(before, after, rtol=0.01, atol=0.01)
        for kelvin in (1500, 3000, 6500, 10000):
            self.assertAlmostEqual(values.gray(units.blackbody_rgb(kelvin)), 1.0, 1)
        self.assertEqual(units.blackbody_rgb(-5), units.blackbody_rgb(800))
        self.assertEqual(units.blackbody_rgb(1e9), units.blackbody_rgb(12000))

    def test_mirror_balls_show_what_is_behind_at_their_edge(self):
        directions = numpy.array([[0.0, -1.0, 0.0], [0.0, 1.0, 0.0], [1.0, 0.0, 0.0],
                                  [0.0, 0.0, 2.0]])
        u, v = sphere_map.direction_to_mirror_ball(directions)
        numpy.testing.assert_allclose(u, [0.5, 0.5, 0.5 + math.sqrt(0.125) * 1, 0.5], atol=1e-6)
        numpy.testing.assert_allclose(v, [0.5, 0.5, 0.5, 0.5 + math.sqrt(0.125)], atol=1e-6)

    def test_directions_are_mapped_before_they_are_looked_up(self):
        pixels = numpy.zeros((8, 16, 3), numpy.float32)
        pixels[4:] = 1  # The upper half.
        swap = numpy.diag([1.0, 1.0, -1.0, 1.0])
        up = numpy.array([[0.1, 0.0, 1.0]])
        self.assertEqual(sphere_map.look_up(pixels, up, numpy.eye(4))[0, 0], 1)
        self.assertEqual(sphere_map.look_up(pixels, up, swap)[0, 0], 0)
        mean = sphere_map.equal_area(pixels, swap, "EQUIRECTANGULAR", 32).mean()
        self.assertAlmostEqual(float(mean), 0.5, 2)

    def test_the_sky_is_taken_out_of_pixels(self):
        combined = numpy.full((1, 3, 4), 0.6, numpy.float32)
        alpha = numpy.array([[0.0, 0.5, 1.0]], numpy.float32)
        passes.take_out_sky(combined, alpha, numpy.full((1, 3, 3), 0.4, numpy.float32))
        numpy.testing.assert_allclose(combined[0, :, 0], [0.0, 0.4, 0.6], rtol=1e-6)
        passes.take_out_sky(combined, alpha, None)
        numpy.testing.assert_allclose(combined[0, :, 3], 0.6, rtol=1e-6)


class SettingsTest(unittest.TestCase):
    def test_the_document_has_the_present_table(self):
        with open(settings_document.PATH, encoding="utf-8") as file:
            found = file.read()
        self.assertEqual(found, settings_document.with_table(found),
                         "run blender/settings_document.py")

    def test_no_setting_is_in_two_lists(self):
        for owner, settings in settings_table.TABLE.items():
            listed = [name for setting in settings for name in setting.names.split()]
            self.assertEqual(len(listed), len(set(listed)), owner)
            silent = settings_without_effect.NAMES.get(owner, frozenset())
            self.assertFalse(set(listed) & silent, owner)

    def test_settings_with_an_effect_are_reported(self):
        lines = report.Report()
        settings_table.note("CyclesWorldSettings", types.SimpleNamespace(max_bounces=3),
                            'world "W"', lines)
        settings_table.note("ViewLayer", types.SimpleNamespace(
            aovs=["key"], lightgroups=["key"], pass_alpha_threshold=0.50000001), "layer", lines)
        self.assertEqual([entry.item for entry in lines.entries], ['world "W"', "layer"])


class RayVisibilityTest(unittest.TestCase):
    def test_words_of_the_scene_file(self):
        parameter = ray_visibility.parameter
        self.assertEqual(parameter(()), {})
        self.assertEqual(parameter(("shadow", "camera")),
                         {"string invisible": ("camera", "shadow")})
        self.assertEqual(parameter(("volume scatter",)), {})
        self.assertEqual(parameter(("volume scatter", "diffuse")),
                         {"string invisible": ("diffuse", "volume")})
        self.assertEqual(parameter(("volume scatter", "shadow"), is_lamp=True),
                         {"string invisible": ("volume",)})
        self.assertEqual(len(parameter(ray_visibility.RAYS)["string invisible"]), 6)

    def test_shadows_of_their_own(self):
        for hidden, splits in (((), False), (("camera",), False), (("shadow",), True),
                               (("diffuse",), True), (("volume scatter",), False),
                               ((*ray_visibility.SCATTERED, "shadow"), False)):
            self.assertEqual(ray_visibility.splits_shadow(hidden), splits, hidden)

    def test_worlds(self):
        world = types.SimpleNamespace(camera=False, diffuse=True, glossy=False, transmission=True,
                                      scatter=False)
        self.assertEqual(ray_visibility.hidden_from_world(world), {"glossy", "volume scatter"})
        self.assertEqual(ray_visibility.hidden_from_world(None), set())

    def test_techniques_that_know_kinds(self):
        known = ray_visibility.known_techniques
        self.assertEqual(known(["--samples", "4"]), ["--samples", "4"])
        for given, left in (("auto", "auto"), ("camera+light+guiding+merging", "camera+guiding"),
                            ("light", "camera"), ("camera+sharing+views", "camera"),
                            ("camera+chains", "camera")):
            self.assertEqual(known(["--techniques", given]), ["--techniques", left])

    def test_text_knows_whether_something_is_hidden(self):
        written = text.SceneText(io.StringIO())
        written.directive("Shape", "sphere", {"float radius": 1.0})
        self.assertFalse(written.has_ray_kinds)
        written.directive("Shape", "sphere", ray_visibility.parameter(("glossy",)))
        self.assertTrue(written.has_ray_kinds)
        with written.lights_with({"string a": "1"}), written.lights_with({"string b": "2"}):
            written.directive("LightSource", "point")
        self.assertTrue(written._file.getvalue().endswith(
            'LightSource "point" "string a" "1" "string b" "2"\n'))


class CatcherTest(unittest.TestCase):
    """Pixels: catcher in light, in half shadow, an object, its edge, an object under the catcher,
    nothing.
    """
    RED, FLOOR = numpy.array([0.4, 0.1, 0.1]), numpy.array([0.5, 0.5, 0.5])

    def image(self, *pixels):
        colors, alpha = zip(*((numpy.zeros(3) + color, part) for color, part in pixels))
        return numpy.array([colors], numpy.float32), numpy.array([alpha], numpy.float32)

    def composed(self, sky):
        red, floor = self.RED, self.FLOOR
        whole = self.image((floor, 1), (floor / 2, 1), (red, 1), ((red + floor) / 2, 1), (floor, 1),
                           (0, 0))
        unseen = self.image((0, 0), (0, 0), (red, 1), (red / 2, 0.5), (red, 1), (0, 0))
        alone = self.image((floor, 1), (floor, 1), (floor, 1), (floor, 1), (floor, 1), (0, 0))
        covered = numpy.array([[1, 1, 0, 0.5, 1, 0]], numpy.float32)
        return catchers.composed(whole, unseen, alone, covered, sky)[0]

    def test_alpha_is_shadow_and_objects(self):
        found = self.composed(None)
        numpy.testing.assert_allclose(found[:, 3], [0, 0.5, 1, 0.5, 0, 0], atol=1e-6)
        numpy.testing.assert_allclose(found[:, :3], [(0, 0, 0), (0, 0, 0), self.RED, self.RED / 2,
                                                     (0, 0, 0), (0, 0, 0)], atol=1e-6)

    def test_the_sky_is_behind(self):
        found = self.composed(numpy.full((1, 6, 3), 0.8, numpy.float32))
        numpy.testing.assert_allclose(found[:, 3], numpy.ones(6))
        numpy.testing.assert_allclose(found[0, :3], [0.8] * 3, rtol=1e-6)
        numpy.testing.assert_allclose(found[1, :3], [0.4] * 3, rtol=1e-6)
        numpy.testing.assert_allclose(found[3, :3], self.RED / 2 + 0.4, rtol=1e-6)


class FailureTest(unittest.TestCase):
    def test_a_failure_is_a_line_and_leaves_no_half_item(self):
        file, found = io.StringIO(), report.Report()
        written = text.SceneText(file)
        with found.guard('object "A"'), written.whole():
            written.raw("AttributeBegin")
            written.directive("Translate", {"float x": math.nan})
        with found.guard('object "B"'), written.whole():
            written.raw("Identity")
        self.assertEqual(file.getvalue(), "Identity\n")
        self.assertRegex(found.lines()[0], r'^object "A": it cannot be exported: nan cannot stand '
                                           r".*\(ValueError at text.py:\d+\) \(left out\)$")

    def test_interruptions_are_no_failures(self):
        with self.assertRaises(KeyboardInterrupt), report.Report().guard("object"):
            raise KeyboardInterrupt

    def test_numbers_are_those_that_the_format_takes(self):
        file = io.StringIO()
        table = materials.MaterialTable(text.SceneText(file),
                                        materials.TextureTable(text.SceneText(file), None))
        table.name_of(materials.make("hair", floats={"eta": 0.0, "beta_m": 2.0}), "Hair")
        self.assertIn('"float beta_m" 1 "float eta" 0.1', file.getvalue())

    def test_surfaces_reflect_no_more_than_all(self):
        bright = materials.diffuse((1.5, 0.5, 0.5))
        self.assertEqual(materials.bounded(bright), materials.diffuse((1.0, 0.5, 0.5)))
        self.assertEqual(materials.bounded(materials.mix(bright, RED, IMAGE)).parts[0],
                         materials.diffuse((1.0, 0.5, 0.5)))
        self.assertIs(materials.bounded(RED), RED)

    def test_names_stand_only_for_what_is_written(self):
        file = io.StringIO()
        table = materials.MaterialTable(text.SceneText(file),
                                        materials.TextureTable(text.SceneText(file), None))
        wrong = materials.make("dielectric", floats={"eta": math.nan})
        for _ in range(2):
            with self.assertRaises(ValueError):
                table.name_of(wrong, "Wrong")
        self.assertEqual(table.name_of(RED, "Wrong"), "Wrong")


if __name__ == "__main__":
    unittest.main()
