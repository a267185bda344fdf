# Copyright the Sheaf authors.
# SPDX-License-Identifier: Apache-2.0
"""Blender's render passes from the layers of Sheaf's images."""
import numpy

DEPTH_OF_NOTHING = 1e10  # As Cycles.
CRYPTOMATTE_LEVELS = 3
CRYPTOMATTE_KINDS = (("object", "CryptoObject"), ("material", "CryptoMaterial"),
                     ("asset", "CryptoAsset"))
ALBEDO, ERROR, SAMPLES = "Sheaf Albedo", "Sheaf Error", "Sheaf Samples"


def wanted_mattes(view_layer):
    """[(kind of Sheaf, name of the layers)] that the view layer asks for."""
    return [(kind, name) for kind, name in CRYPTOMATTE_KINDS
            if getattr(view_layer, f"use_pass_cryptomatte_{kind}", False)]


def chosen_passes(scene, view_layer):
    """[(name, channels, ids of channels, type)] of the passes besides the image."""
    settings = scene.sheaf
    found = [(name, *kind) for use, name, *kind in (
        ("z", "Depth", 1, "Z", "VALUE"), ("normal", "Normal", 3, "XYZ", "VECTOR"),
        ("position", "Position", 3, "XYZ", "VECTOR"), ("uv", "UV", 3, "UVA", "VECTOR"))
        if getattr(view_layer, f"use_pass_{use}", False)]
    if settings.pass_albedo:
        found.append((ALBEDO, 3, "RGB", "COLOR"))
    if settings.pass_error:
        found.append((ERROR, 3, "RGB", "COLOR"))
    if settings.pass_samples:
        found.append((SAMPLES, 1, "X", "VALUE"))
    for _, name in wanted_mattes(view_layer):
        found += [(f"{name}{level:02d}", 4, "RGBA", "COLOR")
                  for level in range(CRYPTOMATTE_LEVELS)]
    return found


def options(view_layer):
    """Options of `sheaf` for the passes of the view layer."""
    aovs = [aov for name, aov in (("position", "position"), ("uv", "uv"))
            if getattr(view_layer, f"use_pass_{name}", False)]
    mattes = [kind for kind, _ in wanted_mattes(view_layer)]
    return ((["--aov", ",".join(aovs)] if aovs else [])
            + (["--cryptomatte", ",".join(mattes)] if mattes else []))


def left_out(scene, view_layer, report):
    """Reports the passes that Sheaf does not have."""
    if scene.render.film_transparent:
        report.approximated("film", "Transparent: alpha is right, the color includes the world")
    item = f'view layer "{view_layer.name}"'
    for name in ("mist", "vector", "object_index", "material_index", "shadow",
                 "ambient_occlusion", "emit", "environment", "diffuse_direct", "diffuse_indirect",
                 "diffuse_color", "glossy_direct", "glossy_indirect", "glossy_color",
                 "transmission_direct", "transmission_indirect", "transmission_color",
                 "subsurface_direct", "subsurface_indirect", "subsurface_color"):
        if getattr(view_layer, f"use_pass_{name}", False):
            report.left_out(item, f"the pass {name.replace('_', ' ').title()}")


def depth_cosines(view_window, size, crop):
    """Of the rays of the pixels to the camera's axis: Blender's depth is along the axis, Sheaf's
    along the ray. view_window: see Exported; size: of the whole film; crop: x0, x1, y0, y1 or ().
    """
    x0, x1, y0, y1 = crop or (0, size[0], 0, size[1])
    left, right, bottom, top = view_window
    x = left + (right - left) * (numpy.arange(x0, x1) + 0.5) / size[0]
    y = top + (bottom - top) * (numpy.arange(y0, y1) + 0.5) / size[1]
    return 1 / numpy.sqrt(1 + x[None, :] ** 2 + y[:, None] ** 2)


def arrays(layers, view_layer, is_transparent, cosines=None):
    """{name of the pass: (height, width, channels), rows from the top} of Layers."""
    alpha = layers.channels["A"]
    found = {"Combined": layers.stack("R", "G", "B", "A")}
    if not is_transparent:
        found["Combined"][..., 3] = 1
    depth = layers.stack("depth.Z")
    if depth is not None:
        if cosines is not None:
            depth = depth * cosines[..., None]
        found["Depth"] = numpy.where(alpha[..., None] > 0, depth, DEPTH_OF_NOTHING)
    found["Normal"] = layers.stack("normal.X", "normal.Y", "normal.Z")
    found["Position"] = layers.stack("P.X", "P.Y", "P.Z")
    uv = layers.stack("u", "v")
    if uv is not None:
        found["UV"] = numpy.concatenate([uv, (alpha[..., None] > 0).astype(numpy.float32)], axis=-1)
    found[ALBEDO] = layers.stack("albedo.R", "albedo.G", "albedo.B")
    found[ERROR] = layers.stack("stderr.R", "stderr.G", "stderr.B")
    found[SAMPLES] = layers.stack("samples.X")
    for _, name in wanted_mattes(view_layer):
        levels = [layers.stack(*(f"{name}{level:02d}.{c}" for c in "RGBA"))
                  for level in range(CRYPTOMATTE_LEVELS)]
        if any(level is None for level in levels):
            continue
        found.update({f"{name}{i:02d}": level for i, level in enumerate(levels)})
    return {name: array for name, array in found.items() if array is not None}


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
