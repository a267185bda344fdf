// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// GuidingSink: takes what the paths of a training find.
#pragma once

#include <cstdint>

#include "common/math/vec.h"

namespace sheaf::render {

// Functions may be called from many threads.
class GuidingSink {
 public:
  virtual ~GuidingSink() = default;
  // A path went from p along w (unit), a direction that scattering or the field sampled. value >=
  // 0: the radiance that it found there, as the mean over the components of color, over the density
  // of w per solid angle.
  virtual void AddDirection(Vec3f p, Vec3f w, double value) = 0;
  // A sample of the light was tried from p: it was visible, or hidden.
  virtual void AddLight(Vec3f p, uint32_t light, bool is_visible) = 0;
};

}  // namespace sheaf::render
