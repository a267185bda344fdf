// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// A surface with +z up whose shading normal leans towards +x, for tests of what such ones scatter.
#pragma once

#include <cmath>
#include <numbers>

#include "common/math/frame.h"
#include "worker/render/bsdf/surface_tilt.h"

namespace sheaf::render::testing {

inline constexpr double kDegree = std::numbers::pi / 180;
inline constexpr Vec3f kUp{0, 0, 1};

inline Vec3f FromAngles(double theta_degrees, double phi_degrees) {
  const double t = theta_degrees * kDegree, p = phi_degrees * kDegree;
  return ToFloat(Vec3d{std::sin(t) * std::cos(p), std::sin(t) * std::sin(p), std::cos(t)});
}

// In the frame of its normal, bent for the viewer. u: what is drawn for the vertex.
struct Tilted {
  Frame frame;
  SurfaceTilt tilt;
  Vec3f wo;  // In the frame.

  Tilted(double tilt_degrees, Vec3f wo_world, Vec2f u) {
    const Vec3f n = BendNormal(FromAngles(tilt_degrees, 0), kUp, wo_world);
    frame = Frame::FromNormal(n);
    tilt = SurfaceTilt(frame.ToLocal(kUp), u);
    wo = frame.ToLocal(wo_world);
  }
};

}  // namespace sheaf::render::testing
