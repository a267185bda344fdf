# Copyright the Sheaf authors.
# SPDX-License-Identifier: Apache-2.0
"""Scenes about collections in layers, groups of lights, rays that do not see an object, textures
that a Mapping node turns, volumes within that of the world, and closed rooms.
"""

import bpy
import mathutils

from scenes_findings import room, volume
from scenes_meaning import painted, picture

Matrix = mathutils.Matrix


def lamp(b, place, energy, group="", **more):
    made = b.light("POINT", place, energy=energy, shadow_soft_size=0.0, **more)
    made.lightgroup = group
    return made


def grouped(b):
    """Lamps, a shining ball and the sky in groups, and what is in none."""
    room(b)
    layer = b.scene.view_layers[0]
    for name in ("Key", "Sky & rest"):
        layer.lightgroups.add(name=name)
    lamp(b, (-2, -2, 4), 300.0, "Key", color=(1.0, 0.4, 0.2))
    lamp(b, (3, -2, 3), 200.0, color=(0.2, 0.4, 1.0))
    ball = b.sphere("Shining", (2, 0, 0.5), 0.5, b.material("Shining", "ShaderNodeEmission",
                                                            Strength=2.0))
    ball.lightgroup = "Key"
    b.scene.world.lightgroup = "Sky & rest"


def negative_lamps(b):
    """One takes light away, the other adds red and takes blue."""
    room(b)
    lamp(b, (-2, -2, 4), -60.0)
    lamp(b, (3, -2, 3), 100.0, color=(1.0, 0.0, -0.5))


def negative_in_group(b):
    grouped(b)
    lamp(b, (0, -2, 5), -50.0, "Key")


def held_out(b):
    """A collection and an object through which the image is empty."""
    room(b)
    hidden = bpy.data.collections.new("Cut")
    b.scene.collection.children.link(hidden)
    for x in (-1.6, 1.6):
        ball = b.sphere("Blue", (x, 0, 0.6), 0.5, b.diffuse("Blue", (0.1, 0.1, 0.8)))
        b.scene.collection.objects.unlink(ball)
        hidden.objects.link(ball)
    b.scene.view_layers[0].layer_collection.children["Cut"].holdout = True
    b.cube("Box", Matrix.Translation((0, 2, 2)) @ Matrix.Scale(0.4, 4),
           b.diffuse("Box", (0.1, 0.8, 0.1))).is_holdout = True


def invisible_ones(b):
    """A ball that no ray sees, and a lamp that lights nothing."""
    ball = room(b)
    other = b.sphere("Ghost", (1.6, 0, 1), 0.6, b.diffuse("Ghost", (0.1, 0.8, 0.1)))
    light = lamp(b, (-2, -2, 4), 500.0)
    for ray in ("camera", "diffuse", "glossy", "transmission", "volume_scatter", "shadow"):
        setattr(other, f"visible_{ray}", False)
        if ray != "shadow":
            setattr(light, f"visible_{ray}", False)
    return ball


def hidden_by_maker(b):
    """Instances of a collection whose empty hides them from mirrors."""
    room(b)
    parts = bpy.data.collections.new("Parts")
    ball = b.sphere("Part", (0, 0, 0), 0.5, b.diffuse("Part", (0.1, 0.8, 0.1)))
    b.scene.collection.objects.unlink(ball)
    parts.objects.link(ball)
    maker = b.add("Maker", None, Matrix.Translation((1.6, 0, 1)))
    maker.instance_type, maker.instance_collection = "COLLECTION", parts
    maker.visible_glossy = False


def map_image(made, **inputs):
    """Puts a Mapping node before the image of a wall."""
    tree = made.data.materials[0].node_tree
    image = tree.nodes["Image Texture"]
    mapping = tree.nodes.new("ShaderNodeMapping")
    mapping.vector_type = inputs.pop("kind", "POINT")
    for name, value in inputs.items():
        mapping.inputs[name].default_value = value
    tree.links.new(tree.nodes.new("ShaderNodeTexCoord").outputs["UV"], mapping.inputs["Vector"])
    tree.links.new(mapping.outputs[0], image.inputs["Vector"])
    return tree, image


def image_turned(b):
    map_image(painted(b, picture(b, "picture.png")), Rotation=(0.2, 0.1, 0.6),
              Scale=(1.5, 0.7, 1), Location=(0.3, 0.1, 0))


def image_turned_back(b):
    map_image(painted(b, picture(b, "picture.png")), kind="TEXTURE", Rotation=(0, 0, 2.0),
              Scale=(1.5, 0.7, 1), Location=(0.3, 0.1, 0))


def images_of_two_turns(b):
    """An image that is turned, mixed with one that is not."""
    tree, image = map_image(painted(b, picture(b, "picture.png")), Rotation=(0, 0, 0.6))
    other, mix = tree.nodes.new("ShaderNodeTexImage"), tree.nodes.new("ShaderNodeMixRGB")
    other.image = image.image
    tree.links.new(image.outputs[0], mix.inputs["Color1"])
    tree.links.new(other.outputs[0], mix.inputs["Color2"])
    tree.links.new(mix.outputs[0], tree.nodes["Diffuse BSDF"].inputs["Color"])


def volumes_in_fog(b):
    """An absorbing and a scattering cube in the fog of the world, which fills them, too."""
    b.scene.cycles.volume_bounces = 16
    room(b)
    for x, kind, color in ((-2, "ShaderNodeVolumeAbsorption", (0.2, 0.4, 0.8, 1)),
                           (2, "ShaderNodeVolumeScatter", (0.8, 0.3, 0.2, 1))):
        b.cube(kind, Matrix.Translation((x, 0, 1.2)) @ Matrix.Scale(0.9, 4),
               volume(b, kind, kind, Color=color, Density=0.3))
    lamp(b, (-2, -2, 4), 600.0)
    fill_world(b)


def fill_world(b):
    tree = b.scene.world.node_tree
    fog = tree.nodes.new("ShaderNodeVolumeScatter")
    fog.inputs["Color"].default_value = (0.9, 0.7, 0.5, 1)
    fog.inputs["Density"].default_value = 0.06
    tree.links.new(fog.outputs[0], tree.nodes["World Output"].inputs["Volume"])


def volumes_that_meet(b):
    """They add up."""
    room(b)
    for size in (0.9, 0.5):
        b.cube(f"Fog {size}", Matrix.Translation((2, 0, 1.2)) @ Matrix.Scale(size, 4),
               volume(b, f"Fog {size}", Color=(0.8, 0.8, 0.8, 1), Density=size))


def volumes_that_meet_in_fog(b):
    volumes_that_meet(b)
    fill_world(b)


def dark_shine(b):
    """A ball that takes light away."""
    room(b)
    b.sphere("Dark", (2, 0, 0.7), 0.5, b.material(
        "Dark", "ShaderNodeEmission", Color=(1.0, 0.8, 0.6, 1), Strength=-0.4))


def closed_room(b, roughness=0.5, value=0.8):
    """Light meets bright walls many times: their albedo counts with a high power."""
    b.camera((0, -1.5, 0), (0, 0, -0.2), 20)
    b.cube("Room", Matrix.Diagonal((2, 2, 2, 1)), b.material(
        "Wall", "ShaderNodeBsdfPrincipled", Base_Color=(value, value, value, 1),
        Roughness=roughness))
    lamp(b, (0, 0.5, 1), 50.0)


def shells(b):
    """Clear shells in a bright room: light crosses many of them between two walls."""
    closed_room(b)
    for radius in (0.3, 0.5, 0.7):
        material, nodes, links, output = b.empty_material(f"Shell {radius}")
        mix = nodes.new("ShaderNodeMixShader")
        mix.inputs[0].default_value = 0.1
        links.new(nodes.new("ShaderNodeBsdfTransparent").outputs[0], mix.inputs[1])
        links.new(nodes.new("ShaderNodeBsdfDiffuse").outputs[0], mix.inputs[2])
        links.new(mix.outputs[0], output.inputs["Surface"])
        b.sphere(f"Shell {radius}", (0, 0.6, -0.5), radius, material)


def bent_normals(b):
    """Smooth normals of a cube point to its corners."""
    b.camera((0, -1.5, 0), (0, 0, -0.2), 20)
    made = b.cube("Smooth", Matrix.Diagonal((2, 2, 2, 1)), b.diffuse("Wall", (0.8, 0.8, 0.8)))
    made.data.polygons.foreach_set("use_smooth", [True] * len(made.data.polygons))
    lamp(b, (0, 0.5, 1), 50.0)


def clipped(b):
    """The far half of the floor is beyond Clip End."""
    room(b)
    b.scene.camera.data.clip_end = 8.0


def clipped_near(b):
    """The camera is in a box, whose walls and floor before Clip Start it does not see."""
    room(b)
    b.cube("Box", Matrix.Translation(b.scene.camera.location) @ Matrix.Diagonal((2, 2, 2, 1)),
           b.diffuse("Wall", (0.8, 0.2, 0.1)))
    b.scene.camera.data.clip_start = 4.0


def floor_under_camera(b):
    """A floor that begins behind the camera, and does not reach into its view before Clip Start."""
    room(b)
    floor = b.plane(40, b.diffuse("Low", (0.2, 0.3, 0.2)))
    floor.location = b.scene.camera.location
    floor.location.z -= 1.5
    b.scene.camera.data.clip_start = 0.5
    b.scene.camera.data.clip_end = 100.0


def clipped_fog(b):
    clipped(b)
    material, nodes, links, output = b.empty_material("Fog")
    volume = nodes.new("ShaderNodeVolumeScatter")
    volume.inputs["Density"].default_value = 0.05
    links.new(volume.outputs[0], output.inputs["Volume"])
    b.cube("Fog", Matrix.Diagonal((6, 6, 6, 1)), material)


def clipped_orthographic(b):
    clipped(b)
    data = b.scene.camera.data
    data.type, data.ortho_scale, data.clip_start, data.clip_end = "ORTHO", 8.0, 5.0, 9.0


def clipped_glass(b):
    """Ground behind a transparent sheet, which does not lengthen the ray."""
    clipped(b)
    material, nodes, links, output = b.empty_material("Sheet")
    mix = nodes.new("ShaderNodeMixShader")
    links.new(nodes.new("ShaderNodeBsdfTransparent").outputs[0], mix.inputs[1])
    links.new(nodes.new("ShaderNodeBsdfDiffuse").outputs[0], mix.inputs[2])
    links.new(mix.outputs[0], output.inputs["Surface"])
    sheet = b.plane(4, material)
    sheet.rotation_euler = b.scene.camera.rotation_euler
    sheet.location = b.scene.camera.matrix_world @ mathutils.Vector((0, 0, -3))


def unclipped(b):
    room(b)
    b.scene.camera.data.clip_end = 30.0
    b.scene.camera.data.clip_start = 0.5
