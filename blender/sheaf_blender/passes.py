# Copyright the Sheaf authors.
# SPDX-License-Identifier: Apache-2.0
"""Blender's render passes from the layers of Sheaf's images."""
import hashlib
import json

import numpy

from .export import light_groups

DEPTH_OF_NOTHING = 1e10  # As Cycles.
CRYPTOMATTE_LEVELS = 3
CRYPTOMATTE_KEY_LENGTH = 7  # Set by the format.
CRYPTOMATTE_KINDS = (("object", "CryptoObject"), ("material", "CryptoMaterial"),
                     ("asset", "CryptoAsset"))
ERROR, SAMPLES = "Sheaf Error", "Sheaf Samples"
# The names of Cycles, which node trees of the compositor are linked to.
DENOISING_NORMAL, DENOISING_ALBEDO = "Denoising Normal", "Denoising Albedo"
LIGHT_PATHS = ("emission", "specular-emission", "direct", "indirect", "caustic", "volume-single",
               "volume-multiple", "subsurface", "volume-emission")
MIST_POWERS = {"QUADRATIC": 2.0, "LINEAR": 1.0, "INVERSE_QUADRATIC": 0.5}
# Passes of Blender's view layers that Sheaf does not have.
_UNKNOWN = ("object_index", "material_index", "shadow", "ambient_occlusion", "emit", "environment",
            "diffuse_direct", "diffuse_indirect", "diffuse_color", "glossy_direct",
            "glossy_indirect", "glossy_color", "transmission_direct", "transmission_indirect",
            "transmission_color", "subsurface_direct", "subsurface_indirect", "subsurface_color")


def wanted_mattes(view_layer):
    """[(kind of Sheaf, name of the layers)] that the view layer asks for."""
    return [(kind, name) for kind, name in CRYPTOMATTE_KINDS
            if getattr(view_layer, f"use_pass_cryptomatte_{kind}", False)]


def chosen_passes(scene, view_layer):
    """[(name, channels, ids of channels, type)] of the passes besides the image."""
    settings = scene.sheaf
    found = [(name, *kind) for use, name, *kind in (
        ("z", "Depth", 1, "Z", "VALUE"), ("mist", "Mist", 1, "Z", "VALUE"),
        ("normal", "Normal", 3, "XYZ", "VECTOR"), ("position", "Position", 3, "XYZ", "VECTOR"),
        ("uv", "UV", 3, "UVA", "VECTOR")) if getattr(view_layer, f"use_pass_{use}", False)]
    if _has_vector(scene, view_layer):
        found.append(("Vector", 4, "XYZW", "VECTOR"))
    if settings.pass_denoising:
        found += [(DENOISING_NORMAL, 3, "XYZ", "VECTOR"), (DENOISING_ALBEDO, 3, "RGB", "COLOR")]
    if settings.pass_light_paths:
        found += [(light_path_pass(kind), 3, "RGB", "COLOR") for kind in LIGHT_PATHS]
    if settings.pass_error:
        found.append((ERROR, 3, "RGB", "COLOR"))
    if settings.pass_samples:
        found.append((SAMPLES, 1, "X", "VALUE"))
    found += [(group_pass(group), 3, "RGB", "COLOR") for group in view_layer.lightgroups]
    for _, name in wanted_mattes(view_layer):
        found += [(f"{name}{level:02d}", 4, "RGBA", "COLOR")
                  for level in range(CRYPTOMATTE_LEVELS)]
    return found


def group_pass(group):
    """Cycles' name of the pass of a light group."""
    return f"Combined_{group.name}"


def light_path_pass(kind):
    return "Sheaf " + kind.replace("-", " ").title()


def _has_vector(scene, view_layer):
    """Sheaf knows how far a surface moves while the shutter is open, but in panoramas."""
    is_panorama = scene.camera is not None and scene.camera.data.type == "PANO"
    return (view_layer.use_pass_vector and scene.render.use_motion_blur and not is_panorama
            and view_layer.use_motion_blur)


def options(scene, view_layer, has_negative=False, has_holdouts=False):
    """Options of `sheaf` for the passes of the view layer, and for what F12 makes of an image."""
    aovs = [name for name in ("position", "uv") if getattr(view_layer, f"use_pass_{name}", False)]
    if _has_vector(scene, view_layer):
        aovs.append("motion")
    mattes = [kind for kind, _ in wanted_mattes(view_layer)]
    if has_holdouts and "object" not in mattes:
        mattes.append("object")
    if scene.sheaf.pass_light_paths:
        lights = ["--light-paths"]
    else:
        lights = ["--light-groups"] if view_layer.lightgroups or has_negative else []
    return ((["--aov", ",".join(aovs)] if aovs else [])
            + (["--cryptomatte", ",".join(mattes)] if mattes else [])
            + lights)


def hides_sky(scene, view_layer):
    """Whether the camera sees the lit scene without the sky behind it."""
    visible = getattr(scene.world, "cycles_visibility", None)
    return view_layer.use_sky and scene.world is not None and (
        scene.render.film_transparent or not getattr(visible, "camera", True))


def take_out_sky(combined, alpha, sky):
    """Takes the sky out of colors. combined: (height, width, 4), changed; alpha: the part of each
    pixel that the scene covers; sky: (height, width, 3), or None to change nothing.
    """
    if sky is None:
        return
    combined[..., :3] -= (1 - alpha[..., None]) * sky
    combined[..., :3][alpha <= 0] = 0
    numpy.maximum(combined[..., :3], 0, out=combined[..., :3])


def replace_sky(combined, alpha, lit, seen):
    """Puts the sky that the camera sees in place of that which lights the scene; see
    take_out_sky.
    """
    if lit is None:
        return
    combined[..., :3] += (1 - alpha[..., None]) * (seen - lit)
    combined[..., :3] = numpy.where(alpha[..., None] <= 0, seen, combined[..., :3])
    numpy.maximum(combined[..., :3], 0, out=combined[..., :3])


def left_out(scene, view_layer, report, keeps_sky):
    """Reports the passes that Sheaf does not have. keeps_sky: whether nothing takes a hidden sky
    out of the image.
    """
    if keeps_sky and hides_sky(scene, view_layer):
        report.approximated("film", "Transparent, or a world that the camera does not see: the "
                                    "color includes the world; F12 takes it out")
    item = f'view layer "{view_layer.name}"'
    for name in _UNKNOWN:
        if getattr(view_layer, f"use_pass_{name}", False):
            report.left_out(item, f"the pass {name.replace('_', ' ').title()}")
    if view_layer.use_pass_vector:
        if _has_vector(scene, view_layer):
            report.approximated(item, "the pass Vector is the even motion of the open shutter, "
                                      "scaled to a frame")
        else:
            report.left_out(item, "the pass Vector, which needs Motion Blur and no "
                                  "panorama")


def mist_settings(scene):
    """(start, depth, power), or None without the pass's world."""
    if scene.world is None:
        return None
    mist = scene.world.mist_settings
    return mist.start, mist.depth, MIST_POWERS[mist.falloff]


def mist(distance, alpha, start, depth, power):
    """Blender's mist: 0 before the start, 1 behind start + depth and where nothing is."""
    fraction = numpy.clip((distance - start) / max(depth, 1e-6), 0, 1) ** power
    return alpha * fraction + (1 - alpha)


def vector(motion, shutter_frames):
    """Blender's vector, in pixels with y up: to where a surface was a frame ago, and from where it
    will be. motion: from opening to closing, y down.
    """
    back = numpy.stack([-motion[..., 0], motion[..., 1]], axis=-1) / shutter_frames
    return numpy.concatenate([back, back], axis=-1)


def depth_cosines(view_window, size, crop):
    """Cosines between the pixels' rays and the camera's axis: Blender's depth is along the axis,
    Sheaf's along the ray. view_window: see Exported; size: of the whole film; crop: x0, x1, y0, y1
    or ().
    """
    x0, x1, y0, y1 = crop or (0, size[0], 0, size[1])
    left, right, bottom, top = view_window
    x = left + (right - left) * (numpy.arange(x0, x1) + 0.5) / size[0]
    y = top + (bottom - top) * (numpy.arange(y0, y1) + 0.5) / size[1]
    return 1 / numpy.sqrt(1 + x[None, :] ** 2 + y[:, None] ** 2)


def arrays(layers, scene, view_layer, cosines=None):
    """{name of the pass: (height, width, channels), rows from the top} of Layers. cosines: see
    depth_cosines; None if depth is along the axis already.
    """
    alpha = layers.channels["A"][..., None]
    found = {"Combined": layers.stack("R", "G", "B", "A")}
    if not scene.render.film_transparent:
        found["Combined"][..., 3] = 1
    distance = layers.stack("depth.Z")
    if distance is not None:
        depth = distance if cosines is None else distance * cosines[..., None]
        found["Depth"] = numpy.where(alpha > 0, depth, DEPTH_OF_NOTHING)
        if (settings := mist_settings(scene)) is not None:
            found["Mist"] = mist(distance, alpha, *settings)
    _add_groups(found, layers, view_layer)
    found["Normal"] = found[DENOISING_NORMAL] = layers.stack("normal.X", "normal.Y", "normal.Z")
    found["Position"] = layers.stack("P.X", "P.Y", "P.Z")
    uv, motion = layers.stack("u", "v"), layers.stack("motion.X", "motion.Y")
    if uv is not None:
        found["UV"] = numpy.concatenate([uv, (alpha > 0).astype(numpy.float32)], axis=-1)
    if motion is not None:
        found["Vector"] = vector(motion, scene.render.motion_blur_shutter)
    for name, layer in ((DENOISING_ALBEDO, "albedo"), (ERROR, "stderr"),
                        *((light_path_pass(kind), kind) for kind in LIGHT_PATHS)):
        found[name] = layers.stack(*(f"{layer}.{c}" for c in "RGB"))
    found[SAMPLES] = layers.stack("samples.X")
    for _, name in wanted_mattes(view_layer):
        for level in range(CRYPTOMATTE_LEVELS):
            found[f"{name}{level:02d}"] = layers.stack(*(f"{name}{level:02d}.{c}" for c in "RGBA"))
    return {name: array for name, array in found.items() if array is not None}


def _add_groups(found, layers, view_layer):
    """Adds the passes of light groups; what lights of negative power give is taken away."""
    for index, name in [(-1, "Combined"), *((i, group_pass(group)) for i, group in
                                           enumerate(view_layer.lightgroups))]:
        light, less = (layers.stack(*(f"{light_groups.layer_name(index, is_negative)}.{c}"
                                      for c in "RGB")) for is_negative in (False, True))
        if index >= 0 and (light is not None or less is not None):
            found[name] = (0 if light is None else light) - (0 if less is None else less)
        if less is not None:  # The image has it as light.
            found["Combined"][..., :3] -= 2 * less


def cut_out(combined, layers, names):
    """Takes what the camera sees of the named objects out of the image and its alpha. At their
    edges a pixel loses the part that they cover of its light.
    """
    combined *= 1 - coverage(layers, names)[..., None]


def coverage(layers, names):
    """(height, width): the part of each pixel in which the camera sees the named objects."""
    manifest = next((value for key, value in layers.metadata.items()
                     if key.startswith("cryptomatte/") and key.endswith("/manifest")
                     and layers.metadata.get(key[:-len("manifest")] + "name") == "CryptoObject"),
                    "{}")
    hashes = json.loads(manifest)
    wanted = numpy.array([int(hashes[name], 16) for name in names if name in hashes], numpy.uint32)
    covered = numpy.zeros(layers.channels["A"].shape, numpy.float32)
    for level in range(CRYPTOMATTE_LEVELS):
        for number, part in ("RG", "BA"):
            ids = layers.channels.get(f"CryptoObject{level:02d}.{number}")
            if ids is not None:
                is_wanted = numpy.isin(numpy.ascontiguousarray(ids).view(numpy.uint32), wanted)
                covered += is_wanted * layers.channels[f"CryptoObject{level:02d}.{part}"]
    return numpy.minimum(covered, 1)


def matte_metadata(metadata, view_layer_name):
    """Cryptomatte's attributes of an image of Sheaf, for layers that are named as Blender's files
    name them: [(field, value)].
    """
    names = {key.split("/")[1]: value for key, value in metadata.items()
             if key.startswith("cryptomatte/") and key.endswith("/name")}
    found = []
    for key, name in names.items():
        full = f"{view_layer_name}.{name}"
        new = hashlib.blake2b(full.encode(), digest_size=4).hexdigest()[:CRYPTOMATTE_KEY_LENGTH]
        found += [(f"cryptomatte/{new}/{field}",
                   full if field == "name" else str(metadata[f"cryptomatte/{key}/{field}"]))
                  for field in ("name", "hash", "conversion", "manifest")
                  if f"cryptomatte/{key}/{field}" in metadata]
    return found


def set_passes(render_passes, arrays, width, height):
    """Fills passes of Blender, whose rows run from the bottom; those without an array become 0."""
    flat = []
    for render_pass in render_passes:
        array = arrays.get(render_pass.name)
        channels = render_pass.channels
        if array is None or array.shape[:2] != (height, width) or array.shape[2] < channels:
            array = numpy.zeros((height, width, channels), numpy.float32)
        flat.append(numpy.ascontiguousarray(array[::-1, :, :channels], numpy.float32).reshape(-1))
    render_passes.foreach_set("rect", numpy.concatenate(flat))
