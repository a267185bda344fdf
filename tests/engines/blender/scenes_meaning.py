# Copyright the Sheaf authors.
# SPDX-License-Identifier: Apache-2.0
"""Scenes about the meaning of images, worlds, mixes of shaders, settings of layers and films."""
import math
import os

import bpy
import mathutils
import numpy
import OpenImageIO

from scenes_findings import blur, key, room

EDGE_PX = 256


def picture(b, name, depth="uint8"):
    """An image with alpha: 0.25 on the left, 1 on the right."""
    y, x = numpy.mgrid[0:EDGE_PX, 0:EDGE_PX] / EDGE_PX
    pixels = numpy.stack([x, y, 0.6 + 0 * x, 0.25 + 0.75 * (x > 0.5)], axis=-1)
    if name.endswith(".exr"):
        pixels[..., :3] *= pixels[..., 3:]
    path = os.path.join(b.folder, name)
    spec = OpenImageIO.ImageSpec(EDGE_PX, EDGE_PX, 4, depth)
    spec.attribute("oiio:UnassociatedAlpha", 0 if name.endswith(".exr") else 1)
    output = OpenImageIO.ImageOutput.create(path)
    output.open(path, spec)
    output.write_image(pixels.astype(numpy.float32))
    output.close()
    return bpy.data.images.load(path)


def wall(b, material):
    b.camera((0, -6, 0), (0, 0, 0), 50)
    b.background(1.0)
    made = b.plane(4, material)
    made.rotation_euler = (math.pi / 2, 0, 0)
    b.plane(20, b.diffuse("Floor", (0.3, 0.5, 0.3)), z=-2)
    return made


def painted(b, image, uses_alpha=False):
    material, nodes, links, output = b.empty_material("Painted")
    texture, shader = nodes.new("ShaderNodeTexImage"), nodes.new("ShaderNodeBsdfDiffuse")
    texture.image = image
    links.new(texture.outputs["Color"], shader.inputs["Color"])
    shown = shader.outputs[0]
    if uses_alpha:
        mix, clear = nodes.new("ShaderNodeMixShader"), nodes.new("ShaderNodeBsdfTransparent")
        links.new(texture.outputs["Alpha"], mix.inputs[0])
        links.new(clear.outputs[0], mix.inputs[1])
        links.new(shader.outputs[0], mix.inputs[2])
        shown = mix.outputs[0]
    links.new(shown, output.inputs["Surface"])
    return wall(b, material)


# (name of the file, depth, color space or None, alpha mode or None, whether alpha is linked)
IMAGES = tuple((f"picture.{suffix}", depth, space, alpha, is_used)
               for suffix, depths in (("png", ("uint8", "uint16")), ("tif", ("uint8", "uint16")),
                                      ("exr", ("half",)), ("tga", ("uint8",)))
               for depth in depths for space in (None, "Non-Color")
               for alpha in (None, "CHANNEL_PACKED", "NONE") for is_used in (False, True))


def image_scene(case):
    name, depth, space, alpha, is_used = case

    def make(b):
        image = picture(b, name, depth)
        if space:
            image.colorspace_settings.name = space
        if alpha:
            image.alpha_mode = alpha
        painted(b, image, is_used)
    make.__name__ = "image_" + "_".join(str(x) for x in case)
    return make


def image_tiles(b):
    for number, color in ((1001, (0.8, 0.1, 0.1)), (1002, (0.1, 0.1, 0.8))):
        b.image(f"tile.{number}", numpy.ones((EDGE_PX, EDGE_PX, 3)) * numpy.array(color))
    image = bpy.data.images.load(os.path.join(b.folder, "tile.1001.png"))
    image.source = "TILED"
    image.filepath = os.path.join(b.folder, "tile.<UDIM>.png")
    image.tiles.new(1002)
    made = painted(b, image)
    for i, uv in enumerate(((0, 0), (2, 0), (2, 1), (0, 1))):
        made.data.uv_layers[0].data[i].uv = uv


def image_missing(b):
    image = bpy.data.images.new("gone", 4, 4)
    image.source, image.filepath = "FILE", "//nowhere/gone.png"
    painted(b, image)


def image_none(b):
    painted(b, None)


def image_without_uv(b):
    pixels = numpy.full((EDGE_PX, EDGE_PX, 3), 0.2)
    pixels[8:-8, 8:-8] = (0.9, 0.8, 0.1)
    made = painted(b, b.image("framed", pixels))
    made.data.uv_layers.remove(made.data.uv_layers[0])


def image_of_second_uv(b):
    """The map that is active for rendering shows one texel, and the named one the image."""
    made = painted(b, picture(b, "picture.png"))
    second = made.data.uv_layers.new(name="Second")
    for corner in made.data.uv_layers[0].data:
        corner.uv = (0.9, 0.9)
    for i, uv in enumerate(((0, 0), (1, 0), (1, 1), (0, 1))):
        second.data[i].uv = uv
    made.data.uv_layers[0].active_render = True
    tree = made.data.materials[0].node_tree
    chosen = tree.nodes.new("ShaderNodeUVMap")
    chosen.uv_map = "Second"
    tree.links.new(chosen.outputs[0], tree.nodes["Image Texture"].inputs["Vector"])


def image_packed(b):
    image = picture(b, "picture.png")
    image.pack()
    painted(b, image)


def image_curves(b):
    made = painted(b, picture(b, "picture.png"))
    tree = made.data.materials[0].node_tree
    curves = tree.nodes.new("ShaderNodeRGBCurve")
    curves.mapping.curves[3].points.new(0.3, 0.6)
    curves.mapping.curves[0].points.new(0.5, 0.2)
    curves.mapping.update()
    curves.inputs[0].default_value = 0.8
    tree.links.new(tree.nodes["Image Texture"].outputs[0], curves.inputs[1])
    tree.links.new(curves.outputs[0], tree.nodes["Diffuse BSDF"].inputs["Color"])


# Mixes.


def shaded(b, kind, *shaders):
    """A wall of a Mix Shader (kind "Mix") or an Add Shader of these: (node, inputs) or None."""
    material, nodes, links, output = b.empty_material("Shaded")
    both = nodes.new(f"ShaderNode{kind}Shader")
    sockets = [socket for socket in both.inputs if socket.type == "SHADER"]
    for socket, shader in zip(sockets, shaders):
        if shader is not None:
            node = nodes.new(shader[0])
            b.fill(node, shader[1])
            links.new(node.outputs[0], socket)
    links.new(both.outputs[0], output.inputs["Surface"])
    wall(b, material)


CLEAR = ("ShaderNodeBsdfTransparent", {})
LIGHT = ("ShaderNodeEmission", {"Color": (1, 0.5, 0.2, 1), "Strength": 0.8})
MATT = ("ShaderNodeBsdfDiffuse", {"Color": (0.8, 0.6, 0.3, 1)})


def mix_clear_light(b):
    shaded(b, "Mix", CLEAR, LIGHT)


def add_clear_light(b):
    shaded(b, "Add", CLEAR, LIGHT)


def mix_matt_light(b):
    shaded(b, "Mix", MATT, LIGHT)


def mix_matt_color(b):
    shaded(b, "Mix", MATT, ("ShaderNodeRGB", {}))


def add_number(b):
    shaded(b, "Add", MATT, ("ShaderNodeValue", {}))


def add_one(b):
    shaded(b, "Add", MATT, None)


def mix_one(b):
    shaded(b, "Mix", MATT, None)


# Worlds.


def environment(b, kind="ShaderNodeTexEnvironment", **settings):
    """(nodes, links, the texture before the Background) of a world with a picture of a sky."""
    room(b)
    tree = b.scene.world.node_tree
    background = tree.nodes["Background"]
    background.inputs["Strength"].default_value = 1.0
    texture = tree.nodes.new(kind)
    if kind == "ShaderNodeTexEnvironment":
        y, x = numpy.mgrid[0:128, 0:256] / 256
        pixels = numpy.stack([x * 1.5, y * 2, 0.3 + 0 * x], axis=-1).astype(numpy.float32)
        pixels[80:84, 60:64] = 20
        texture.image = b.image("sky", pixels, is_float=True)
    for name, value in settings.items():
        setattr(texture, name, value)
    tree.links.new(texture.outputs[0], background.inputs["Color"])
    return tree.nodes, tree.links, texture


def world_moved(b):
    nodes, links, texture = environment(b)
    mapping = nodes.new("ShaderNodeMapping")
    mapping.inputs["Location"].default_value = (0.2, 0.3, 0.4)
    mapping.inputs["Scale"].default_value = (1, 2, 1)
    links.new(nodes.new("ShaderNodeTexCoord").outputs["Generated"], mapping.inputs["Vector"])
    links.new(mapping.outputs[0], texture.inputs["Vector"])


def world_of_object(b):
    nodes, links, texture = environment(b)
    coordinates = nodes.new("ShaderNodeTexCoord")
    coordinates.object = b.add("Sky", None)
    coordinates.object.rotation_euler = (0.3, 0.2, 1.0)
    links.new(coordinates.outputs["Object"], texture.inputs["Vector"])


def world_ball(b):
    environment(b, projection="MIRROR_BALL")


def world_colors(b):
    nodes, links, texture = environment(b)
    colors = nodes.new("ShaderNodeHueSaturation")
    colors.inputs["Saturation"].default_value = 0.5
    colors.inputs["Value"].default_value = 0.7
    links.new(texture.outputs[0], colors.inputs["Color"])
    links.new(colors.outputs[0], nodes["Background"].inputs["Color"])


def world_sky(b):
    nodes, _, _ = environment(b, "ShaderNodeTexSky", sky_type="NISHITA", sun_elevation=0.5)
    nodes["Background"].inputs["Strength"].default_value = 0.1


def world_sky_hosek(b):
    environment(b, "ShaderNodeTexSky", sky_type="HOSEK_WILKIE")


def world_gradient(b):
    nodes, links, texture = environment(b, "ShaderNodeTexVoronoi")
    links.new(nodes.new("ShaderNodeTexCoord").outputs["Generated"], texture.inputs["Vector"])
    links.new(texture.outputs["Color"], nodes["Background"].inputs["Color"])


def world_hidden(b):
    environment(b)
    b.scene.world.cycles_visibility.camera = False


def world_by_camera_ray(b):
    """A picture lights the scene, and the camera sees a color, or a sky that is rendered."""
    nodes, links, _ = environment(b)
    mix = nodes.new("ShaderNodeMixShader")
    shown = nodes.new("ShaderNodeBackground")
    shown.inputs["Color"].default_value = (0.1, 0.3, 0.05, 1)
    links.new(nodes.new("ShaderNodeLightPath").outputs["Is Camera Ray"], mix.inputs["Fac"])
    links.new(nodes["Background"].outputs[0], mix.inputs[1])
    links.new(shown.outputs[0], mix.inputs[2])
    links.new(mix.outputs[0], nodes["World Output"].inputs["Surface"])
    return nodes, links, shown


def world_by_camera_ray_rendered(b):
    nodes, links, shown = world_by_camera_ray(b)
    links.new(nodes.new("ShaderNodeTexVoronoi").outputs["Color"], shown.inputs["Color"])
    links.new(nodes.new("ShaderNodeTexVoronoi").outputs["Distance"],
              nodes["Background"].inputs["Color"])


def world_volume(b):
    """Fog everywhere, also in the glass ball."""
    b.scene.cycles.volume_bounces = 16
    room(b)
    b.sphere("Glass", (2, 0, 1), 0.8, b.material("Glass", "ShaderNodeBsdfGlass", Roughness=0.0))
    b.light("POINT", (-2, -2, 4), energy=600.0, shadow_soft_size=0.0)
    tree = b.scene.world.node_tree
    fog = tree.nodes.new("ShaderNodeVolumeScatter")
    fog.inputs["Color"].default_value = (0.9, 0.7, 0.5, 1)
    fog.inputs["Density"].default_value = 0.06
    tree.links.new(fog.outputs[0], tree.nodes["World Output"].inputs["Volume"])


def film_transparent(b):
    environment(b)
    b.scene.render.film_transparent = True


def film_exposure(b):
    environment(b)
    b.sphere("Lamp", (-1.5, 0, 1), 0.3, b.material("Lamp", "ShaderNodeEmission", Strength=2.0))
    b.scene.cycles.film_exposure = 2.0


# Layers and lights.


def layer_override(b):
    environment(b)
    b.scene.view_layers[0].material_override = b.diffuse("Clay", (0.8, 0.8, 0.8))


def layer_without_sky(b):
    environment(b)
    b.light("AREA", (-4, -5, 7), energy=300.0, size=1.0)
    b.scene.view_layers[0].use_sky = False


def lamps_in_view(b):
    """Lamps that the camera does not see, in front of what it sees."""
    room(b)
    b.light("POINT", (0.5, -2.5, 1.5), energy=60.0, shadow_soft_size=0.6)
    b.light("AREA", (-1, -2, 2.5), energy=60.0, size=1.5, shape="RECTANGLE", size_y=0.7)
    b.light("AREA", (2, 1, 2.5), energy=60.0, size=1.5, shape="DISK").rotation_euler = (0.3, 0.2, 0)


def lamp_around_all(b):
    """A lamp whose sphere holds the camera."""
    room(b)
    b.light("POINT", (0, -3, 6), energy=900.0, shadow_soft_size=20.0)


def sun_in_view(b):
    room(b)
    b.scene.camera.rotation_euler.x = 1.6
    sun = b.light("SUN", (0, 0, 9), energy=3.0, angle=0.2)
    sun.rotation_euler = (b.scene.camera.rotation_euler.to_matrix()
                          @ mathutils.Matrix.Rotation(math.pi, 3, "X")).to_euler()


def area_spread(b):
    room(b)
    b.light("AREA", (0, -1, 4), energy=200.0, size=0.5, spread=1.0)
    b.light("AREA", (2, -1, 4), energy=200.0, size=0.5, size_y=3.0, shape="RECTANGLE", spread=2.5)


def spot_soft(b):
    room(b)
    b.light("SPOT", (0, -2, 5), energy=400.0, spot_size=0.9, shadow_soft_size=0.7)


def spot_scaled(b):
    room(b)
    b.light("SPOT", (0, -2, 5), energy=400.0, spot_size=0.9,
            shadow_soft_size=0.0).scale = (2, 1, 1)


def shutter_curve(b):
    room(b)
    ball = b.sphere("Fast", (0, 0, 2), 0.3, b.diffuse("Fast", (0.1, 0.8, 0.2)))
    key(ball, "location", {0: (-2, 0, 2), 2: (2, 0, 2)})
    blur(b)
    mapping = b.scene.render.motion_blur_shutter_curve
    mapping.curves[0].points[0].location = (0, 0)
    mapping.curves[0].points[1].location = (1, 1)
    mapping.update()
