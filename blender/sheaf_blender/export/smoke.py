# Copyright the Sheaf authors.
# SPDX-License-Identifier: Apache-2.0
"""Gas domains: the grid of their density."""
import dataclasses

import numpy

from ..scene import closures, materials

CELLS_MAX = 1 << 24


@dataclasses.dataclass(frozen=True)
class Smoke:
    """A grid in the space of an object. size: cells along x, y, z; density: x varies fastest."""
    size: tuple
    density: numpy.ndarray
    low: tuple
    high: tuple
    medium: object


def read(instance_object, shading, report):
    """The Smoke of a mesh that is a gas domain with this shading; None for other meshes."""
    domain = next((modifier.domain_settings for modifier in instance_object.modifiers
                   if modifier.type == "FLUID" and modifier.fluid_type == "DOMAIN"
                   and modifier.show_render), None)
    if domain is None or domain.domain_type != "GAS" or shading.medium is None:
        return None
    item = f'object "{instance_object.name}"'
    count = len(domain.density_grid)
    if count == 0:
        report.left_out(item, "its smoke, which is not baked")
        return None
    size = tuple(domain.domain_resolution)
    finer = round((count / (size[0] * size[1] * size[2])) ** (1 / 3))  # The noise has more cells.
    size = tuple(finer * cells for cells in size)
    if size[0] * size[1] * size[2] != count or count > CELLS_MAX:
        report.left_out(item, f"its smoke: {count} cells are not its grid, or are more than "
                              f"{CELLS_MAX}; lower its resolution")
        return None
    density = numpy.empty(count, numpy.float32)
    domain.density_grid.foreach_get(density)
    cell = [finer_cell / finer for finer_cell in domain.cell_size]
    low = tuple(domain.start_point)
    medium = shading.medium
    if medium.density_grid not in ("", "density") or medium.blackbody or max(medium.emission) > 0:
        report.left_out(item, "fire, and other grids of its smoke than the density")
    return Smoke(size, density, low, tuple(low[i] + size[i] * cell[i] for i in range(3)),
                 dataclasses.replace(medium, emission=(0.0, 0.0, 0.0), blackbody=0.0))


def without_medium(shading):
    """The shading of the mesh around a grid."""
    if shading.has_surface:
        return dataclasses.replace(shading, medium=None)
    return dataclasses.replace(shading, medium=None, has_surface=True, closure=closures.Closure(
        materials.make("interface")))


def parameters(smoke, coefficients):
    """Parameters of the directive MakeNamedMedium, without the densities."""
    return {"string type": "uniformgrid", **coefficients, "integer nx": smoke.size[0],
            "integer ny": smoke.size[1], "integer nz": smoke.size[2],
            "point3 p0": tuple(map(float, smoke.low)), "point3 p1": tuple(map(float, smoke.high))}


def densities(smoke):
    """The parameter of the densities, as text."""
    return ' "float density" [' + " ".join(f"{x:.6g}" for x in smoke.density.tolist()) + "]"
