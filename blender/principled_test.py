#!/usr/bin/env python3
# Copyright the Sheaf authors.
# SPDX-License-Identifier: Apache-2.0
"""The Principled BSDF of Blender 3.4 and 4.3, and shaders like it, as principled materials.

Run: principled_test.py. Needs numpy.
"""
import io
import math
import os
import sys
import unittest

sys.dont_write_bytecode = True
sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))

import numpy

from sheaf_blender.scene import materials, pixel_ops, principled, report, text, values

GRAY = values.ImageValue("g", "linear", operations=(("gray", ()),))
PICTURE = values.ImageValue("p")
COLOR = (0.8, 0.4, 0.1)
# Energy that Blender before 4.0 gives a base of roughness 0.5, below nothing.
DIFFUSE_HALF = 1.009


class PrincipledTest(unittest.TestCase):
    def setUp(self):
        self.report = report.Report()

    def made(self, **inputs):
        inputs = {"base_color": COLOR, **inputs}
        return principled.principled_material(principled.PrincipledInputs(**inputs), "m",
                                              self.report, lambda value: values.gray(value)
                                              if values.is_constant(value) else 0.5)

    def old(self, **inputs):
        return self.made(**{"specular_tint": 0.0, "sheen_tint": 0.0, "is_layered": False, **inputs})

    def floats(self, material):
        self.assertEqual(material.kind, "principled")
        return dict(material.floats)

    def says(self):
        return "\n".join(self.report.lines())

    def test_plastic_is_written_as_it_is(self):
        material = self.made(roughness=0.3)
        self.assertEqual(self.floats(material), {"roughness": 0.3})
        self.assertEqual(dict(material.colors), {"base_color": COLOR})
        self.assertEqual(self.says(), "")

    def test_one_material_says_the_mixture_where_the_parts_agree(self):
        self.assertEqual(self.floats(self.made(metallic=0.25))["metallic"], 0.25)
        self.assertEqual(self.floats(self.made(metallic=GRAY, roughness=GRAY)),
                         {"metallic": GRAY, "roughness": GRAY})
        white = self.made(base_color=(1, 1, 1), transmission=GRAY)
        self.assertEqual(self.floats(white)["transmission"], GRAY)

    def test_parts_that_differ_are_a_mix(self):
        mixed = self.made(transmission=0.25)
        self.assertEqual((mixed.kind, dict(mixed.floats)), ("mix", {"amount": 0.25}))
        glass = mixed.parts[1]
        self.assertEqual(self.floats(glass)["transmission"], 1.0)
        # Light that crosses the boundary twice has the color.
        numpy.testing.assert_allclose(numpy.square(dict(glass.colors)["base_color"]), COLOR)
        mixed = self.old(metallic=GRAY)
        self.assertEqual(mixed.kind, "mix")
        self.assertEqual(dict(mixed.parts[1].colors)["base_color"], COLOR)
        self.assertGreater(dict(mixed.parts[0].colors)["base_color"][1], COLOR[1])

    def test_glass_before_4_tints_at_each_crossing(self):
        self.assertEqual(dict(self.old(transmission=1.0).colors)["base_color"], COLOR)
        tinted = self.old(transmission=1.0, specular_tint=1.0)
        self.assertEqual(dict(tinted.colors)["specular_tint"], COLOR)

    def test_layers_that_are_added_keep_the_albedo(self):
        material = self.old(coat=1.0, sheen=0.5, keeps_energy=False)
        floats = self.floats(material)
        self.assertEqual(floats["coat"], 0.25)
        sheen = dict(material.colors)["sheen_color"][0]
        mean = principled.fresnel_mean(1.5)
        self.assertAlmostEqual(mean, 0.0918, 3)  # Glass: Judd 1942.
        once, more = principled.reflection_means(1.5, 0.5)
        self.assertAlmostEqual(floats["specular"], once / (once + more), 3)
        left = ((1 - once) * (1 - 0.25 * sum(principled.reflection_means(1.5, 0.03)))
                * (1 - 0.5 * principled.ADDED_SHEEN_ALBEDO))
        numpy.testing.assert_allclose(
            left * numpy.array(dict(material.colors)["base_color"]),
            DIFFUSE_HALF * numpy.array(COLOR), rtol=1e-3)
        self.assertLess(sheen, 0.06)

    def test_rough_layers_reflect_less(self):
        """By the reflected directions, uniformly over the hemisphere."""
        self.assertEqual(principled.reflection_means(1.5, 0.0), (principled.fresnel_mean(1.5), 0.0))
        steps = (numpy.arange(80) + 0.5) / 80
        seen, leaving, turn = numpy.meshgrid(steps, steps, 2 * math.pi * steps)
        for roughness in (0.5, 0.9):
            alpha = roughness ** 2
            half = numpy.stack([numpy.sqrt(1 - seen**2) + numpy.sqrt(1 - leaving**2)
                                * numpy.cos(turn), numpy.sqrt(1 - leaving**2) * numpy.sin(turn),
                                seen + leaving])
            half /= numpy.linalg.norm(half, axis=0)
            met = half[0] * numpy.sqrt(1 - seen**2) + half[2] * seen
            spread = alpha**2 / (math.pi * (half[2]**2 * (alpha**2 - 1) + 1)**2)
            masked = [(numpy.sqrt(1 + alpha**2 * (1 / mu**2 - 1)) - 1) / 2
                      for mu in (seen, leaving)]
            inside = numpy.sqrt(1 - (1 - met**2) / 1.5**2)
            fresnel = (((1.5 * met - inside) / (1.5 * met + inside))**2
                       + ((met - 1.5 * inside) / (met + 1.5 * inside))**2) / 2
            shares = spread * fresnel / (1 + masked[0] + masked[1]) / (4 * seen * leaving)
            mean = (shares * leaving * 2 * seen).mean() * 2 * math.pi
            self.assertLess(abs(principled.reflection_means(1.5, roughness)[0] / mean - 1), 0.02)

    def test_specular_sets_the_index(self):
        # 0.5 is the reflection of the index 1.5 in both versions.
        for make in (self.made, self.old):
            self.assertNotIn("ior", self.floats(make()))
        self.assertAlmostEqual(principled.reflectance_of_ior(
            self.floats(self.old(specular=1.0))["ior"]), 0.08, 6)
        self.assertAlmostEqual(principled.reflectance_of_ior(
            self.floats(self.made(specular=0.25, ior=2.0))["ior"]), 1 / 18, 6)
        self.assertEqual(self.made(specular=0.0), materials.diffuse(COLOR))

    def test_a_texture_of_specular_scales_the_tint_of_the_greatest_reflection(self):
        material = self.made(specular=GRAY, specular_tint=(1.0, 0.5, 0.5))
        self.assertAlmostEqual(principled.reflectance_of_ior(self.floats(material)["ior"]), 0.08, 6)
        tint = dict(material.colors)["specular_tint"]
        self.assertEqual(tint.operations[-1], ("multiply", (1.0, 0.5, 0.5)))

    def test_tints_before_4_have_the_hue_of_the_base(self):
        material = self.old(base_color=(0.1, 0.1, 0.8), specular_tint=1.0)
        f0 = (principled.reflectance_of_ior(self.floats(material)["ior"])
              * numpy.array(dict(material.colors)["specular_tint"]))
        self.assertAlmostEqual(float(f0 @ (0.2126, 0.7152, 0.0722)), 0.04, 6)
        numpy.testing.assert_allclose(f0 / f0[2], (1 / 8, 1 / 8, 1))
        hue = pixel_ops.run(numpy.array([[0, 0, 0], [0.1, 0.1, 0.8]]), (("hue", (0.5,)),))
        numpy.testing.assert_allclose(hue[0], 1)
        self.assertAlmostEqual(hue[1] @ (0.2126, 0.7152, 0.0722), 1)

    def test_anisotropy_keeps_both_roughnesses(self):
        floats = self.floats(self.made(metallic=1.0, roughness=0.5, anisotropic=0.8, rotation=0.25))
        across = floats["roughness"] ** 2
        along = across + (1 - across) * floats["anisotropy"] ** 2
        aspect = math.sqrt(1 - 0.9 * 0.8)
        self.assertAlmostEqual(across, 0.25 * aspect)
        self.assertAlmostEqual(along, 0.25 / aspect)
        self.assertAlmostEqual(floats["anisotropy_rotation"], math.pi / 2)
        self.assertEqual(principled.facets(1.0, 0.5, 0.0, float)["roughness"], 0.5 ** 0.5)

    def test_coat_film_and_sheen(self):
        floats = self.floats(self.made(coat=0.5, coat_roughness=0.1, coat_ior=1.6, film_nm=300.0))
        self.assertEqual((floats["coat"], floats["coat_roughness"], floats["coat_ior"]),
                         (0.5, 0.1, 1.6))
        self.assertEqual((floats["iridescence"], floats["iridescence_thickness_nm"]), (1.0, 300.0))
        tinted = self.made(coat=0.5, coat_tint=(1.0, 0.5, 0.0))
        numpy.testing.assert_allclose(dict(tinted.colors)["base_color"], (0.8, 0.3, 0.05))
        self.assertIn("Coat Tint", self.says())
        tinted = self.made(coat=0.5, coat_tint=0.5)  # A number that is linked to the color.
        numpy.testing.assert_allclose(dict(tinted.colors)["base_color"], (0.6, 0.3, 0.075))
        cloth = dict(self.made(sheen=1.0, sheen_tint=(0.5, 1.0, 0.5)).colors)["sheen_color"]
        numpy.testing.assert_allclose(cloth, (0.415, 0.83, 0.415))  # The default roughness, 0.5.
        self.assertNotIn("Sheen", self.says())
        self.made(sheen=1.0, sheen_roughness=0.9)
        self.assertIn("less sheen than in Cycles", self.says())

    def test_subsurface_stays_a_walk_and_cannot_be_mixed(self):
        wax = self.made(subsurface=1.0, roughness=0.5)
        self.assertEqual((wax.kind, dict(wax.floats)["roughness"]), ("subsurface", 0.25))
        self.assertEqual(self.made(subsurface=1.0, metallic=0.5).kind, "principled")
        self.assertIn("the surface is metal", self.says())
        self.assertEqual(self.made(subsurface=0.2).kind, "principled")
        self.assertIn("below 0.5", self.says())

    def test_what_is_left_out_is_reported(self):
        self.made(metallic=1.0, specular_tint=(1.0, 0.5, 0.5))
        self.made(coat=1.0, coat_tint=PICTURE)
        self.old(base_color=PICTURE, sheen=PICTURE)
        for part in ("Specular Tint of metal", "a texture of Coat Tint"):
            self.assertIn(part, self.says())

    def test_textured_bases_before_4_are_scaled(self):
        color = dict(self.old(base_color=PICTURE).colors)["base_color"]
        self.assertEqual(color.value, PICTURE)
        self.assertGreater(color.factor, 1.05)

    def test_values_stay_in_the_ranges_of_the_material(self):
        material = self.made(base_color=(1.5, -0.1, 0.5), roughness=2.0, metallic=-1.0, ior=50.0,
                             coat=3.0, coat_ior=0.5)
        self.assertEqual(dict(material.colors)["base_color"], (1.0, 0.0, 0.5))
        floats = self.floats(material)
        self.assertEqual((floats["roughness"], floats["coat"], floats["coat_ior"], floats["ior"]),
                         (1.0, 1.0, 1.0, 10.0))
        self.assertNotIn("metallic", floats)


class GlassTest(unittest.TestCase):
    def setUp(self):
        self.report = report.Report()

    def glass(self, *arguments, **more):
        return principled.glass(*arguments, "m", self.report, **more)

    def test_clear_glass_is_a_dielectric(self):
        clear = self.glass((1.0, 1.0, 1.0), 0.5, 1.45)
        self.assertEqual((clear.kind, dict(clear.floats)), ("dielectric",
                                                            {"roughness": 0.25, "eta": 1.45}))
        self.assertEqual(self.glass((1.0, 1.0, 1.0), 0.0, 1.0).kind, "interface")
        self.assertEqual(principled.principled_material(principled.PrincipledInputs(
            base_color=(1.0, 1.0, 1.0), transmission=1.0), "m", self.report).kind, "dielectric")

    def test_colored_glass_is_a_boundary(self):
        red = self.glass((1.0, 0.1, 0.1), 0.5, 1.45, specular=0.0)
        self.assertEqual(dict(red.floats), {"roughness": 0.5, "ior": 1.45, "specular": 0.0,
                                            "transmission": 1.0})
        self.assertTrue(materials.is_boundary(red))
        self.assertFalse(materials.is_boundary(principled.metal((1.0, 1.0, 1.0), {})))
        self.assertEqual(self.report.lines(), [])
        self.glass((1.0, 0.1, 0.1), 0.0, 0.8)
        self.assertIn("the color of glass with the index 0.8", self.report.lines()[0])

    def test_what_is_written(self):
        file = io.StringIO()
        scene = text.SceneText(file)
        table = materials.MaterialTable(scene, materials.TextureTable(
            scene, lambda value: ("/x.png", value.encoding)))
        table.name_of(principled.surface({"base_color": COLOR}, {"roughness": GRAY, "coat": 1.0},
                                         metallic=1.0), "Car")
        self.assertEqual(file.getvalue().splitlines()[1],
                         'MakeNamedMaterial "Car" "string type" "principled" "rgb base_color" '
                         '[0.8 0.4 0.1] "float coat" 1 "float metallic" 1 "texture roughness" "t1"')


if __name__ == "__main__":
    unittest.main()
