#!/usr/bin/env python3
# Copyright the Sheaf authors.
# SPDX-License-Identifier: Apache-2.0
"""Writes small glTF models, one for each feature that Sheaf reads or refuses by name.

Usage: make_models.py FOLDER

MODELS maps the name of each to what its reading must say: None if it has no notes but those of the
camera, a text that a note has, or "error: TEXT".
"""
import base64
import math
import os
import sys

from gltf_file import GltfFile, png

MODELS = {}
SPHERE_RINGS, SPHERE_SIDES = 12, 24


def model(name, says=None):
    def register(function):
        MODELS[name] = (function, says)
        return function
    return register


def sphere(file, material=None, **options):
    """A mesh of a sphere of radius 1 with normals and uv; returns its index."""
    points, normals, uvs, indices = [], [], [], []
    for ring in range(SPHERE_RINGS + 1):
        theta = math.pi * ring / SPHERE_RINGS
        for side in range(SPHERE_SIDES + 1):
            phi = 2 * math.pi * side / SPHERE_SIDES
            normal = (math.sin(theta) * math.cos(phi), math.cos(theta),
                      -math.sin(theta) * math.sin(phi))
            points += normal
            normals += normal
            uvs += (side / SPHERE_SIDES, ring / SPHERE_RINGS)
    row = SPHERE_SIDES + 1
    for ring in range(SPHERE_RINGS):
        for side in range(SPHERE_SIDES):
            a = ring * row + side
            indices += (a, a + row, a + 1, a + 1, a + row, a + row + 1)
    primitive = {"attributes": {"POSITION": file.accessor(points, "VEC3"),
                                "NORMAL": file.accessor(normals, "VEC3"),
                                "TEXCOORD_0": file.accessor(uvs, "VEC2")},
                 "indices": file.accessor(indices, "SCALAR", 5123)}
    if material is not None:
        primitive["material"] = file.add("materials", material)
    primitive.update(options)
    return file.add("meshes", {"primitives": [primitive]})


def square(file, positions=(0, 0, 0, 1, 0, 0, 1, 1, 0, 0, 1, 0), indices=(0, 1, 2, 0, 2, 3),
           mode=None, **members):
    primitive = {"attributes": {"POSITION": file.accessor(list(positions), "VEC3")}}
    if indices is not None:
        primitive["indices"] = file.accessor(list(indices), "SCALAR", 5121)
    if mode is not None:
        primitive["mode"] = mode
    primitive.update(members)
    return file.add("meshes", {"primitives": [primitive]})


def checks(x, y):
    return (230, 60, 40, 255) if (x // 2 + y // 2) % 2 else (40, 90, 220, 0)


def with_material(extensions=None, **members):
    """A sphere whose material has extensions."""
    def build(file):
        material = dict(members)
        if extensions:
            material["extensions"] = extensions
            for name in extensions:
                file.extension(name)
        file.node(mesh=sphere(file, material))
    return build


EXTENSIONS = {
    "transmission": {"KHR_materials_transmission": {"transmissionFactor": 1}},
    "volume": {"KHR_materials_transmission": {"transmissionFactor": 1},
               "KHR_materials_volume": {"thicknessFactor": 1, "attenuationDistance": 0.5,
                                        "attenuationColor": [0.2, 0.8, 0.4]},
               "KHR_materials_ior": {"ior": 1.45}},
    "clearcoat": {"KHR_materials_clearcoat": {"clearcoatFactor": 1,
                                              "clearcoatRoughnessFactor": 0.1}},
    "sheen": {"KHR_materials_sheen": {"sheenColorFactor": [0.9, 0.4, 0.4],
                                      "sheenRoughnessFactor": 0.4}},
    "specular": {"KHR_materials_specular": {"specularFactor": 0.5,
                                            "specularColorFactor": [1, 0.5, 0.2]}},
    "iridescence": {"KHR_materials_iridescence": {"iridescenceFactor": 1,
                                                  "iridescenceThicknessMaximum": 500}},
    "anisotropy": {"KHR_materials_anisotropy": {"anisotropyStrength": 0.8,
                                                "anisotropyRotation": 0.5}},
}
# The material is a metal, which does not disperse.
SAYS = {"dispersion": "its dispersion has no effect", "unlit": "KHR_materials_unlit"}
EXTENSIONS["dispersion"] = {**EXTENSIONS["volume"], "KHR_materials_dispersion": {"dispersion": 1}}
EXTENSIONS["unlit"] = {"KHR_materials_unlit": {}}
EXTENSIONS["specular-glossiness"] = {"KHR_materials_pbrSpecularGlossiness": {"glossinessFactor": 1}}
for key, value in EXTENSIONS.items():
    model(key + ".glb", SAYS.get(key))(with_material(value))

model("metal.glb")(with_material(pbrMetallicRoughness={"baseColorFactor": [1, 0.8, 0.3, 1],
                                                       "roughnessFactor": 0.3}))
model("plastic.gltf")(with_material(pbrMetallicRoughness={"metallicFactor": 0}))
model("emission.glb")(with_material({"KHR_materials_emissive_strength": {"emissiveStrength": 5}},
                                    emissiveFactor=[1, 0.7, 0.4], doubleSided=True))
model("blend.glb")(with_material(alphaMode="BLEND",
                                 pbrMetallicRoughness={"baseColorFactor": [1, 1, 1, 0.5]}))


@model("textures.glb")
def _(file):
    sampler = file.add("samplers", {"wrapS": 33648, "wrapT": 33071, "magFilter": 9728})
    image = file.texture(png(8, 8, checks), sampler=sampler)
    transform = {"KHR_texture_transform": {"scale": [2, 3], "offset": [0.1, 0.2], "rotation": 0.3}}
    file.extension("KHR_texture_transform")
    file.node(mesh=sphere(file, {"pbrMetallicRoughness": {
        "baseColorTexture": {"index": image, "extensions": transform},
        "metallicRoughnessTexture": {"index": image}}}))


@model("mask.gltf")
def _(file):
    image = file.texture(png(8, 8, checks), embedded=False)
    file.node(mesh=sphere(file, {"alphaMode": "MASK", "doubleSided": True,
                                 "pbrMetallicRoughness": {"baseColorTexture": {"index": image}}}))


@model("normal-map.glb", "occlusion")
def _(file):
    bumps = file.texture(png(8, 8, lambda x, y: (128 + 60 * (x % 2), 128, 230, 255)))
    file.node(mesh=sphere(file, {"normalTexture": {"index": bumps},
                                 "occlusionTexture": {"index": bumps}}))


@model("emission-map.glb")
def _(file):
    image = file.texture(png(8, 8, checks))
    file.node(mesh=sphere(file, {"emissiveFactor": [2, 2, 2], "emissiveTexture": {"index": image}}))


REPEAT, MIRROR = 10497, 33648


def tiled_emission(first, wrap):
    """A square that emits one tile of its image, the one from uv `first` on."""
    def build(file):
        sampler = file.add("samplers", {"wrapS": wrap, "wrapT": wrap})
        image = file.texture(png(8, 8, checks), sampler=sampler)
        last = first + 1
        uvs = file.accessor([first, last, last, last, last, first, first, first], "VEC2")
        mesh = square(file, material=file.add("materials", {
            "pbrMetallicRoughness": {"baseColorFactor": [0, 0, 0, 1], "metallicFactor": 0},
            "emissiveFactor": [1, 1, 1], "emissiveTexture": {"index": image}}))
        file.json["meshes"][mesh]["primitives"][0]["attributes"]["TEXCOORD_0"] = uvs
        file.node(mesh=mesh)
    return build


model("emission-tile.glb")(tiled_emission(0, REPEAT))
model("emission-repeat.glb")(tiled_emission(3, REPEAT))
model("emission-mirror.glb")(tiled_emission(-2, MIRROR))


@model("other-uv.glb")
def _(file):
    image = file.texture(png(8, 8, checks))
    file.node(mesh=sphere(file, {
        "pbrMetallicRoughness": {"baseColorTexture": {"index": image}},
        "normalTexture": {"index": image, "texCoord": 1}}))


@model("strip-and-fan.glb")
def _(file):
    file.node(mesh=square(file, (0, 0, 0, 1, 0, 0, 0, 1, 0, 1, 1, 0), None, 5))
    file.node(mesh=square(file, indices=(0, 1, 2, 3), mode=6), translation=[1.5, 0, 0])


@model("image-with-name.glb")
def _(file):
    """As old exporters write it: an image in the file that has a file's name as well."""
    image = file.texture(png(8, 8, checks))
    file.json["images"][0]["uri"] = "lava.png"
    file.node(mesh=sphere(file, {"pbrMetallicRoughness": {"baseColorTexture": {"index": image}}}))


@model("points.glb", "points are spheres")
def _(file):
    file.node(mesh=square(file, indices=None, mode=0))
    file.node(mesh=square(file))


@model("lines.glb", "lines are tubes")
def _(file):
    file.node(mesh=square(file, indices=None, mode=2))


@model("unlit-colors.glb", "KHR_materials_unlit")
def _(file):
    mesh = square(file, material=file.add(
        "materials", {"extensions": {"KHR_materials_unlit": {}}, "doubleSided": True}))
    file.extension("KHR_materials_unlit")
    file.json["meshes"][mesh]["primitives"][0]["attributes"]["COLOR_0"] = file.accessor(
        [255, 0, 0, 0, 255, 0, 0, 0, 255, 255, 255, 255], "VEC3", 5121, normalized=True)
    file.node(mesh=mesh)


@model("white.glb")
def _(file):
    file.node(mesh=sphere(file, {"pbrMetallicRoughness": {"metallicFactor": 0}}))


@model("vertex-colors.glb")
def _(file):
    mesh = square(file)
    colors = file.accessor([255, 0, 0, 0, 255, 0, 0, 0, 255, 9, 9, 9], "VEC3", 5121,
                           normalized=True)
    file.json["meshes"][mesh]["primitives"][0]["attributes"]["COLOR_0"] = colors
    file.node(mesh=mesh)


@model("sparse.glb")
def _(file):
    base = file.accessor([0, 0, 0, 1, 0, 0, 1, 1, 0, 0, 1, 0], "VEC3")
    indices = file.view(bytes([2]))
    values = file.accessor([2, 2, 1], "VEC3")
    file.json["accessors"][base]["sparse"] = {
        "count": 1, "indices": {"bufferView": indices, "componentType": 5121},
        "values": {"bufferView": file.json["accessors"][values]["bufferView"]}}
    mesh = square(file)
    file.json["meshes"][mesh]["primitives"][0]["attributes"]["POSITION"] = base
    file.node(mesh=mesh)


@model("quantized.glb")
def _(file):
    file.extension("KHR_mesh_quantization")
    mesh = square(file)
    position = file.accessor([0, 0, 0, 0, 127, 0, 0, 0, 127, 127, 0, 0, 0, 127, 0, 0], "VEC4", 5120)
    accessor = file.json["accessors"][position]
    accessor.update(type="VEC3", normalized=True)
    file.json["bufferViews"][accessor["bufferView"]]["byteStride"] = 4
    file.json["meshes"][mesh]["primitives"][0]["attributes"]["POSITION"] = position
    file.node(mesh=mesh)


@model("shared-mesh.glb")
def _(file):
    mesh = sphere(file, {"pbrMetallicRoughness": {"metallicFactor": 0}})
    for i in range(5):
        file.node(mesh=mesh, translation=[2.5 * i, 0, 0], scale=[1, 1 + 0.2 * i, 1])


@model("gpu-instancing.glb")
def _(file):
    file.extension("EXT_mesh_gpu_instancing")
    offsets = [c for i in range(20) for c in (2.5 * (i % 5), 2.5 * (i // 5), 0)]
    turns = [c for i in range(20) for c in (0, 0, math.sin(i / 9), math.cos(i / 9))]
    file.node(mesh=square(file), extensions={"EXT_mesh_gpu_instancing": {"attributes": {
        "TRANSLATION": file.accessor(offsets, "VEC3"), "ROTATION": file.accessor(turns, "VEC4")}}})


@model("cameras.glb")
def _(file):
    near = file.add("cameras", {"name": "Near", "type": "perspective",
                                "perspective": {"yfov": 0.7, "znear": 0.1, "aspectRatio": 1.5}})
    flat = file.add("cameras", {"name": "Flat", "type": "orthographic", "orthographic": {
        "xmag": 2, "ymag": 1, "znear": 0, "zfar": 10}})
    file.node(mesh=sphere(file))
    file.node(camera=near, translation=[0, 0, 4])
    file.node(camera=flat, translation=[0, 0, 4])


@model("lights.glb", "its range has no effect")
def _(file):
    file.extension("KHR_lights_punctual")
    lights = [{"type": "point", "intensity": 30, "range": 10},
              {"type": "directional", "intensity": 2, "color": [1, 0.9, 0.8]},
              {"type": "spot", "intensity": 50, "spot": {"innerConeAngle": 0.2,
                                                         "outerConeAngle": 0.4}}]
    file.json["extensions"] = {"KHR_lights_punctual": {"lights": lights}}
    file.node(mesh=sphere(file))
    for i in range(3):
        file.node(translation=[3 * i - 3, 3, 3], rotation=[-0.38, 0, 0, 0.92],
                  extensions={"KHR_lights_punctual": {"light": i}})


def keys(file, values, kind, times=(0, 1), interpolation="LINEAR"):
    return {"input": file.accessor(list(times), "SCALAR"), "output": file.accessor(values, kind),
            "interpolation": interpolation}


@model("animation.glb", "is left out; choose it by --animation")
def _(file):
    node = file.node(mesh=sphere(file))
    half = math.sqrt(0.5)
    file.add("animations", {
        "name": "move", "samplers": [
            keys(file, [0, 0, 0, 3, 0, 0], "VEC3"),
            keys(file, [0, 0, 0, 1, 0, 0, half, half], "VEC4"),
            keys(file, [0] * 3 + [1] * 3 + [0] * 3 + [0] * 3 + [2] * 3 + [0] * 3, "VEC3",
                 interpolation="CUBICSPLINE")],
        "channels": [{"sampler": i, "target": {"node": node, "path": path}}
                     for i, path in enumerate(("translation", "rotation", "scale"))]})
    file.add("animations", {
        "name": "jump", "samplers": [keys(file, [0, 0, 0, 0, 2, 0], "VEC3",
                                          interpolation="STEP")],
        "channels": [{"sampler": 0, "target": {"node": node, "path": "translation"}}]})


@model("morph.glb")
def _(file):
    mesh = square(file)
    up = file.accessor([0, 0, 0, 0, 0, 0, 0, 0, 2, 0, 0, 2], "VEC3")
    file.json["meshes"][mesh]["primitives"][0]["targets"] = [{"POSITION": up}]
    file.json["meshes"][mesh]["weights"] = [0.25]
    node = file.node(mesh=mesh)
    file.add("animations", {"samplers": [keys(file, [0, 1], "SCALAR")], "channels": [
        {"sampler": 0, "target": {"node": node, "path": "weights"}}]})


@model("skin.glb")
def _(file):
    mesh = square(file)
    attributes = file.json["meshes"][mesh]["primitives"][0]["attributes"]
    attributes["JOINTS_0"] = file.accessor([0, 1, 0, 0] * 4, "VEC4", 5121)
    attributes["WEIGHTS_0"] = file.accessor([1, 0, 0, 0] * 2 + [0, 1, 0, 0] * 2, "VEC4")
    identity = [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1]
    tip = file.node(shown=False)
    root = file.node(children=[tip])
    skin = file.add("skins", {"joints": [root, tip],
                              "inverseBindMatrices": file.accessor(identity * 2, "MAT4")})
    file.node(mesh=mesh, skin=skin)
    file.add("animations", {"samplers": [keys(file, [0, 0, 0, 0, 0, 1], "VEC3")], "channels": [
        {"sampler": 0, "target": {"node": tip, "path": "translation"}}]})


@model("lamp.glb")
def _(file):
    """A white square, lit from its front by a lamp of 1000 cd and seen by a camera."""
    file.extension("KHR_lights_punctual")
    file.json["extensions"] = {"KHR_lights_punctual": {"lights": [
        {"type": "point", "intensity": 1000}]}}
    file.node(mesh=square(file, material=file.add("materials", {
        "pbrMetallicRoughness": {"metallicFactor": 0}})), translation=[-0.5, -0.5, 0])
    file.node(extensions={"KHR_lights_punctual": {"light": 0}}, translation=[0, 0, 2])
    file.node(camera=file.add("cameras", {"type": "perspective", "perspective": {
        "yfov": 0.5, "znear": 0.1}}), translation=[0, 0, 1.5])


@model("hidden.glb", "scaled to nothing")
def _(file):
    file.node(mesh=sphere(file))
    file.node(mesh=square(file), scale=[0, 0, 0])


@model("ktx2.glb", "error: KHR_texture_basisu")
def _(file):
    file.extension("KHR_texture_basisu")
    file.json["extensionsRequired"] = ["KHR_texture_basisu"]
    texture = file.add("textures", {"extensions": {"KHR_texture_basisu": {"source": 0}}})
    file.node(mesh=sphere(file, {"emissiveFactor": [1, 1, 1], "emissiveTexture": {
        "index": texture}}))


def compressed(text):
    return base64.b64decode(text)


# The square with uv, by Draco's own encoder: positions have the id 0, uv the id 1.
DRACO_SEQUENTIAL = compressed(
    "RFJBQ08CAgEAAAACBAEAAQIAAgMBAgAJAwAAAwkCAAECAgABAQADAwEwARADADSCiAQAAAAA/wcAAAABAQADAwEwARAD"
    "ADSCpAAAAAAA/wMAAAAAAAAAAAAAAAAAAAAAgD8LAAAAAAAAAAAAAIA/Cg==")
DRACO_EDGEBREAKER = compressed(
    "RFJBQ08CAgEBAAAABAIBAgAAAR//ARH/AREC/wAAAAAAAQAJAwAAAgEDCQIAAQIBAQEAAwMBMAEQAwAogpgAAAAAAP8H"
    "AAAAAAAAAAAAAAAAAAAAAIA/CwEBAQADAwEwARADACiCLAAAAAAA/wMAAAAAAAAAAAAAAACAPwo=")
# The square's positions and indices, by meshoptimizer's own encoder.
MESHOPT_POSITIONS = compressed(
    "oAAAATMAAAD//wEzAAAAfn0AAAEMAAAA/wEMAAAAfgAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAA==")
MESHOPT_TRIANGLES = compressed("4PAAAHaHVmd4qYZliWiYAWkAAA==")


def draco_square(file, data, triangles=2):
    file.extension("KHR_draco_mesh_compression")
    file.json["extensionsRequired"] = ["KHR_draco_mesh_compression"]
    accessors = [file.add("accessors", {"componentType": component, "count": count, "type": kind})
                 for component, count, kind in ((5126, 4, "VEC3"), (5126, 4, "VEC2"),
                                                (5123, 3 * triangles, "SCALAR"))]
    draco = {"bufferView": file.view(data), "attributes": {"POSITION": 0, "TEXCOORD_0": 1}}
    file.node(mesh=file.add("meshes", {"primitives": [{
        "attributes": {"POSITION": accessors[0], "TEXCOORD_0": accessors[1]},
        "indices": accessors[2], "extensions": {"KHR_draco_mesh_compression": draco}}]}))


@model("draco.glb")
def _(file):
    draco_square(file, DRACO_EDGEBREAKER)


@model("draco-sequential.glb")
def _(file):
    draco_square(file, DRACO_SEQUENTIAL)


@model("draco-damaged.glb", "error: the Draco mesh (KHR_draco_mesh_compression) is damaged")
def _(file):
    draco_square(file, DRACO_EDGEBREAKER[:-20])


@model("draco-large.glb", "error: has 2 triangles, but its accessors only 1")
def _(file):
    draco_square(file, DRACO_EDGEBREAKER, triangles=1)


def meshopt_square(file, vertices=4):
    """The views refer to a buffer without bytes, a fallback for readers without the extension."""
    file.extension("EXT_meshopt_compression")
    file.json["extensionsRequired"] = ["EXT_meshopt_compression"]
    file.json["buffers"] = [{"byteLength": 60,
                             "extensions": {"EXT_meshopt_compression": {"fallback": True}}}]
    sources = []
    for data, mode, count, stride in ((MESHOPT_POSITIONS, "ATTRIBUTES", vertices, 12),
                                      (MESHOPT_TRIANGLES, "TRIANGLES", 6, 2)):
        index = file.view(data)
        view = file.json["bufferViews"][index]
        sources.append({"buffer": 0, "byteOffset": view["byteOffset"], "byteLength": len(data),
                        "byteStride": stride, "count": count, "mode": mode})
    file.json["bufferViews"] = [
        {"buffer": 1, "byteOffset": offset, "byteLength": length, "extensions": {
            "EXT_meshopt_compression": source}}
        for source, offset, length in zip(sources, (0, 48), (48, 12))]
    for view, component, count, kind in ((0, 5126, 4, "VEC3"), (1, 5123, 6, "SCALAR")):
        file.add("accessors", {"bufferView": view, "componentType": component, "count": count,
                               "type": kind})
    file.node(mesh=file.add("meshes", {"primitives": [{"attributes": {"POSITION": 0},
                                                       "indices": 1}]}))


@model("meshopt.glb")
def _(file):
    meshopt_square(file)


@model("meshopt.gltf")
def _(file):
    """Some tools leave out the word that the buffer without bytes is a fallback."""
    meshopt_square(file)
    del file.json["buffers"][0]["extensions"]


@model("meshopt-damaged.glb", "error: buffer view 0 (EXT_meshopt_compression) is damaged")
def _(file):
    meshopt_square(file, vertices=1000)


@model("meshopt-large.glb", "error: more than they can; compress the file again")
def _(file):
    meshopt_square(file, vertices=1 << 30)


@model("cycle.gltf", "error: lies within itself")
def _(file):
    file.node(shown=False, children=[1])
    file.node(shown=False, children=[0])
    file.node(mesh=square(file))


@model("past-the-buffer.glb", "error: more than buffer view")
def _(file):
    mesh = square(file)
    file.json["accessors"][0]["count"] = 1 << 30
    file.node(mesh=mesh)


@model("bad-index.glb", "error: has the index 9")
def _(file):
    file.node(mesh=square(file, indices=(0, 1, 9)))


@model("unknown-extension.glb", "error: needs the extension ACME_cloth")
def _(file):
    file.extension("ACME_cloth")
    file.json["extensionsRequired"] = ["ACME_cloth"]
    file.node(mesh=square(file))


def write_models(folder):
    """Writes all; returns (path, says) of each."""
    os.makedirs(folder, exist_ok=True)
    written = []
    for name, (build, says) in sorted(MODELS.items()):
        file = GltfFile()
        build(file)
        path = os.path.join(folder, name)
        file.write(path)
        written.append((path, says))
    return written


if __name__ == "__main__":
    if len(sys.argv) != 2:
        sys.exit(__doc__)
    for path_written, _ in write_models(sys.argv[1]):
        print(path_written)
