# Copyright the Sheaf authors.
# SPDX-License-Identifier: Apache-2.0
"""Scenes after public reports about exporters and render add-ons: keyed values, cameras within
media, things scaled to nothing, motion that is not even. Each is one report's case.
"""
import math
import os

import bpy
import mathutils

Matrix = mathutils.Matrix


def room(b):
    """A floor, a red ball, an even sky."""
    b.camera()
    b.background(0.5)
    b.plane(20, b.diffuse("Floor", (0.6, 0.6, 0.6)))
    return b.sphere("Ball", (0, 0, 1), 0.8, b.diffuse("Red", (0.7, 0.2, 0.1)))


def rounded_parents(b):
    """Inverses of parents whose last element is not 1 by rounding."""
    ball = room(b)
    nearly_one = 1 - 2.0 ** -24
    for child in (ball, b.light("POINT", (-2, -2, 4), energy=300.0), b.scene.camera):
        child.parent = b.add("Parent", None)
        child.matrix_parent_inverse[3][3] = nearly_one
    key(ball, "location", {0: (-1, 0, 1), 2: (1, 0, 1)})
    blur(b)


def volume(b, name, kind="ShaderNodeVolumeScatter", **inputs):
    b.scene.cycles.volume_bounces = 16
    made, nodes, links, output = b.empty_material(name)
    node = nodes.new(kind)
    b.fill(node, inputs)
    links.new(node.outputs[0], output.inputs["Volume"])
    return made


def key(owner, path, values, **interpolation):
    """Keys {frame: value} of a property, straight between them."""
    for frame, value in values.items():
        setattr(owner, path, value)
        owner.keyframe_insert(path, frame=frame)
    for curve in owner.id_data.animation_data.action.fcurves:
        for point in curve.keyframe_points:
            point.interpolation = interpolation.get("kind", "LINEAR")


def blur(b, shutter=1.0, frame=1):
    b.scene.render.use_motion_blur = True
    b.scene.render.motion_blur_shutter = shutter
    b.scene.frame_set(frame)


def fog_around_camera(b):
    room(b)
    b.cube("Fog", Matrix.Diagonal((12, 12, 12, 1)),
           volume(b, "Fog", Color=(0.8, 0.8, 0.8, 1), Density=0.1))


def camera_under_water(b):
    room(b)
    b.cube("Water", Matrix.Diagonal((9, 9, 9, 1)),
           volume(b, "Water", "ShaderNodeVolumeAbsorption", Color=(0.2, 0.4, 0.8, 1), Density=0.2))


def smoke(b):
    """A baked gas domain."""
    bpy.ops.mesh.primitive_uv_sphere_add(radius=0.4)
    bpy.context.object.name = "Source"
    bpy.ops.object.quick_smoke()
    domain = bpy.context.object
    settings = domain.modifiers[0].domain_settings
    settings.resolution_max, settings.cache_frame_end = 24, 12
    settings.cache_type, settings.cache_directory = "ALL", os.path.join(b.folder, "smoke")
    with bpy.context.temp_override(object=domain, active_object=domain, selected_objects=[domain]):
        bpy.ops.fluid.bake_all()
    b.camera((0, -9, 2.2), (0, 0, 2), 40)
    b.background(0.6)
    b.light("POINT", (-3, -4, 5), energy=800.0, shadow_soft_size=0.0)
    b.scene.cycles.volume_bounces = 16
    b.scene.frame_set(10)


def volumes_of_one_name(b):
    room(b)
    for x, color in ((-1.6, (1, 0.1, 0.1, 1)), (1.6, (0.1, 0.1, 1, 1))):
        fluid = volume(b, f"Fluid {x}", Color=color, Density=1.0)
        b.cube(f"Fluid {x}", Matrix.Translation((x, 0, 1)) @ Matrix.Scale(0.6, 4), fluid)


def scaled_to_nothing(b):
    room(b)
    b.sphere("Zero", (1.5, 0, 1), 0.5, b.diffuse("Zero", (0, 1, 0))).scale = (0, 0, 0)
    flat = b.plane(1.2, b.diffuse("Flat", (0.1, 0.8, 0.1)))
    flat.name, flat.location, flat.scale = "Flat", (1.5, 0, 1), (1, 1, 0)
    flat.rotation_euler = (1.2, 0, 0.3)
    b.sphere("Lamp", (-1.5, 0, 1), 0.5,
             b.material("Lamp", "ShaderNodeEmission", Strength=2.0)).scale = (0, 0, 0)


def mirrored_camera(b):
    room(b)
    b.sphere("Green", (1.5, 0, 1), 0.5, b.diffuse("Green", (0.1, 0.8, 0.1)))
    parent = b.add("Parent", None)
    parent.scale = (-1, 1, 1)
    b.scene.camera.parent = parent


def spin(b):
    """250 degrees while the shutter is open."""
    room(b)
    blade = b.cube("Blade", Matrix(), b.diffuse("Blade", (0.1, 0.8, 0.2)))
    blade.location, blade.scale = (0, 0, 1.9), (2, 0.2, 0.2)
    turn = math.radians(250)
    key(blade, "rotation_euler", {0: (0, 0, -turn), 2: (0, 0, turn)})
    blur(b)


def acceleration(b):
    """At rest until the frame, then fast."""
    room(b)
    ball = b.sphere("Fast", (0, 0, 2), 0.3, b.diffuse("Fast", (0.1, 0.8, 0.2)))
    key(ball, "location", {0: (-2, 0, 2), 1: (-2, 0, 2), 2: (2, 0, 2)})
    blur(b)


def blur_off(b):
    room(b)
    ball = b.sphere("Sharp", (0, 0, 2), 0.3, b.diffuse("Sharp", (0.1, 0.8, 0.2)))
    key(ball, "location", {0: (-2, 0, 2), 2: (2, 0, 2)})
    ball.cycles.use_motion_blur = False
    blur(b)


def zoom(b):
    room(b)
    key(b.scene.camera.data, "lens", {0: 20.0, 2: 60.0})
    blur(b)


def shining_mover(b):
    """The format refuses lights that move."""
    room(b)
    ball = b.sphere("Lamp", (0, 0, 2), 0.3, b.material("Lamp", "ShaderNodeEmission", Strength=3.0))
    key(ball, "location", {0: (-1, 0, 2), 2: (1, 0, 2)})
    blur(b)


def keyed(b):
    """Values that change from frame to frame, for -a and Submit Frames."""
    room(b)
    lamp = b.light("POINT", (-2, -1, 4), energy=100.0, shadow_soft_size=0.0)
    key(lamp.data, "energy", {1: 100.0, 3: 900.0})
    key(b.scene.world.node_tree.nodes["Background"].inputs["Strength"], "default_value",
        {1: 0.1, 3: 1.0})
    key(b.scene.camera.data, "lens", {1: 30.0, 3: 60.0})
    key(b.scene.sheaf, "samples", {1: 4, 3: 12}, kind="CONSTANT")
    red = bpy.data.materials["Red"].node_tree.nodes["Diffuse BSDF"]
    key(red.inputs["Color"], "default_value", {1: (0.7, 0.2, 0.1, 1), 3: (0.1, 0.2, 0.7, 1)})
    b.scene.frame_start, b.scene.frame_end = 1, 3


def two_layers(b):
    room(b)
    other = bpy.data.collections.new("Other")
    b.scene.collection.children.link(other)
    ball = b.sphere("Blue", (1.5, 0, 1), 0.5, b.diffuse("Blue", (0.1, 0.1, 0.8)))
    b.scene.collection.objects.unlink(ball)
    other.objects.link(ball)
    second = b.scene.view_layers.new("Second")
    second.layer_collection.children["Other"].exclude = True


def two_eyes(b):
    room(b)
    b.scene.render.use_multiview = True
    b.scene.camera.data.stereo.interocular_distance = 0.6
    b.scene.camera.data.stereo.convergence_distance = 3.0
