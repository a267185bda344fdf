// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "worker/render/equal_area_map.h"

#include <algorithm>
#include <cmath>

#include "common/math/elementary.h"

namespace sheaf::render {

Vec3d EqualAreaSquareToSphere(Vec2d st) {
  const double u = 2 * st.x - 1, v = 2 * st.y - 1;
  const double au = std::fabs(u), av = std::fabs(v);
  // Positive inside the inner diamond, the upper hemisphere; r = sqrt(1 - |z|) is the distance from
  // the pole of the hemisphere in the plane of the equal-area disk.
  const double to_diagonal = 1 - (au + av);
  const double r = 1 - std::fabs(to_diagonal);
  const double phi = (r == 0 ? 1.0 : (av - au) / r + 1) * (kPi / 4);
  // Good to 2^-36, and the direction becomes a float.
  const SinCosPair<double> p = elementary::SinCosForFloat(static_cast<float>(phi));
  const double sin_theta = r * std::sqrt(std::max(2 - r * r, 0.0));
  return {std::copysign(p.cos, u) * sin_theta, std::copysign(p.sin, v) * sin_theta,
          std::copysign(1 - r * r, to_diagonal)};
}

Vec2f EqualAreaSphereToSquare(Vec3f d) {
  const double x = std::fabs(d.x), y = std::fabs(d.y), z = std::fabs(d.z);
  // r^2 = 1 - |z| without the cancellation near the poles.
  const double r = std::sqrt((x * x + y * y) / (1 + z));
  const double quarter = elementary::Atan2ForFloat(y, x);
  double v = std::min(r, 1.0) * (quarter * (2 / kPi));
  double u = std::min(r, 1.0) - v;
  if (d.z < 0) {
    const double mirrored = 1 - v;
    v = 1 - u;
    u = mirrored;
  }
  const double s = 0.5 * (std::copysign(u, static_cast<double>(d.x)) + 1);
  const double t = 0.5 * (std::copysign(v, static_cast<double>(d.y)) + 1);
  return {static_cast<float>(std::clamp(s, 0.0, 1.0)), static_cast<float>(std::clamp(t, 0.0, 1.0))};
}

}  // namespace sheaf::render
