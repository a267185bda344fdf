// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// A surface facing +z whose shading normal is tilted towards +x, for tests of scattering with
// perturbed normals.
#pragma once

#include <cmath>
#include <numbers>

#include "common/math/frame.h"
#include "worker/render/bsdf/perturbed_normal.h"

namespace sheaf::render::testing {

inline constexpr double kDegree = std::numbers::pi / 180;
inline constexpr Vec3f kUp{0, 0, 1};

inline Vec3f FromAngles(double theta_degrees, double phi_degrees) {
  const double t = theta_degrees * kDegree, p = phi_degrees * kDegree;
  return ToFloat(Vec3d{std::sin(t) * std::cos(p), std::sin(t) * std::sin(p), std::cos(t)});
}

inline constexpr PerturbedNormal::Source kNormalSources[] = {PerturbedNormal::Source::kMap,
                                                             PerturbedNormal::Source::kVertices};

// A point in the frame of its shading normal, which is bent towards the viewer. u: the random
// numbers of the vertex.
struct PerturbedSurface {
  Frame frame;
  PerturbedNormal normal;
  Vec3f wo;  // In the frame.

  PerturbedSurface(double tilt_degrees, Vec3f wo_world, Vec2f u,
                   PerturbedNormal::Source source = PerturbedNormal::Source::kMap) {
    const Vec3f n = BendNormal(FromAngles(tilt_degrees, 0), kUp, wo_world);
    frame = Frame::FromNormal(n);
    normal = PerturbedNormal(source, frame.ToLocal(kUp), u);
    wo = frame.ToLocal(wo_world);
  }
};

}  // namespace sheaf::render::testing
