# Copyright the Sheaf authors.
# SPDX-License-Identifier: Apache-2.0
"""Renders models of tests/gltf by Sheaf and by Cycles after Blender's own import, with one camera,
one distant light and one uniform surrounding, and compares the means over the surface.

Part of run.py: `run.py --only gltf`, which says what is installed and where images are kept.
"""
import math
import pathlib
import subprocess
import sys

import numpy
import OpenImageIO

import passes_checks

GLTF = pathlib.Path(__file__).resolve().parents[2] / "gltf"
WIDTH, HEIGHT = 96, 64  # As scenes.py.
MEAN_DIFFERENCE_MAX = 0.03
SURROUNDING = 0.5   # Radiance.
# For models that say nothing: glTF's own default is rough white metal, which shows no extension.
BODY = {"metallicFactor": 0, "roughnessFactor": 0.3, "baseColorFactor": [0.5, 0.35, 0.2, 1]}
GLASS = {"metallicFactor": 0, "roughnessFactor": 0}
SUN = {"type": "directional", "intensity": 1.5, "color": [1, 0.95, 0.9]}
PITCH, YFOV = 0.2, 0.5
ADDED = "Cycles before 4.0 adds the reflection to the base, and has Disney's diffuse lobe"
# Each model: how far the camera is from what it looks at, that place, and why the images differ. A
# reason that begins with "< 4" holds for Blender before 4.0 alone.
MODELS = {
    "metal.glb": (5.0, (0, 0, 0), ""),
    "plastic.gltf": (5.0, (0, 0, 0), "< 4: " + ADDED),
    "emission.glb": (5.0, (0, 0, 0), ""),
    "transmission.glb": (5.0, (0, 0, 0), "Blender imports a thin sheet as solid glass"),
    "volume.glb": (5.0, (0, 0, 0), "Blender absorbs 1 - color where the format says -log(color)"),
    "clearcoat.glb": (5.0, (0, 0, 0), "< 4: Clearcoat has a quarter of its weight"),
    "sheen.glb": (5.0, (0, 0, 0), "Cycles has other models of sheen"),
    "specular.glb": (5.0, (0, 0, 0), "< 4: " + ADDED),
    "textures.glb": (5.0, (0, 0, 0), "Blender reads an image that is color and data as data"),
    "mask.gltf": (5.0, (0, 0, 0), "Cycles blends where the format cuts"),
    "emission-map.glb": (5.0, (0, 0, 0), "Cycles interpolates encoded texels, here of 8 x 8"),
    "shared-mesh.glb": (20.0, (5, 0, 0), "< 4: " + ADDED),
    "strip-and-fan.glb": (6.0, (1, 0.5, 0), "< 4: " + ADDED),
    "sparse.glb": (6.0, (1, 1, 0), "< 4: " + ADDED),
    "quantized.glb": (6.0, (1, 1, 0), "< 4: " + ADDED),
    "normal-map.glb": (5.0, (0, 0, 0), "normals of maps lose light in Cycles, and keep it here"),
    "anisotropy.glb": (5.0, (0, 0, 0), "Cycles stretches highlights by another formula"),
}


def write_model(name, folder):
    """The model with a camera and a light; returns its path."""
    sys.path.insert(0, str(GLTF))
    import gltf_file
    import make_models
    file = gltf_file.GltfFile()
    checks = make_models.checks
    if name != "mask.gltf":  # Blender takes colors of transparent texels for black.
        make_models.checks = lambda x, y: (*checks(x, y)[:3], 255)
    make_models.MODELS[name][0](file)
    make_models.checks = checks
    if "materials" not in file.json:  # Blender's own default is another one.
        index = file.add("materials", {})
        for mesh in file.json["meshes"]:
            for primitive in mesh["primitives"]:
                primitive["material"] = index
    for material in file.json["materials"]:
        is_glass = "KHR_materials_transmission" in material.get("extensions", {})
        material.setdefault("pbrMetallicRoughness", GLASS if is_glass else BODY)
    distance, place, _ = MODELS[name]
    camera = file.add("cameras", {"type": "perspective", "perspective": {
        "yfov": YFOV, "znear": 0.1, "aspectRatio": WIDTH / HEIGHT}})
    file.node(camera=camera, translation=[
        place[0], place[1] + distance * math.sin(PITCH), place[2] + distance * math.cos(PITCH)],
        rotation=[-math.sin(PITCH / 2), 0, 0, math.cos(PITCH / 2)])
    file.extension("KHR_lights_punctual")
    file.json.setdefault("extensions", {})["KHR_lights_punctual"] = {"lights": [SUN]}
    # From the left and above, behind the camera.
    file.node(rotation=quaternion(-0.6, -0.5), extensions={"KHR_lights_punctual": {"light": 0}})
    path = folder / name
    file.write(str(path))
    return path


def quaternion(pitch, yaw):
    """First about x, then about y."""
    x, y = (math.sin(pitch / 2), math.cos(pitch / 2)), (math.sin(yaw / 2), math.cos(yaw / 2))
    return [y[1] * x[0], y[0] * x[1], -y[0] * x[0], y[1] * x[1]]


def write_surrounding(path):
    spec = OpenImageIO.ImageSpec(8, 4, 3, "float")
    output = OpenImageIO.ImageOutput.create(path)
    output.open(path, spec)
    output.write_image(numpy.full((4, 8, 3), SURROUNDING, numpy.float32))
    output.close()


def check_models(bench, compare, only):
    """Returns what failed. bench, compare: of run.py."""
    failed = []
    folder = bench.folder / "gltf"
    folder.mkdir(exist_ok=True)
    surrounding = str(folder / "white.exr")
    write_surrounding(surrounding)
    for name, (_, _, reason) in MODELS.items():
        if only and name not in only:
            continue
        path, stem = write_model(name, folder), name.partition(".")[0]
        sheaf, cycles = (folder / f"{stem}.{engine}.exr" for engine in ("sheaf", "cycles"))
        render(bench.arguments, path, surrounding, sheaf)
        bench.run(str(path), str(SURROUNDING), bench.arguments.cycles_samples, cycles,
                  script="gltf_in_blender.py")
        means = surface_means(sheaf, cycles)
        compare.compare(folder, stem)
        differences = means[0] / means[1] - 1
        applies = reason and (not reason.startswith("< 4") or not bench.arguments.trixie)
        text = (f"{name}: Sheaf {', '.join(f'{x:.4f}' for x in means[0])}, Cycles "
                f"{', '.join(f'{x:.4f}' for x in means[1])}, "
                f"{', '.join(f'{100 * x:+.2f}' for x in differences)} %")
        if applies:
            print(f"  differs: {text} ({reason.removeprefix('< 4: ')})", flush=True)
        elif numpy.abs(differences).max() > MEAN_DIFFERENCE_MAX:
            failed.append(text)
            print(f"  FAILED: {text}", flush=True)
        else:
            print(f"  ok: {text}", flush=True)
    return failed


def render(arguments, model, surrounding, output):
    subprocess.run([arguments.programs / "sheaf", "render", model, "-o", output,
                    "--samples", str(arguments.samples), "--size", f"{WIDTH}x{HEIGHT}",
                    "--environment", surrounding, "--shutter", "0", "--max-depth", "16",
                    "--threads", str(arguments.threads)], check=True, stderr=subprocess.DEVNULL)


def surface_means(sheaf, cycles):
    """Means of R, G and B of both, over the pixels that a surface fills in Sheaf's image."""
    images = [passes_checks.read(path)[0] for path in (sheaf, cycles)]
    filled = images[0]["A"] > 0.999
    if not filled.any():
        raise ValueError(f"{sheaf}: no surface is seen")
    return [numpy.array([image[c][filled].mean() for c in "RGB"]) for image in images]
