# Copyright the Sheaf authors.
# SPDX-License-Identifier: Apache-2.0
"""Scenes with shadow catchers."""
import bpy
import mathutils

Matrix = mathutils.Matrix


def _scene(b, is_transparent, **lamp):
    b.camera()
    b.background(0.4, (0.6, 0.8, 1.0))
    floor = b.plane(20, b.diffuse("Floor", (0.5, 0.5, 0.5)))
    floor.is_shadow_catcher = True
    b.sphere("Ball", (-0.6, 0, 1), 0.8, b.diffuse("Red", (0.7, 0.2, 0.1)))
    b.cube("Box", Matrix.Translation((1.4, 0.6, 0.5)) @ Matrix.Scale(0.5, 4),
           b.diffuse("Green", (0.2, 0.6, 0.2)))
    made = b.light("POINT", (-3, -2, 5), energy=600.0, shadow_soft_size=0.0, **lamp)
    b.scene.render.film_transparent = is_transparent
    return made


def catcher_transparent(b):
    _scene(b, True)


def catcher_over_sky(b):
    _scene(b, False)


def catcher_with_hidden(b):
    """An object half below the catcher, and one in a collection's instance that is a catcher."""
    _scene(b, True)
    b.sphere("Half", (-2.4, -1, 0), 0.6, b.diffuse("Blue", (0.1, 0.2, 0.7)))
    stand = b.cube("Stand", Matrix.Translation((2.4, -1, 0.4)) @ Matrix.Scale(0.4, 4),
                   b.diffuse("White", (0.8, 0.8, 0.8)))
    group = bpy.data.collections.new("Group")
    b.scene.collection.objects.unlink(stand)
    group.objects.link(stand)
    placed = b.add("Placed", None)
    placed.instance_type, placed.instance_collection = "COLLECTION", group
    placed.is_shadow_catcher = True


def catcher_under_light(b):
    """An object that shines on the catcher; the floor is small."""
    _scene(b, True)
    b.sphere("Shining", (0.6, -1.5, 0.5), 0.3, b.material("Shining", "ShaderNodeEmission",
                                                          Strength=6.0))
