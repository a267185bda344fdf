// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "worker/render/sampling/equal_area_map.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "common/math/elementary.h"

namespace sheaf::render {
namespace {

using elementary::Polynomial;

// Sine and cosine of pi/4 (1 + t), -1 <= t <= 1, to 2^-33: Taylor series of the angle pi/4 t,
// rotated by pi/4.
SinCosPair<double> SinCosFromDiagonal(double t) {
  constexpr double kSqrtHalf = 0x1.6a09e667f3bcdp-1;
  const double angle = t * (kPi / 4), z = angle * angle;
  const double s =
      angle * Polynomial(z, 1.0, -1.0 / 6, 1.0 / 120, -1.0 / 5040, 1.0 / 362880, -1.0 / 39916800);
  const double c = Polynomial(z, 1.0, -0.5, 1.0 / 24, -1.0 / 720, 1.0 / 40320, -1.0 / 3628800);
  return {(c + s) * kSqrtHalf, (c - s) * kSqrtHalf};
}

// 2/pi times the angle of (x, y) to the x axis. Requires: x, y >= 0. The arc tangent's series about
// pi/8 is accurate to 2^-24 over the whole octant.
float QuarterTurns(float x, float y) {
  constexpr float kTanPi8 = 0x1.a8279ap-2f;
  constexpr float k = 0x1.45f306p-1f;  // 2 / pi.
  const float small = std::min(x, y), large = std::max(x, y);
  const float from_middle = small - kTanPi8 * large, along = large + kTanPi8 * small;
  // At the poles both are 0, and any angle is valid.
  const float t = from_middle / std::max(along, std::numeric_limits<float>::min());
  // Estrin's scheme shortens the latency, on which many lookups wait.
  const float z = t * t, z2 = z * z;
  const auto pair = [z](float a, float b) { return std::fma(b, z, a); };
  const float low = std::fma(pair(k / 5, -k / 7), z2, pair(k, -k / 3));
  const float high = std::fma(pair(k / 13, -k / 15), z2, pair(k / 9, -k / 11));
  const float turns = std::fma(t, std::fma(high, z2 * z2, low), 0.25f);
  return y > x ? 1 - turns : turns;
}

}  // namespace

Vec3d EqualAreaSquareToSphere(Vec2d st) {
  const double u = 2 * st.x - 1, v = 2 * st.y - 1;
  const double au = std::fabs(u), av = std::fabs(v);
  // Positive inside the inner diamond (upper hemisphere); r = sqrt(1 - |z|) is the distance from
  // the hemisphere's pole in the plane of the equal-area disk.
  const double to_diagonal = 1 - (au + av);
  const double r = 1 - std::fabs(to_diagonal);
  const SinCosPair<double> phi = SinCosFromDiagonal(r == 0 ? 0.0 : (av - au) / r);
  const double sin_theta = r * std::sqrt(std::max(2 - r * r, 0.0));
  return {std::copysign(phi.cos, u) * sin_theta, std::copysign(phi.sin, v) * sin_theta,
          std::copysign(1 - r * r, to_diagonal)};
}

Vec2f EqualAreaSphereToSquare(Vec3f d) {
  const float x = std::fabs(d.x), y = std::fabs(d.y), z = std::fabs(d.z);
  // r^2 = 1 - |z| without the cancellation near the poles.
  const float r = std::min(std::sqrt((x * x + y * y) / (1 + z)), 1.0f);
  float v = r * QuarterTurns(x, y);
  float u = r - v;
  if (d.z < 0) {
    const float mirrored = 1 - v;
    v = 1 - u;
    u = mirrored;
  }
  const float s = 0.5f * (std::copysign(u, d.x) + 1);
  const float t = 0.5f * (std::copysign(v, d.y) + 1);
  return {std::clamp(s, 0.0f, 1.0f), std::clamp(t, 0.0f, 1.0f)};
}

}  // namespace sheaf::render
