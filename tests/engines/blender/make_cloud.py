# Copyright the Sheaf authors.
# SPDX-License-Identifier: Apache-2.0
"""Writes an OpenVDB file with a round cloud (Debian: python3-openvdb). make_cloud.py FILE"""
import sys

import numpy

try:
    import openvdb
except ImportError:
    import pyopenvdb as openvdb

EDGE = 32
place = (numpy.mgrid[0:EDGE, 0:EDGE, 0:EDGE] + 0.5) / EDGE * 2 - 1
distance = numpy.sqrt((place ** 2).sum(axis=0))
density = numpy.clip(1 - distance, 0, 1) * (1 + 0.5 * numpy.sin(6 * place[0]))
grid = openvdb.FloatGrid()
grid.copyFromArray(density.astype(numpy.float32))
grid.name = "density"
grid.gridClass = openvdb.GridClass.FOG_VOLUME
grid.transform = openvdb.createLinearTransform(
    matrix=[[2 / EDGE, 0, 0, 0], [0, 2 / EDGE, 0, 0], [0, 0, 2 / EDGE, 0], [-1, -1, -1, 1]])
openvdb.write(sys.argv[1], grids=[grid])
