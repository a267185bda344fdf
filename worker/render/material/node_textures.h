// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// The texture nodes of Blender (NodeTexture) at a place of texture space. Factors are what the node
// gives as Fac, Distance or Value. Nothing is filtered, as in texture_patterns.cc.
//
// Sources: the nodes' formulas as Cycles 3.4 to 4.3 documents them; Worley 1996, "A cellular
// texture basis function"; Quilez 2012 (distances to edges of cells); Musgrave 1994, "Methods for
// realistic landscape imaging".
//
// Thread safety: pure functions.
#pragma once

#include "common/math/vec.h"
#include "common/scene/pattern_textures.h"
#include "common/scene/scene_description.h"

namespace sheaf::render {

// Require: the kind is not kAttribute.
float NodeFactor(const NodeTexture& node, Vec3d p);
Rgb NodeColor(const NodeTexture& node, Vec3d p);
// Requires: kAttribute, whose color is that of the vertices.
float AttributeFactor(const NodeTexture& node, const VertexColor& color);
// In cells of the finest detail per unit of texture space.
double NodeFrequency(const NodeTexture& node);
// Octaves of noise that a look-up sums.
int NodeOctaves(const NodeTexture& node);

}  // namespace sheaf::render
