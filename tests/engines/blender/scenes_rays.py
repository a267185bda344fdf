# Copyright the Sheaf authors.
# SPDX-License-Identifier: Apache-2.0
"""Scenes about Ray Visibility: what rays of some kinds do not see."""

import bpy
import mathutils

from scenes_findings import room, volume

Matrix = mathutils.Matrix


def hide(made, *rays):
    for ray in rays:
        setattr(made, f"visible_{ray}", False)


def mirror(b, roughness=0.0):
    """A wall behind the room that reflects it."""
    metal = b.material("Mirror", "ShaderNodeBsdfGlossy", Color=(0.9, 0.9, 0.9, 1),
                       Roughness=roughness)
    return b.cube("Mirror", Matrix.Translation((0, 2.5, 2)) @ Matrix.Diagonal((3, 0.1, 2, 1)),
                  metal)


def cube(b, place, color=(0.1, 0.8, 0.1), name="Cube"):
    return b.cube(name, Matrix.Translation(place) @ Matrix.Scale(0.5, 4), b.diffuse(name, color))


def rays_camera(b):
    """The camera does not see the ball, whose shadow and reflection are there."""
    hide(room(b), "camera")
    mirror(b)
    cube(b, (1.6, 0.5, 0.5))


def rays_shadow(b):
    """Under the sky and a lamp, a cube without shadow."""
    room(b)
    b.light("AREA", (-1.6, 0, 5), (-1.6, 0, 0), energy=200.0, size=0.5)
    hide(cube(b, (-1.6, 0, 1.2)), "shadow")


def rays_diffuse(b):
    """A bright wall that lights no diffuse surface, but the mirror shows it."""
    room(b)
    mirror(b)
    wall = b.cube("Bright", Matrix.Translation((-3, 0, 1)) @ Matrix.Diagonal((0.1, 1, 1, 1)),
                  b.material("Bright", "ShaderNodeEmission", Strength=5.0))
    hide(wall, "diffuse", "shadow")


def rays_glossy(b):
    """Mirrors do not show a cube, and rough metal not the lamp."""
    room(b)
    mirror(b)
    hide(cube(b, (1.6, 0.5, 0.5)), "glossy")
    b.sphere("Rough", (-1.8, -0.5, 0.6), 0.6,
             b.material("Rough", "ShaderNodeBsdfGlossy", Roughness=0.4))
    hide(b.light("AREA", (-1, -3, 5), energy=200.0, size=1.0), "camera", "glossy")


def rays_transmission(b):
    """Rays through glass do not see the cube behind it."""
    room(b)
    b.cube("Pane", Matrix.Translation((0.8, -2, 1.1)) @ Matrix.Diagonal((0.6, 0.05, 1, 1)),
           b.material("Glass", "ShaderNodeBsdfGlass", Roughness=0.0, IOR=1.2))
    hide(cube(b, (1.4, 0.5, 0.5)), "transmission")


def rays_volume(b):
    """Fog that a bright ball in it does not light."""
    room(b)
    b.cube("Fog", Matrix.Translation((1.6, 0, 1)) @ Matrix.Scale(0.9, 4),
           volume(b, "Fog", Density=0.8))
    ball = b.sphere("Bright", (1.6, 0, 1), 0.2,
                    b.material("Bright", "ShaderNodeEmission", Strength=3.0))
    hide(ball, "diffuse", "volume_scatter", "shadow")


def rays_indirect_only(b):
    room(b)
    hidden = bpy.data.collections.new("Indirect")
    b.scene.collection.children.link(hidden)
    made = cube(b, (1.6, 0.5, 0.5))
    b.scene.collection.objects.unlink(made)
    hidden.objects.link(made)
    b.scene.view_layers[0].layer_collection.children["Indirect"].indirect_only = True
    mirror(b)


def rays_world(b):
    """Mirrors show no sky, and glass none of it."""
    room(b)
    mirror(b)
    b.sphere("Glass", (-1.8, -0.5, 0.6), 0.6,
             b.material("Glass", "ShaderNodeBsdfGlass", Roughness=0.0, IOR=1.4))
    b.scene.world.cycles_visibility.glossy = False
    b.scene.world.cycles_visibility.transmission = False


def rays_principled(b):
    """Layers of one surface see different things."""
    room(b)
    b.sphere("Coated", (-1.8, -0.5, 0.8), 0.8, b.material(
        "Coated", "ShaderNodeBsdfPrincipled", Base_Color=(0.2, 0.3, 0.8, 1), Roughness=0.3))
    hide(b.light("AREA", (-1, -3, 5), energy=300.0, size=1.0), "camera", "glossy")
    hide(b.light("AREA", (-4, -1, 3), energy=300.0, size=1.0), "camera", "diffuse")


def lamps_in_mirror(b):
    """The camera does not see lamps that block no light; a mirror shows them."""
    room(b)
    mirror(b)
    b.light("POINT", (2.0, -2.0, 2.5), energy=60.0, shadow_soft_size=0.4)
    b.light("AREA", (-1.5, 0, 3), energy=60.0, size=1.0)
    b.light("AREA", (-1.5, 0, 2), energy=60.0, size=1.0)


def lamps_by_rays(b):
    """Points and shapes that diffuse or glossy rays do not see."""
    room(b)
    mirror(b, 0.3)
    hide(b.light("POINT", (-2, -2, 4), energy=300.0, shadow_soft_size=0.0), "diffuse")
    hide(b.light("POINT", (3, -2, 3), energy=300.0, shadow_soft_size=0.3), "glossy")
    hide(b.light("SUN", (0, 0, 9), (2, 1, 0), energy=1.0, angle=0.1), "glossy")
