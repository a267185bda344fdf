// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// GuidingSink: takes what the paths of a training find.
#pragma once

#include <cstdint>

#include "common/math/vec.h"
#include "worker/render/guiding/guiding_point.h"

namespace sheaf::render {

// A direction that a path took, and what it found there.
struct FoundLight {
  GuidingPoint from;
  Vec3f w;  // Unit.
  // >= 0: the light that the vertex scatters back from w, as a multiple of the light that the path
  // would carry there, as the mean over the components of color. An estimate of the integral over
  // all directions of what scatters times radiance, by a sample of density `pdf` per solid angle.
  double scattered = 0;
  double radiance = 0;
  double pdf = 0;
  // The part of the density that scattering has, in 0 to 1; the field has the rest. -1: the field
  // was not asked.
  double scattering_part = -1;
  // The direction is one that no field can sample: only the part counts.
  bool is_specular = false;
  uint64_t rays = 0;  // That the path took after the direction, shadow rays too.
};

// A sample of the light was tried from there.
struct TriedLight {
  GuidingPoint from;
  uint32_t light = 0;
  bool is_visible = false;
  // The light that the vertex scatters of it, over the density of the sample: the mean over the
  // components of color. 0 where the light is hidden.
  double contribution = 0;
};

// Functions may be called from many threads.
class GuidingSink {
 public:
  virtual ~GuidingSink() = default;
  virtual void AddDirection(const FoundLight& found) = 0;
  virtual void AddLight(const TriedLight& tried) = 0;
  // A path from the pixel has ended. radiance: what it brought, as the mean over the components of
  // color; rays: all that it took.
  virtual void AddPath(int32_t x, int32_t y, double radiance, uint64_t rays) = 0;
};

}  // namespace sheaf::render
