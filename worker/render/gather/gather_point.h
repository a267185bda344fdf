// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// GatherPoint: the first rough vertex of a camera path behind specular ones, stored so that the
// light paths of a pass are merged with it. Facts that the grid knows are not repeated.
#pragma once

#include <cstdint>

#include "common/math/frame.h"
#include "worker/render/bsdf/bsdf.h"
#include "worker/render/bsdf/perturbed_normal.h"

namespace sheaf::render {

// Color: Rgb, or Spectral at the wavelengths of the pass.
template <typename Color>
struct GatherPointOf {
  BsdfOf<Color> bsdf;
  Color throughput{};  // The throughput of the camera path to here, with the weights of filter and
                       // lens.
  int32_t x = 0, y = 0;
  uint32_t depth = 0;       // Scattering events of the camera path, with this one.
  float weight_radius = 0;  // MergeRadius.
  Vec3f ng, n, t;  // The geometric normal; the shading frame, prepared for the camera path.
  Vec3f wo_local;
  PerturbedNormal perturbed_normal;
  int8_t light_side = 0;  // Light arrives on this side of ng alone; 0: on both.
  bool secondary_terminated = false;
};

// The most bytes of a point.
inline constexpr size_t kGatherPointBytesMax = 256;
static_assert(sizeof(GatherPointOf<Rgb>) <= kGatherPointBytesMax);
static_assert(sizeof(GatherPointOf<Spectral>) <= kGatherPointBytesMax);

}  // namespace sheaf::render
