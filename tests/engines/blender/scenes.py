# Copyright the Sheaf authors.
# SPDX-License-Identifier: Apache-2.0
"""Scenes that Blender makes by script, one for each group of features. Lights stay out of view:
Cycles hides them from the camera, Sheaf does not.
"""
import math
import os

import bpy
import mathutils
import numpy
import OpenImageIO

WIDTH, HEIGHT = 96, 64


class Builder:
    """Objects and node trees in few words."""

    def __init__(self, folder):
        self.folder = folder
        bpy.ops.wm.read_factory_settings(use_empty=True)
        self.scene = bpy.context.scene
        self.scene.world = bpy.data.worlds.new("World")
        self.scene.world.use_nodes = True
        self.background(0)
        render = self.scene.render
        render.resolution_x, render.resolution_y = WIDTH, HEIGHT
        render.resolution_percentage = 100

    def background(self, strength, color=(1, 1, 1)):
        node = self.scene.world.node_tree.nodes["Background"]
        node.inputs["Color"].default_value = (*color, 1)
        node.inputs["Strength"].default_value = strength

    def add(self, name, data, matrix=None, material=None):
        made = bpy.data.objects.new(name, data)
        self.scene.collection.objects.link(made)
        if matrix is not None:
            made.matrix_world = matrix
        if material is not None:
            data.materials.append(material)
        return made

    def camera(self, place=(0, -7, 3.2), target=(0, 0, 0.6), lens=40):
        made = self.add("Camera", bpy.data.cameras.new("Camera"))
        made.data.lens = lens
        made.location = place
        direction = mathutils.Vector(target) - mathutils.Vector(place)
        made.rotation_euler = direction.to_track_quat("-Z", "Y").to_euler()
        self.scene.camera = made
        bpy.context.view_layer.update()
        return made

    def light(self, kind, place, target=(0, 0, 0), **values):
        data = bpy.data.lights.new(kind.title(), kind)
        for name, value in values.items():
            setattr(data, name, value)
        direction = mathutils.Vector(target) - mathutils.Vector(place)
        turn = direction.to_track_quat("-Z", "Y").to_matrix().to_4x4()
        return self.add(kind.title(), data, mathutils.Matrix.Translation(place) @ turn)

    def material(self, name, kind, **inputs):
        made, nodes, links, output = self.empty_material(name)
        node = nodes.new(kind)
        self.fill(node, inputs)
        links.new(node.outputs[0], output.inputs["Surface"])
        return made

    def empty_material(self, name):
        made = bpy.data.materials.new(name)
        made.use_nodes = True
        tree = made.node_tree
        tree.nodes.clear()
        return made, tree.nodes, tree.links, tree.nodes.new("ShaderNodeOutputMaterial")

    @staticmethod
    def fill(node, inputs):
        """Sets inputs by name; a list is the names that Blender has had for it."""
        for names, value in inputs.items():
            for name in names.split("|"):
                name = name.replace("_", " ")
                if name in node.inputs:
                    node.inputs[name].default_value = value
                    break
            else:
                raise KeyError(f"{node.bl_label} has no input {names}")

    def diffuse(self, name, color):
        return self.material(name, "ShaderNodeBsdfDiffuse", Color=(*color, 1))

    def plane(self, size=20, material=None, z=0.0, uv_scale=1.0):
        s = size / 2
        mesh = bpy.data.meshes.new("Plane")
        mesh.from_pydata([(-s, -s, z), (s, -s, z), (s, s, z), (-s, s, z)], [], [(0, 1, 2, 3)])
        layer = mesh.uv_layers.new()
        for i, uv in enumerate(((0, 0), (1, 0), (1, 1), (0, 1))):
            layer.data[i].uv = [uv_scale * x for x in uv]
        return self.add("Plane", mesh, material=material)

    def sphere(self, name, place, radius=1.0, material=None, segments=48, smooth=True):
        mesh = sphere_mesh(name, radius, segments)
        mesh.polygons.foreach_set("use_smooth", [smooth] * len(mesh.polygons))
        return self.add(name, mesh, mathutils.Matrix.Translation(place), material)

    def cube(self, name, matrix, material=None):
        mesh = bpy.data.meshes.new(name)
        points = [(x, y, z) for z in (-1, 1) for y in (-1, 1) for x in (-1, 1)]
        faces = [(0, 2, 3, 1), (4, 5, 7, 6), (0, 1, 5, 4), (2, 6, 7, 3), (0, 4, 6, 2), (1, 3, 7, 5)]
        mesh.from_pydata(points, [], faces)
        return self.add(name, mesh, matrix, material)

    def image(self, name, pixels, is_float=False, colorspace=None):
        """pixels: (height, width, 3), rows from the bottom, in the space of the image."""
        height, width = pixels.shape[:2]
        if is_float:
            path = os.path.join(self.folder, name + ".exr")
            write_exr(path, pixels)
            return bpy.data.images.load(path)
        made = bpy.data.images.new(name, width, height)
        if colorspace:
            made.colorspace_settings.name = colorspace
        rgba = numpy.ones((height, width, 4), numpy.float32)
        rgba[..., :3] = pixels
        made.pixels.foreach_set(rgba.reshape(-1))
        made.filepath_raw = os.path.join(self.folder, name + ".png")
        made.file_format = "PNG"
        made.save()
        return made


def write_exr(path, pixels):
    """Rows from the bottom; linear."""
    spec = OpenImageIO.ImageSpec(pixels.shape[1], pixels.shape[0], 3, "float")
    output = OpenImageIO.ImageOutput.create(path)
    output.open(path, spec)
    output.write_image(numpy.ascontiguousarray(pixels[::-1], numpy.float32))
    output.close()


def sphere_mesh(name, radius, segments):
    mesh = bpy.data.meshes.new(name)
    rings = segments // 2
    points = [(0, 0, radius)]
    for i in range(1, rings):
        t = math.pi * i / rings
        points += [(radius * math.sin(t) * math.cos(2 * math.pi * j / segments),
                    radius * math.sin(t) * math.sin(2 * math.pi * j / segments),
                    radius * math.cos(t)) for j in range(segments)]
    points.append((0, 0, -radius))
    faces = [(0, 1 + j, 1 + (j + 1) % segments) for j in range(segments)]
    for i in range(rings - 2):
        a = 1 + i * segments
        faces += [(a + j, a + segments + j, a + segments + (j + 1) % segments,
                   a + (j + 1) % segments) for j in range(segments)]
    last, a = len(points) - 1, 1 + (rings - 2) * segments
    faces += [(a + j, last, a + (j + 1) % segments) for j in range(segments)]
    mesh.from_pydata(points, [], faces)
    layer = mesh.uv_layers.new()
    uvs = []
    for polygon in mesh.polygons:
        us = [math.atan2(points[v][1], points[v][0]) / (2 * math.pi) % 1 for v in polygon.vertices]
        wraps = max(us) - min(us) > 0.5
        for v, u in zip(polygon.vertices, us):
            z = max(-1.0, min(1.0, points[v][2] / radius))
            uvs += [u + 1 if wraps and u < 0.5 else u, 1 - math.acos(z) / math.pi]
    layer.data.foreach_set("uv", uvs)
    return mesh


def lights(b):
    """Point lights with and without size, a spot light, area lights of all shapes, two suns."""
    b.camera()
    b.plane(material=b.diffuse("Floor", (0.6, 0.6, 0.6)))
    b.sphere("Ball", (0, 0, 1), 0.8, b.diffuse("Red", (0.7, 0.2, 0.1)))
    b.light("POINT", (-2, -1, 4), energy=60, color=(1, 0.6, 0.3), shadow_soft_size=0.0)
    b.light("POINT", (2.5, 1, 4), energy=60, color=(0.3, 0.6, 1), shadow_soft_size=0.3)
    b.light("SPOT", (0, -2, 5), (0, 0, 0), energy=300, spot_size=0.9, spot_blend=0.4,
            shadow_soft_size=0.0)
    for i, shape in enumerate(("SQUARE", "RECTANGLE", "DISK", "ELLIPSE")):
        b.light("AREA", (-4 + 2.6 * i, 2, 4.5), (0, 0, 0), energy=20, shape=shape, size=1.2,
                size_y=0.5, color=(0.6, 1, 0.6))
    b.light("SUN", (5, 3, 8), energy=0.3, angle=0.0)
    b.light("SUN", (-5, 3, 8), energy=0.3, angle=0.3)


def principled(b):
    """The Principled BSDF: diffuse and rough, glossy, metal, half metal, coated metal, emission."""
    b.camera(lens=45)
    b.background(0.4, (0.8, 0.9, 1))
    b.plane(material=b.diffuse("Floor", (0.4, 0.4, 0.4)))
    kinds = ({"Roughness": 0.8}, {"Roughness": 0.2}, {"Roughness": 0.3, "Metallic": 1.0},
             {"Roughness": 0.4, "Metallic": 0.5}, {"Specular_IOR_Level|Specular": 0.0})
    colors = ((0.8, 0.3, 0.2), (0.2, 0.5, 0.8), (0.9, 0.7, 0.4), (0.5, 0.8, 0.3), (0.7, 0.7, 0.7))
    for i, (inputs, color) in enumerate(zip(kinds, colors)):
        material = b.material(f"Principled {i}", "ShaderNodeBsdfPrincipled",
                              Base_Color=(*color, 1), **inputs)
        b.sphere(f"Ball {i}", (-2.8 + 1.4 * i, 0, 0.65), 0.65, material)
    b.light("AREA", (-3, -5, 6), (0, 0, 0), energy=500, size=3.0)


def textures(b):
    """Image textures with mapping, mixes, a color ramp, a checker, an alpha map, two materials."""
    b.camera()
    y, x = numpy.mgrid[0:64, 0:64] / 64
    picture = numpy.stack([x, y, 0.5 + 0.5 * numpy.sin(12 * x)], axis=-1)
    image = b.image("picture", picture)
    cells = ((x * 8).astype(int) + (y * 8).astype(int)) % 2
    mask = b.image("mask", numpy.repeat(cells[..., None], 3, axis=2).astype(float),
                   colorspace="Non-Color")

    floor, nodes, links, output = b.empty_material("Mapped")
    texture, mapping = nodes.new("ShaderNodeTexImage"), nodes.new("ShaderNodeMapping")
    texture.image = image
    mapping.inputs["Scale"].default_value = (6, 4, 1)
    mapping.inputs["Location"].default_value = (0.2, 0.1, 0)
    links.new(nodes.new("ShaderNodeUVMap").outputs[0], mapping.inputs["Vector"])
    links.new(mapping.outputs[0], texture.inputs["Vector"])
    shader = nodes.new("ShaderNodeBsdfDiffuse")
    links.new(texture.outputs["Color"], shader.inputs["Color"])
    links.new(shader.outputs[0], output.inputs["Surface"])
    b.plane(12, floor)

    mixed, nodes, links, output = b.empty_material("Mixed")
    texture = nodes.new("ShaderNodeTexImage")
    texture.image = mask
    first, second = nodes.new("ShaderNodeBsdfDiffuse"), nodes.new("ShaderNodeBsdfGlossy")
    b.fill(first, {"Color": (0.1, 0.6, 0.2, 1)})
    b.fill(second, {"Color": (0.9, 0.9, 0.9, 1), "Roughness": 0.2})
    mix = nodes.new("ShaderNodeMixShader")
    links.new(texture.outputs["Color"], mix.inputs[0])
    links.new(first.outputs[0], mix.inputs[1])
    links.new(second.outputs[0], mix.inputs[2])
    links.new(mix.outputs[0], output.inputs["Surface"])
    b.sphere("Mixed", (-2, 0, 1), 0.9, mixed)

    ramped, nodes, links, output = b.empty_material("Ramped")
    texture, ramp = nodes.new("ShaderNodeTexImage"), nodes.new("ShaderNodeValToRGB")
    texture.image = image
    ramp.color_ramp.elements[0].color = (0.9, 0.1, 0.1, 1)
    ramp.color_ramp.elements[1].color = (0.1, 0.2, 0.9, 1)
    shader = nodes.new("ShaderNodeBsdfPrincipled")
    b.fill(shader, {"Roughness": 0.6})
    links.new(texture.outputs["Color"], ramp.inputs[0])
    links.new(ramp.outputs["Color"], shader.inputs["Base Color"])
    links.new(shader.outputs[0], output.inputs["Surface"])
    ball = b.sphere("Ramped", (0, 0, 1), 0.9, ramped)
    ball.data.materials.append(b.diffuse("Second", (0.8, 0.8, 0.1)))
    for i, polygon in enumerate(ball.data.polygons):
        polygon.material_index = int(i % 7 == 0)

    cut, nodes, links, output = b.empty_material("Cut Out")
    texture, checker = nodes.new("ShaderNodeTexImage"), nodes.new("ShaderNodeTexChecker")
    texture.image = mask
    b.fill(checker, {"Color1": (0.9, 0.5, 0.1, 1), "Color2": (0.1, 0.5, 0.9, 1), "Scale": 6.0})
    links.new(nodes.new("ShaderNodeUVMap").outputs[0], checker.inputs["Vector"])
    shader = nodes.new("ShaderNodeBsdfPrincipled")
    b.fill(shader, {"Specular_IOR_Level|Specular": 0.0})
    links.new(checker.outputs["Color"], shader.inputs["Base Color"])
    links.new(texture.outputs["Color"], shader.inputs["Alpha"])
    links.new(shader.outputs[0], output.inputs["Surface"])
    b.sphere("Cut Out", (2, 0, 1), 0.9, cut)
    b.light("AREA", (-2, -4, 6), (0, 0, 0), energy=600, size=2.0)
    b.background(0.3)


def normals(b):
    """A normal map, a bump map, flat and smooth faces."""
    b.camera()
    y, x = numpy.mgrid[0:128, 0:128] / 128 * 2 * math.pi * 4
    slope_x, slope_y = 0.25 * numpy.cos(x), 0.25 * numpy.cos(y)
    n = numpy.stack([-slope_x, -slope_y, numpy.ones_like(x)], axis=-1)
    n /= numpy.linalg.norm(n, axis=-1, keepdims=True)
    normal_image = b.image("normal", n * 0.5 + 0.5, colorspace="Non-Color")
    height = b.image("height", numpy.repeat((0.5 + 0.25 * (numpy.sin(x) + numpy.sin(y)))[..., None],
                                            3, axis=2), colorspace="Non-Color")

    mapped, nodes, links, output = b.empty_material("Normal Map")
    texture, normal = nodes.new("ShaderNodeTexImage"), nodes.new("ShaderNodeNormalMap")
    texture.image = normal_image
    b.fill(normal, {"Strength": 0.7})
    shader = nodes.new("ShaderNodeBsdfDiffuse")
    b.fill(shader, {"Color": (0.7, 0.6, 0.5, 1)})
    links.new(texture.outputs["Color"], normal.inputs["Color"])
    links.new(normal.outputs[0], shader.inputs["Normal"])
    links.new(shader.outputs[0], output.inputs["Surface"])
    b.plane(8, mapped)

    bumped, nodes, links, output = b.empty_material("Bump")
    texture, bump = nodes.new("ShaderNodeTexImage"), nodes.new("ShaderNodeBump")
    texture.image = height
    texture.interpolation = "Cubic"
    b.fill(bump, {"Distance": 0.05, "Strength": 1.0})
    shader = nodes.new("ShaderNodeBsdfDiffuse")
    b.fill(shader, {"Color": (0.2, 0.5, 0.7, 1)})
    links.new(texture.outputs["Color"], bump.inputs["Height"])
    links.new(bump.outputs[0], shader.inputs["Normal"])
    links.new(shader.outputs[0], output.inputs["Surface"])
    b.sphere("Bumped", (-1.3, 0, 1), 0.9, bumped)
    b.sphere("Flat", (1.3, 0, 1), 0.9, b.diffuse("Clay", (0.6, 0.4, 0.3)), 16, smooth=False)
    b.light("AREA", (-4, -3, 3), (0, 0, 0.5), energy=400, size=1.0)
    b.background(0.2)


def glass(b):
    """Glass of both shaders, rough glass, a colored volume inside, glossy metal."""
    b.camera()
    b.background(0.8)
    b.plane(material=b.diffuse("Floor", (0.5, 0.5, 0.5)))
    b.sphere("Glass", (-2.1, 0, 0.7), 0.7, b.material("Glass", "ShaderNodeBsdfGlass",
                                                      Color=(1, 1, 1, 1), IOR=1.5, Roughness=0.0))
    b.sphere("Rough", (-0.7, 0, 0.7), 0.7, b.material("Rough Glass", "ShaderNodeBsdfGlass",
                                                      Color=(1, 1, 1, 1), IOR=1.5, Roughness=0.3))
    clear = b.material("Principled Glass", "ShaderNodeBsdfPrincipled",
                       **{"Base_Color": (1, 1, 1, 1), "Roughness": 0.0, "IOR": 1.3,
                          "Transmission_Weight|Transmission": 1.0})
    nodes, links = clear.node_tree.nodes, clear.node_tree.links
    absorption = nodes.new("ShaderNodeVolumeAbsorption")
    b.fill(absorption, {"Color": (0.3, 0.8, 0.4, 1), "Density": 1.0})
    links.new(absorption.outputs[0], nodes["Material Output"].inputs["Volume"])
    b.sphere("Colored", (0.7, 0, 0.7), 0.7, clear)
    b.sphere("Metal", (2.1, 0, 0.7), 0.7, b.material(
        "Metal", "ShaderNodeBsdfGlossy", Color=(0.9, 0.6, 0.3, 1), Roughness=0.15))
    b.light("AREA", (0, -2, 6), (0, 0, 0), energy=300, size=1.0)


def emission(b):
    """Meshes that shine: plain, mixed with a surface, beside translucent and added shaders."""
    b.camera()
    b.plane(material=b.diffuse("Floor", (0.6, 0.6, 0.6)))
    b.sphere("Lamp", (-2, 0, 0.6), 0.5, b.material("Lamp", "ShaderNodeEmission",
                                                   Color=(1, 0.5, 0.2, 1), Strength=5.0))
    half, nodes, links, output = b.empty_material("Half")
    shine, surface, mix = (nodes.new("ShaderNodeEmission"), nodes.new("ShaderNodeBsdfDiffuse"),
                           nodes.new("ShaderNodeMixShader"))
    b.fill(shine, {"Color": (0.2, 0.5, 1, 1), "Strength": 4.0})
    mix.inputs[0].default_value = 0.25
    links.new(surface.outputs[0], mix.inputs[1])
    links.new(shine.outputs[0], mix.inputs[2])
    links.new(mix.outputs[0], output.inputs["Surface"])
    b.cube("Half", mathutils.Matrix.Translation((2, 0, 0.5)) @ mathutils.Matrix.Scale(0.5, 4), half)
    leaf, nodes, links, output = b.empty_material("Leaf")
    front, back, mix = (nodes.new("ShaderNodeBsdfDiffuse"), nodes.new("ShaderNodeBsdfTranslucent"),
                        nodes.new("ShaderNodeMixShader"))
    b.fill(front, {"Color": (0.2, 0.6, 0.2, 1)})
    b.fill(back, {"Color": (0.5, 0.7, 0.1, 1)})
    links.new(front.outputs[0], mix.inputs[1])
    links.new(back.outputs[0], mix.inputs[2])
    links.new(mix.outputs[0], output.inputs["Surface"])
    wall = b.plane(2, leaf)
    wall.matrix_world = (mathutils.Matrix.Translation((0, 0.5, 1))
                         @ mathutils.Matrix.Rotation(math.pi / 2, 4, "X"))
    glow = b.material("Glow", "ShaderNodeBsdfPrincipled",
                      **{"Emission_Color|Emission": (1, 0.9, 0.8, 1), "Emission_Strength": 3.0,
                         "Base_Color": (0.1, 0.1, 0.1, 1), "Specular_IOR_Level|Specular": 0.0})
    b.sphere("Glow", (0, 2, 1), 0.4, glow)
