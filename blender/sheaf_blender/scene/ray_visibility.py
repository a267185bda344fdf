# Copyright the Sheaf authors.
# SPDX-License-Identifier: Apache-2.0
"""Ray Visibility as the scene file has it: the kinds of rays that do not see a shape or a light."""

SCATTERED = ("diffuse", "glossy", "transmission", "volume scatter")
RAYS = ("camera", *SCATTERED, "shadow")


def parameter(hidden, is_lamp=False):
    """"string invisible" for the rays of RAYS that do not see it; {} if all do. is_lamp: whether
    it is a lamp or the world, which casts no shadow.
    """
    hidden = set(hidden)
    if is_lamp:
        hidden.discard("shadow")
    elif "diffuse" not in hidden:
        # Cycles' volume rays are diffuse ones, too, and see the objects that either sees.
        hidden.discard("volume scatter")
    words = tuple("volume" if ray == "volume scatter" else ray for ray in RAYS
                  if ray in hidden)
    return {"string invisible": words} if words else {}


def splits_shadow(hidden):
    """Whether an object hides other lights from shadow rays than from scattered ones."""
    words = set(parameter(hidden).get("string invisible", ()))
    scattered = words & {"diffuse", "glossy", "transmission", "volume"}
    return len(scattered) != (4 if "shadow" in words else 0)


def hidden_from_world(visibility):
    """The scattered rays that do not see the world. visibility: CyclesVisibilitySettings, or
    None.
    """
    names = {ray: ray for ray in SCATTERED} | {"volume scatter": "scatter"}
    return {ray for ray, name in names.items() if not getattr(visibility, name, True)}


UNKNOWING = {"light", "merging", "emission-guiding", "sharing", "views", "mutations", "chains"}


def known_techniques(options):
    """Options of `sheaf` without the techniques that do not know the kinds of a path's rays."""
    found = list(options)
    if "--techniques" in found:
        value = found.index("--techniques") + 1
        found[value] = "+".join(name for name in found[value].split("+")
                                if name not in UNKNOWING) or "camera"
    return found
