// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "worker/render/light/equiangular.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

namespace sheaf::render {
namespace {

constexpr double kNever = std::numeric_limits<double>::quiet_NaN();

// Intersections of the ray with the double cone; missing ones are kNever.
std::array<double, 2> IntersectCone(Vec3d from_apex, Vec3d d, Vec3d axis, double cosine) {
  // Points x with (x . axis)^2 = cosine^2 |x|^2.
  const double k = cosine * cosine;
  const double along_d = Dot(d, axis), along_o = Dot(from_apex, axis);
  const double a = along_d * along_d - k;
  const double b = along_d * along_o - k * Dot(from_apex, d);
  const double c = along_o * along_o - k * LengthSquared(from_apex);
  const double discriminant = b * b - a * c;
  if (!(discriminant >= 0)) return {kNever, kNever};
  const double q = -(b + std::copysign(std::sqrt(discriminant), b));
  return {q / a, c / q};
}

// Clips [*t0, *t1] to the part that the light illuminates. Rounding at its ends changes
// probabilities only.
void ClipToLight(const LightBounds& light, Vec3d o, Vec3d d, double* t0, double* t1) {
  const bool is_flat = light.kind == LightBounds::Kind::kPlanar;
  // Cones wider than a hemisphere are ignored.
  if (is_flat ? light.two_sided : !(light.cos_end > 0)) return;
  const Vec3d from_light = o - ToDouble(light.center), axis = ToDouble(light.normal);
  const double cos_end = is_flat ? 0 : static_cast<double>(light.cos_end);
  const std::array<double, 2> crossings =
      is_flat ? std::array<double, 2>{-Dot(from_light, axis) / Dot(d, axis), kNever}
              : IntersectCone(from_light, d, axis, cos_end);
  std::array<double, 4> ends{*t0, *t0, *t0, *t1};
  for (size_t i = 0; i < 2; ++i) {
    if (crossings[i] > *t0) ends[i + 1] = std::min(crossings[i], *t1);
  }
  if (ends[2] < ends[1]) std::swap(ends[1], ends[2]);
  // Between crossings either all points are lit, or none.
  double first = *t1, last = *t0;
  for (size_t i = 0; i < 3; ++i) {
    if (!(ends[i] < ends[i + 1])) continue;
    const double within = std::isinf(ends[i + 1]) ? 2 * (std::fabs(ends[i]) + Length(from_light))
                                                  : 0.5 * (ends[i] + ends[i + 1]);
    const Vec3d x = from_light + within * d;
    if (!(Dot(x, axis) > cos_end * Length(x))) continue;
    first = std::min(first, ends[i]);
    last = std::max(last, ends[i + 1]);
  }
  *t0 = first;
  *t1 = last;
}

}  // namespace

std::optional<EquiangularDistances> DistancesTo(const LightBounds& light, Vec3d o, Vec3d d,
                                                double begin, double end) {
  if (light.kind == LightBounds::Kind::kInfinite || !(light.strength > 0)) return std::nullopt;
  double t0 = begin, t1 = end;
  ClipToLight(light, o, d, &t0, &t1);
  return EquiangularDistances::Make(o, d, t0, t1, ToDouble(light.center),
                                    static_cast<double>(light.radius));
}

// Approximates the integrals of 1 / distance^2 and its square, weighted by the density of distance
// samples, by two parts: the first mean free path, and the vicinity of the point nearest to the
// light. The larger part replaces their sum.
double DistanceSamplingSpread(const LightBounds& light, Vec3d o, Vec3d d, double begin, double end,
                              double extinction) {
  const Vec3d to_light = ToDouble(light.center) - o;
  const double along = Dot(to_light, d), nearest = std::clamp(along, begin, end);
  const double radius = light.radius;
  const double height_squared = LengthSquared(to_light - nearest * d) + radius * radius;
  const double height = std::sqrt(height_squared), way = nearest - begin;
  const double reach = std::min(end - begin, 1 / extinction);
  const double beyond = std::max(way, 0.5 * reach);
  const double first = 1 / (height_squared + beyond * beyond);
  const double scattered = -Expm1(-extinction * (end - begin));
  const double arrives = extinction * Exp(-extinction * way);
  const double mean =
      std::max(scattered * first, arrives * std::min(kPi / height, reach / height_squared));
  const double square =
      std::max(scattered * first * first,
               arrives * std::min(0.5 * kPi / height, reach / height_squared) / height_squared);
  return square / (mean * mean);
}

}  // namespace sheaf::render
