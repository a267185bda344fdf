// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// NodePlace: where a texture node is looked up, in one to four dimensions.
#pragma once

#include <cstddef>

#include "common/math/vec.h"
#include "common/scene/pattern_textures.h"

namespace sheaf::render {

// The numbers of a node by node_parameters.h.
inline double NumberOf(const NodeTexture& node, size_t i) {
  return static_cast<double>(node.numbers[i]);
}
inline int ChoiceOf(const NodeTexture& node, size_t i) { return static_cast<int>(node.numbers[i]); }

// A place in one to four dimensions: w alone, x and y, p, or both.
struct NodePlace {
  Vec3d p;
  double w = 0;
  int dimensions = 3;
};
inline NodePlace operator*(double scale, const NodePlace& q) {
  return {scale * q.p, scale * q.w, q.dimensions};
}
inline NodePlace operator+(const NodePlace& a, const NodePlace& b) {
  return {a.p + b.p, a.w + b.w, a.dimensions};
}

// The place at which a node of these numbers is looked up, times its scale.
inline NodePlace PlaceOf(const NodeTexture& node, Vec3d p, size_t dimensions, size_t w,
                         size_t w_from, double scale) {
  const double last = ChoiceOf(node, w_from) == 0 ? NumberOf(node, w) : p.x;
  return scale * NodePlace{p, last, ChoiceOf(node, dimensions)};
}

}  // namespace sheaf::render
