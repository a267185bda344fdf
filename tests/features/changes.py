# Copyright the Sheaf authors.
# SPDX-License-Identifier: Apache-2.0
"""Changes of a whole scene that keep its image: turned, mirrored, scaled, moved, in another order,
given twice.

A change rewrites the text of a scene. Camera and world are moved alike: with M as the transform,
world' = M world, so the camera's transform, which leads from the world, becomes C M^-1.
"""
import re

import numpy as np

import closed_forms as cf

TOKEN = re.compile(r'#[^\n]*|"[^"]*"|\[[^\]]*\]|[^\s\[\]"#]+')
DIRECTIVE = re.compile(r"[A-Z][A-Za-z]+$")
# A block that holds one of these keeps its place: later blocks may need it.
DEFINES = {"Texture", "MakeNamedMaterial", "MakeNamedMedium", "ObjectBegin", "CoordinateSystem",
           "Include", "Import", "Option", "ColorSpace"}
# The units of these are not those of lengths alone, so a scaled scene is another one.
KEEPS_NO_SCALE = re.compile(
    r'LightSource "(point|spot|goniometric|projection)"|Medium|"float power"|displacement|'
    r'"subsurface"|"float thickness"|nvdb|"string portal|"float illuminance"|'
    r'"layered"|"coated')
# Sheets that let a part of the light through are two where they are given twice.
KEEPS_NO_TWIN = re.compile(r'alpha|Medium|ObjectBegin|"float power"|thindielectric|"interface"')


def statements(text):
    """[directive, argument ...] of each statement, without comments."""
    found = []
    for token in TOKEN.findall(text):
        if token.startswith("#"):
            continue
        if DIRECTIVE.match(token) and (not found or found[-1][0] != "ActiveTransform"
                                       or len(found[-1]) > 1):
            found.append([token])
        else:
            found[-1].append(token)
    return found


def concat(matrix):
    return ["ConcatTransform", "[" + " ".join(repr(float(v)) for v in matrix.T.ravel()) + "]"]


def moved(parsed, matrix):
    """Moves camera and world."""
    back = np.linalg.inv(matrix)
    out, in_world = [], False
    for statement in parsed:
        directive = statement[0]
        if directive == "Camera":
            out += [["ActiveTransform", "All"], concat(back)]
        if directive == "ObjectInstance" and in_world:
            out += [["AttributeBegin"], ["ActiveTransform", "All"], concat(back), statement,
                    ["AttributeEnd"]]
        elif directive == "Transform" and in_world:
            out += [["Identity"], concat(matrix), ["ConcatTransform"] + statement[1:]]
        else:
            out.append(statement)
        if directive == "WorldBegin":
            in_world = True
        named_world = directive == "CoordSysTransform" and statement[1] == '"world"'
        if directive == "WorldBegin" or in_world and (directive == "Identity" or named_world):
            out.append(concat(matrix))
    return out


def given_twice(parsed):
    """Each shape twice."""
    return [s for statement in parsed for s in [statement] * (2 if statement[0] == "Shape" else 1)]


def take_block(parsed, begin):
    """The statements of the block that begins there, or None where it must keep its place."""
    depth = 0
    for end in range(begin, len(parsed)):
        depth += (parsed[end][0] == "AttributeBegin") - (parsed[end][0] == "AttributeEnd")
        if depth == 0:
            block = parsed[begin:end + 1]
            return None if any(s[0] in DEFINES for s in block) else block
    return None


def reordered(parsed):
    """Neighbouring blocks and neighbouring shapes in the reverse order."""
    out, run, i = [], [], 0

    def flush():
        nonlocal run
        for block in reversed(run):
            out.extend(block)
        run = []

    kind = None
    while i < len(parsed):
        block = None
        if parsed[i][0] == "AttributeBegin":
            block = take_block(parsed, i)
        elif parsed[i][0] == "Shape":
            block = [parsed[i]]
        new_kind = None if block is None else parsed[i][0]
        if new_kind != kind:
            flush()
            kind = new_kind
        if block is None:
            out.append(parsed[i])
            i += 1
        else:
            run.append(block)
            i += len(block)
    flush()
    return out


def uniform(factor):
    return cf.scale(factor, factor, factor)


ODD = cf.rotate(37.3, (0.3, 0.7, -0.4))
MOVES = {
    "turned": ODD,
    "turned by 90 degrees": cf.rotate(90, (0, 0, 1)),
    "mirrored": cf.scale(-1, 1, 1),
    "mirrored three times and turned": cf.scale(-1, -1, -1) @ ODD,
    "moved and turned": cf.translate(6e3, -4e3, 5e3) @ ODD,
    "moved by a million": cf.translate(6e5, -4e5, 1e6),
    "scaled by 1e-5": uniform(1e-5),
    "scaled by 1e5 and turned": uniform(1e5) @ ODD,
}
REWRITES = {
    "reordered": reordered,
    "given twice": given_twice,
    "given twice and turned": lambda parsed: moved(given_twice(parsed), ODD),
}
NAMES = tuple(MOVES) + tuple(REWRITES)


def applies(name, text, layer="RGB"):
    if layer != "RGB" or '"point3 portal"' in text:
        return name == "reordered"  # Normals, depths and portals are those of the world.
    if name.startswith("scaled"):
        return not KEEPS_NO_SCALE.search(text)
    if name.startswith("given twice"):
        return not KEEPS_NO_TWIN.search(text)
    return True


def changed(name, text):
    """The text of a scene that has the same image."""
    parsed = statements(text)
    parsed = moved(parsed, MOVES[name]) if name in MOVES else REWRITES[name](parsed)
    first = text.split("\n", 1)[0]
    return first + "\n" + "\n".join(" ".join(s) for s in parsed) + "\n"
