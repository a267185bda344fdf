#!/usr/bin/env python3
# Copyright the Sheaf authors.
# SPDX-License-Identifier: Apache-2.0
"""The parts of the add-on that need no Blender: text, meshes, units, maps, materials.

Run: exporter_test.py. Needs numpy.
"""
import io
import math
import os
import sys
import tempfile
import unittest

sys.dont_write_bytecode = True
sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))

import numpy

from sheaf_blender import jobs, passes
from sheaf_blender.farm import page, program
from sheaf_blender.scene import (closures, content, materials, mesh_arrays, pixel_ops,
                                 ply, principled, report, sphere_map, strands, text, units, values)


def written(write):
    file = io.StringIO()
    write(text.SceneText(file))
    return file.getvalue()


class TextTest(unittest.TestCase):
    def test_directives(self):
        line = written(lambda t: t.directive("Shape", "sphere", {
            "float radius": 0.1, "bool b": True, "integer i": 3, "string s": 'a"b\\', "rgb L":
            (1.0, 0.5, 0.25)}))
        self.assertEqual(line, 'Shape "sphere" "float radius" 0.1 "bool b" true "integer i" 3 '
                               '"string s" "a\\"b\\\\" "rgb L" [1 0.5 0.25]\n')

    def test_numbers_are_exact_float32_and_finite(self):
        for value in numpy.float32([1 / 3, 1e-30, 123456.789, -0.1]):
            self.assertEqual(numpy.float32(text.number(value)), value)
        with self.assertRaisesRegex(ValueError, "correct the value"):
            text.number(math.nan)

    def test_matrices_are_written_by_columns(self):
        rows = [[1, 2, 3, 4], [5, 6, 7, 8], [9, 10, 11, 12], [0, 0, 0, 1]]
        self.assertEqual(text.matrix_text(rows), "[1 5 9 0 2 6 10 0 3 7 11 0 4 8 12 1]")


class OutputTest(unittest.TestCase):
    def test_output_paths_mean_what_they_mean_in_blender(self):
        """Regression: #### was added always. The paths are those of scene.render.frame_path."""
        for path, seventh in (("/o/shot_####", "/o/shot_0007.exr"),
                              ("/o/shot_", "/o/shot_0007.exr"),
                              ("/o/####_beauty", "/o/0007_beauty.exr"), ("/o/", "/o/0007.exr"),
                              ("/o#1/a", "/o#1/a0007.exr"), ("/o/a#2_##.png", "/o/a#2_07.exr"),
                              ("/o/shot.####", "/o/shot.0007.exr"),
                              ("/o/shot.png", "/o/shot.png0007.exr"),
                              ("/o/v1.2_#", "/o/v1.2_7.exr")):
            self.assertEqual(jobs.frame_path(jobs.output_pattern(path), 7), seventh, path)


class MeshTest(unittest.TestCase):
    def setUp(self):
        # Two triangles that share an edge, as four corners each would in Blender.
        self.positions = numpy.float32([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [9, 9, 9]])
        self.corner_vertices = numpy.int32([0, 1, 2, 0, 2, 3])
        self.triangles = numpy.int32([[0, 1, 2], [3, 4, 5]])

    def test_positions_alone_share_vertices_and_drop_unused_ones(self):
        built = mesh_arrays.build(self.positions, self.corner_vertices, self.triangles)
        self.assertEqual(len(built.positions), 4)
        numpy.testing.assert_array_equal(built.positions[built.triangles.reshape(-1)],
                                         self.positions[self.corner_vertices])
        numpy.testing.assert_array_equal(
            self.positions[self.corner_vertices[built.corners]], built.positions)

    def test_corners_are_joined_where_all_agrees(self):
        uvs = numpy.float32([[0, 0], [1, 0], [1, 1], [0, 0], [0.5, 0.5], [0, 1]])
        normals = numpy.tile(numpy.float32([0, 0, 1]), (6, 1))
        built = mesh_arrays.build(self.positions, self.corner_vertices, self.triangles, normals,
                                  uvs)
        self.assertEqual(len(built.positions), 5)  # Vertex 2 has two uvs.
        flat = built.triangles.reshape(-1)
        numpy.testing.assert_array_equal(built.uvs[flat], uvs)
        numpy.testing.assert_array_equal(built.normals[flat], normals)
        numpy.testing.assert_array_equal(built.positions[flat],
                                         self.positions[self.corner_vertices])

    def test_zeros_of_both_signs_are_joined(self):
        first, _ = mesh_arrays.weld(numpy.int32([0, 0]), uvs=numpy.float32([[0, -0.0], [-0.0, 0]]))
        self.assertEqual(len(first), 1)

    def test_colors_of_corners(self):
        colors = numpy.arange(24, dtype=numpy.float32).reshape(6, 4)
        colors[3] = colors[0]
        built = mesh_arrays.build(self.positions, self.corner_vertices, self.triangles,
                                  colors=colors)
        self.assertEqual(len(built.positions), 5)  # Vertex 2 has two colors.
        numpy.testing.assert_array_equal(built.colors[built.triangles.reshape(-1)], colors)
        head = bytes(ply.ply_chunks(built.positions, built.triangles, colors=built.colors)[0])
        self.assertIn(b"property float red\nproperty float green\nproperty float blue\n"
                      b"property float alpha\nelement face", head)

    def test_a_part_of_the_triangles(self):
        built = mesh_arrays.build(self.positions, self.corner_vertices, self.triangles[1:])
        numpy.testing.assert_array_equal(built.positions[built.triangles[0]],
                                         self.positions[[0, 2, 3]])

    def test_materials_beyond_the_slots_mean_the_last_one(self):
        found = mesh_arrays.by_material(numpy.int32([0, 7, 1]), 2)
        self.assertEqual([slot for slot, _ in found], [0, 1])
        numpy.testing.assert_array_equal(found[1][1], [1, 2])

    def test_area(self):
        self.assertAlmostEqual(
            mesh_arrays.area(self.positions, numpy.int32([[0, 1, 2], [0, 2, 3]])), 1.0)

    def test_ply(self):
        data = b"".join(bytes(chunk) for chunk in ply.ply_chunks(
            self.positions, self.triangles, uvs=numpy.zeros((5, 2), numpy.float32)))
        head, _, body = data.partition(b"end_header\n")
        self.assertIn(b"element vertex 5\nproperty float x", head)
        self.assertIn(b"property float v\nelement face 2\nproperty list uchar int vertex_indices",
                      head)
        self.assertEqual(len(body), 5 * 5 * 4 + 2 * 13)
        numpy.testing.assert_array_equal(
            numpy.frombuffer(body[:100], "<f4").reshape(5, 5)[:, :3], self.positions)
        self.assertEqual(body[100], 3)
        numpy.testing.assert_array_equal(numpy.frombuffer(body[101:113], "<i4"), [0, 1, 2])

    def test_infinite_coordinates_are_refused(self):
        self.positions[0, 0] = math.inf
        with self.assertRaisesRegex(ValueError, "not finite"):
            ply.ply_chunks(self.positions, self.triangles)


class ContentTest(unittest.TestCase):
    def setUp(self):
        self._folder = tempfile.TemporaryDirectory()
        self.addCleanup(self._folder.cleanup)
        self.root = self._folder.name

    def test_what_is_there_is_not_written_again(self):
        first = content.ContentFolder(self.root)
        path = first.put([b"ab", b"c"], ".ply")
        os.utime(path, (1, 1))
        second = content.ContentFolder(self.root)
        self.assertEqual(second.put([b"abc"], ".ply"), path)
        self.assertEqual((first.written, second.written, second.kept), (1, 0, 1))
        self.assertGreater(os.stat(path).st_mtime, 1)
        self.assertNotEqual(second.put([b"abd"], ".ply"), path)

    def test_what_stands_for_the_bytes_names_them(self):
        folder = content.ContentFolder(self.root)
        path = folder.put([b"normal 0.1"], ".ply", [b"smooth"])
        self.assertEqual(folder.put([b"normal 0.10000001"], ".ply", [b"smooth"]), path)
        with open(path, "rb") as file:
            self.assertEqual(file.read(), b"normal 0.1")
        self.assertNotEqual(folder.put([b"normal 0.1"], ".ply", [b"sharp"]), path)

    def test_a_failed_write_leaves_nothing(self):
        def fail(file):
            file.write(b"half")
            raise OSError("full")
        with self.assertRaises(OSError):
            content.ContentFolder(self.root).put_named("abcd", ".ply", fail)
        self.assertEqual(os.listdir(os.path.join(self.root, "ab")), [])

    def test_changed_files_are_copied_again(self):
        source = os.path.join(self.root, "a.png")
        with open(source, "wb") as file:
            file.write(b"one")
        folder = content.ContentFolder(os.path.join(self.root, "content"))
        first = folder.put_file(source)
        self.assertEqual(folder.put_file(source), first)
        with open(source, "wb") as file:
            file.write(b"three")
        self.assertNotEqual(folder.put_file(source), first)

    def test_prune_keeps_what_was_used_last(self):
        folder = content.ContentFolder(self.root)
        old, new = folder.put([b"x" * 100], ".a"), folder.put([b"y" * 100], ".a")
        os.utime(old, (1, 1))
        folder.prune(150)
        self.assertEqual((os.path.exists(old), os.path.exists(new)), (False, True))


class UnitsTest(unittest.TestCase):
    def test_lights_of_equal_power_agree_far_away(self):
        # A sphere of radius r and radiance L has the intensity pi r^2 L.
        self.assertAlmostEqual(units.sphere_radiance(100, 0.3) * math.pi * 0.09,
                               units.point_intensity(100))

    def test_radiance_that_cycles_shows(self):
        # A camera of Cycles (Blender 3.4) that looks at lights of 100 W.
        self.assertAlmostEqual(units.area_radiance(100, 1.0, False), 25.0)
        self.assertAlmostEqual(units.area_radiance(100, math.pi / 4, False), 31.83099, 4)
        self.assertAlmostEqual(units.sphere_radiance(100, 0.5), 10.132118, 5)
        # A plane of albedo 0.5 at a distance of 6, below small lights of 500 W, of Cycles 3.4 and
        # 4.3: the ratio of what it shows.
        self.assertAlmostEqual(units.area_radiance(500, 0.01, True)
                               / units.area_radiance(500, 0.01, False), 0.67003 / 0.52588,
                               delta=0.002)

    def test_a_sun_of_any_size_gives_its_irradiance(self):
        angle = 0.8
        steps = (numpy.arange(10000) + 0.5) / 10000 * angle / 2
        flux = 2 * math.pi * (numpy.sin(steps) * numpy.cos(steps)).sum() * angle / 2 / 10000
        self.assertAlmostEqual(units.sun_radiance(3.0, angle) * flux, 3.0, 5)

    def test_spot_lights_fall_as_cycles_shows_them(self):
        # Cycles of Blender 3.4: a lamp of 100 W, 2 above a white plane; radiance of points beside
        # the foot of its axis.
        cone, delta = (math.radians(angle) for angle in units.spot_cone(1.0, 0.5))
        for x, expected in ((0.2, 0.62117803), (0.7, 0.50362045), (0.9, 0.2654683)):
            distance = math.hypot(x - 0.003125, 0.003125, 2)  # The center of that pixel.
            cosine = 2 / distance
            t = min(1.0, (cosine - math.cos(cone)) / (math.cos(cone - delta) - math.cos(cone)))
            lamp = 100 / (4 * math.pi) * t * t * (3 - 2 * t) * cosine
            self.assertAlmostEqual(lamp * cosine / distance**2 / math.pi, expected, 3)
        self.assertAlmostEqual(units.spot_cone(1.0, 0.0)[1], 0.0)

    def test_spot_map(self):
        profile = units.spot_map(1.0, 0.5, 128)
        self.assertAlmostEqual(profile[64, 64, 0], 1.0, 3)
        self.assertEqual(profile[0, 0, 0], 0.0)
        # The flux per intensity of a sharp cone with the cosine: pi sin^2.
        sharp = units.spot_map(1.0, 0.0, 256)
        self.assertAlmostEqual(sharp.mean() * 4 * math.pi, math.pi * math.sin(0.5)**2, delta=0.02)

    def test_black_bodies_have_luminance_one(self):
        for kelvin in (1500, 6500, 12000):
            r, g, b = units.blackbody_rgb(kelvin)
            self.assertAlmostEqual(0.2126 * r + 0.7152 * g + 0.0722 * b, 1, delta=0.05)
        self.assertGreater(units.blackbody_rgb(2000)[0], units.blackbody_rgb(2000)[2] * 5)


class SphereMapTest(unittest.TestCase):
    def test_square_covers_the_sphere_evenly(self):
        u, v = numpy.meshgrid(*[(numpy.arange(64) + 0.5) / 64] * 2)
        d = sphere_map.square_to_sphere(u, v)
        numpy.testing.assert_allclose(numpy.linalg.norm(d, axis=-1), 1, atol=1e-12)
        numpy.testing.assert_allclose(d.mean(axis=(0, 1)), 0, atol=1e-3)
        numpy.testing.assert_allclose((d**2).mean(axis=(0, 1)), 1 / 3, atol=1e-3)

    def test_centre_is_up_and_corners_are_down(self):
        middle, corner = (sphere_map.square_to_sphere(numpy.array(p), numpy.array(p))
                          for p in (0.5, 0.0))
        numpy.testing.assert_allclose(middle, [0, 0, 1], atol=1e-12)
        numpy.testing.assert_allclose(corner, [0, 0, -1], atol=1e-12)

    def test_means_over_the_sphere_stay(self):
        height = 32
        pixels = numpy.random.default_rng(3).uniform(0, 1, (height, 64, 3)).astype(numpy.float32)
        pixels[24, 10] = 100
        weights = numpy.cos(numpy.pi * ((numpy.arange(height) + 0.5) / height - 0.5))
        expected = (pixels * weights[:, None, None]).sum(axis=(0, 1)) / (64 * weights.sum())
        square = sphere_map.equal_area_from_equirectangular(pixels, 128)
        numpy.testing.assert_allclose(square.mean(axis=(0, 1)), expected, rtol=0.02)

    def test_blender_looks_up_the_front_in_the_middle(self):
        # Blender's manual: the middle of the map lies in the direction -y of the default camera
        # view; the formula of Cycles has u = 0.5 at +x and u = 0.25 at +y.
        u, v = sphere_map.direction_to_equirectangular(numpy.array([[1.0, 0, 0], [0, 1.0, 0]]))
        numpy.testing.assert_allclose(u, [0.5, 0.25])
        numpy.testing.assert_allclose(v, [0.5, 0.5])


class MaterialTest(unittest.TestCase):
    def setUp(self):
        self.report = report.Report()

    def test_mix_of_transparent_is_alpha(self):
        solid = closures.Closure(materials.diffuse((0.5, 0.5, 0.5)))
        mixed = closures.mix(closures.EMPTY, solid, 0.25, "m", self.report)
        self.assertEqual((mixed.material, mixed.alpha), (solid.material, 0.25))
        mixed = closures.mix(solid, closures.EMPTY, 0.25, "m", self.report)
        self.assertEqual(mixed.alpha, 0.75)
        self.assertEqual(self.report.lines(), [])

    def test_mix_of_emission_and_surface(self):
        solid = closures.Closure(materials.diffuse((0.8, 0.8, 0.8)))
        shine = closures.Closure(None, 1.0, (4.0, 2.0, 1.0))
        mixed = closures.mix(solid, shine, 0.25, "m", self.report)
        self.assertEqual(mixed.emission, (1.0, 0.5, 0.25))
        self.assertEqual(mixed.material.kind, "mix")
        self.assertEqual(closures.add(solid, shine, "m", self.report).emission, shine.emission)

    def test_diffuse_and_translucent_are_one_material(self):
        front = closures.Closure(materials.diffuse((0.4, 0.4, 0.4)))
        back = closures.Closure(materials.make("diffusetransmission", {
            "reflectance": closures.BLACK, "transmittance": (1.0, 0.5, 0.0)}))
        mixed = closures.mix(front, back, 0.5, "m", self.report).material
        self.assertEqual(mixed.kind, "diffusetransmission")
        self.assertEqual(dict(mixed.colors), {"reflectance": (0.2, 0.2, 0.2),
                                              "transmittance": (0.5, 0.25, 0.0)})

    def test_tables_write_each_thing_once(self):
        image = values.ImageValue("a", "linear", "clamp", (2.0, 1.0, 0.5, 0.0))
        gold = principled.metal(image, {"roughness": 0.5})

        def write(scene):
            textures = materials.TextureTable(scene, lambda value: ("/x.png", value.encoding))
            table = materials.MaterialTable(scene, textures)
            self.assertEqual(table.name_of(gold, "Gold"), "Gold")
            self.assertEqual(table.name_of(gold, "Other"), "Gold")
            self.assertEqual(table.name_of(materials.diffuse(image), "Gold"), "Gold'")
        lines = written(write).splitlines()
        self.assertEqual(len(lines), 3)
        self.assertIn('Texture "t1" "spectrum" "imagemap" "string filename" "/x.png" "string '
                      'encoding" "linear" "string wrap" "clamp"', lines[0])
        self.assertIn('"float uscale" 2 "float udelta" 0.5', lines[0])
        self.assertIn('"string type" "principled" "texture base_color" "t1"', lines[1])


class ValuesTest(unittest.TestCase):
    IMAGE = values.ImageValue("a")

    def test_constants_are_computed_and_images_remember(self):
        self.assertEqual(values.apply((0.5, 0.25, 1.0), "multiply", 2, 2, 2), (1.0, 0.5, 2.0))
        self.assertEqual(values.apply(0.25, "invert", 1.0), 0.75)
        inverted = values.apply(self.IMAGE, "invert", 1.0)
        self.assertEqual(inverted.operations, (("invert", (1.0,)),))
        pixels = pixel_ops.run(numpy.array([[0.1, 0.2, 0.3]]), inverted.operations)
        numpy.testing.assert_allclose(pixels, [[0.9, 0.8, 0.7]])

    def test_gray_is_luminance(self):
        self.assertAlmostEqual(values.gray((1.0, 0.0, 0.0)), 0.2126)
        self.assertFalse(values.is_color(values.gray(self.IMAGE)))

    def test_products(self):
        gray = values.gray(self.IMAGE)
        self.assertEqual(values.multiply(self.IMAGE, gray), values.ScaleValue(self.IMAGE, gray))
        product = values.multiply(self.IMAGE, values.ImageValue("b"))  # By channels.
        self.assertTrue(values.is_color(product))
        self.assertEqual(values.multiply(self.IMAGE, 1.0), self.IMAGE)

    def test_hue_and_ramp(self):
        red = numpy.array([[0.8, 0.2, 0.2]])
        same = pixel_ops.run(red, (("hue_saturation", (0.5, 1.0, 1.0, 1.0)),))
        numpy.testing.assert_allclose(same, red, atol=1e-6)
        turned = pixel_ops.run(red, (("hue_saturation", (0.5 + 1 / 3, 1.0, 1.0, 1.0)),))
        numpy.testing.assert_allclose(turned, [[0.2, 0.8, 0.2]], atol=1e-6)
        ramp = (("ramp", (((0.0, 0.0, 0.0), (1.0, 0.5, 0.0)),)),)
        numpy.testing.assert_allclose(pixel_ops.run(numpy.full((1, 3), 0.5), ramp),
                                      [[0.5, 0.25, 0.0]])

    def test_normal_strength(self):
        flat = pixel_ops.run(numpy.array([[0.9, 0.5, 0.8]]), (("normal_strength", (0.0,)),))
        numpy.testing.assert_allclose(flat, [[0.5, 0.5, 1.0]])


class RestTest(unittest.TestCase):
    def test_strands_pass_through_their_points(self):
        points = numpy.float32([[0, 0, 0], [1, 0, 0], [2, 1, 0]])
        bezier = strands.bezier_points(points)
        self.assertEqual(len(bezier), 7)
        numpy.testing.assert_array_equal(bezier[0::3], points)
        lines = strands.strands_text(numpy.concatenate([points, points[:1]]), [3, 1], 0.1, 0.05)
        self.assertEqual(lines.count("Shape"), 1)
        self.assertIn('"float width0" 0.1 "float width1" 0.05', lines)

    def test_report_counts_once_and_has_a_limit(self):
        made = report.Report()
        for i in range(report.ENTRIES_MAX + 5):
            made.left_out("x", str(i))
            made.left_out("x", str(i))
        self.assertEqual(len(made.entries), report.ENTRIES_MAX)
        self.assertIn("10 more entries", made.lines()[-1])

    def test_depth_is_along_the_axis(self):
        cosines = passes.depth_cosines((-1.0, 1.0, -0.5, 0.5), (4, 2), ())
        self.assertAlmostEqual(cosines[0, 0], 1 / math.sqrt(1 + 0.75**2 + 0.25**2))
        part = passes.depth_cosines((-1.0, 1.0, -0.5, 0.5), (4, 2), (1, 3, 1, 2))
        numpy.testing.assert_array_equal(part, cosines[1:2, 1:3])

    def test_mist_as_cycles_shows_it(self):
        # World > Mist Pass of Blender: from the start over the depth; 1 where nothing is.
        distance = numpy.array([1.0, 5.0, 15.0, 25.0, 0.0])
        alpha = numpy.array([1.0, 1.0, 1.0, 0.5, 0.0])
        numpy.testing.assert_allclose(passes.mist(distance, alpha, 5.0, 20.0, 2.0),
                                      [0, 0, 0.25, 1, 1])
        numpy.testing.assert_allclose(passes.mist(distance, alpha, 5.0, 20.0, 0.5)[2], 0.5**0.5)

    def test_vectors_point_back_with_y_up(self):
        # A shutter of half a frame: 2 pixels to the right and 1 down are 4 and 2 in a frame.
        numpy.testing.assert_array_equal(passes.vector(numpy.array([2.0, 1.0]), 0.5),
                                         [-4, 2, -4, 2])

    def test_mattes_are_described_by_the_names_of_blenders_files(self):
        found = dict(passes.matte_metadata({
            "cryptomatte/abc1234/name": "CryptoObject", "cryptomatte/abc1234/manifest": "{}",
            "cryptomatte/abc1234/hash": "MurmurHash3_32", "Software": "x"}, "View Layer"))
        self.assertEqual(sorted(found.values()), ["MurmurHash3_32", "View Layer.CryptoObject",
                                                  "{}"])
        prefixes = {field.rpartition("/")[0] for field in found}
        self.assertEqual(len(prefixes), 1)
        self.assertRegex(prefixes.pop(), "^cryptomatte/[0-9a-f]{7}$")

    def test_addresses(self):
        self.assertEqual(page.with_default_port("farm:7400", 7480), "farm:7480")
        self.assertEqual(page.with_default_port("farm", 7480), "farm:7480")
        self.assertEqual(page.with_default_port("[::1]:7400", 80), "[::1]:80")
        self.assertFalse(page.has_port("[::1]"))

    def test_messages_of_the_program(self):
        self.assertEqual(program.Message('{"severity":"error","message":"x"}').severity, "error")
        self.assertEqual(program.Message("plain").text, "plain")
        with self.assertRaisesRegex(program.SheafError, "no program sheaf in /nowhere"):
            program.find_program("/nowhere")

    def test_progress(self):
        fraction, line = program.progress_text({"name": "jobs/1", "progress": {
            "sample_count_done": 1, "sample_count_total": 4, "relative_mse": 0.01,
            "remaining_duration_seconds": 3.0}})
        self.assertEqual((fraction, line), (0.25, "jobs/1: 25 %, error ±10 %, 3 s left"))
        self.assertGreater(jobs.PREVIEW_SECONDS_MIN, 0)


if __name__ == "__main__":
    unittest.main()
