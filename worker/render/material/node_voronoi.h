// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Voronoi nodes: cells (voronoi_cells.h) in octaves, as Blender has them since 4.0. Source: the
// manual of Blender 4.3, and the values of its nodes.
//
// Thread safety: pure.
#pragma once

#include "common/math/vec.h"
#include "common/scene/pattern_textures.h"
#include "worker/render/material/voronoi_cells.h"

namespace sheaf::render {

// p: in texture space; finite.
VoronoiCell VoronoiNodeAt(const NodeTexture& node, Vec3d p);

}  // namespace sheaf::render
