// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// VertexRounding: vertices given in double, rounded to float. Coordinates of maps and plans are
// large beside the shape that they describe, so that neighboring vertices would fall together:
// such a shape is rounded about a point near its middle, which its transform then adds in double.
// Other shapes are rounded as they are.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "common/math/vec.h"
#include "common/scene/scene_description.h"

namespace sheaf {

class VertexRounding {
 public:
  void Reserve(size_t count) { rounded_.reserve(count); }
  // Requires: p as float is finite.
  void Add(Vec3d p) {
    const Vec3f rounded = ToFloat(p);
    Add(rounded, ToFloat(p - ToDouble(rounded)));
  }
  // The vertex is the sum of both.
  void Add(Vec3f rounded, Vec3f remainder);
  const std::vector<Vec3f>& rounded() const { return rounded_; }
  uint64_t SizeBytes() const { return (rounded_.size() + remainders_.size()) * sizeof(Vec3f); }
  // The vertices minus *origin, which is 0 unless that keeps more of them. Leaves *this empty.
  std::vector<Vec3f> Take(Vec3d* origin);
  // The vertices minus the given origin.
  std::vector<Vec3f> TakeAbout(Vec3d origin);

 private:
  std::vector<Vec3f> rounded_;
  std::vector<Vec3f> remainders_;  // The parts that rounding took; empty if it took nothing.
};

// Moves the origin of a shape's space: afterwards, vertices are relative to `origin`. Requires:
// CanMoveOrigin, that is, the shape's motion neither turns nor scales, which would not carry the
// origin along.
bool CanMoveOrigin(const TransformOverTime& world_from_object);
void MoveOrigin(Vec3d origin, TransformOverTime* world_from_object);

// Why faces of the mesh cannot be told apart well: neighboring vertices that are only few steps of
// 32-bit floats apart. nullopt if they can.
std::optional<std::string> WhyImprecise(const std::vector<Vec3f>& positions,
                                        const std::vector<uint32_t>& indices, size_t corners);

}  // namespace sheaf
