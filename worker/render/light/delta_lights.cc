// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "worker/render/light/delta_lights.h"

#include <cmath>

#include "common/math/elementary.h"
#include "worker/render/geometry/affine.h"
#include "worker/render/light/light_space.h"
#include "worker/render/sampling/directions.h"

namespace sheaf::render {
namespace {

// Relative tolerance within which a light's transform counts as a rotation with uniform scale, so
// that the choice among lights can use the light's cone; and the slack that widens the cone's
// cosine for it.
constexpr float kSimilarityTolerance = 1e-5f, kConeSlack = 1e-4f;

double LuminanceOf(Rgb color) { return static_cast<double>(StrengthOf(color)); }

LightBounds BoundsAt(const LightAtPoint& light, Rgb peak) {
  return {.kind = LightBounds::Kind::kPoint,
          .center = ToFloat(light.position),
          .strength = StrengthOf(light.emission.rgb * peak)};
}

// Whether the map preserves angles to well within kConeSlack.
bool IsSimilarity(const Vec3f (&rows)[3]) {
  const float scale = LengthSquared(rows[0]);
  for (size_t i = 0; i < 3; ++i) {
    if (!(std::fabs(LengthSquared(rows[i]) - scale) <= kSimilarityTolerance * scale &&
          std::fabs(Dot(rows[i], rows[(i + 1) % 3])) <= kSimilarityTolerance * scale)) {
      return false;
    }
  }
  return true;
}

// axis: unit, in the light's space.
void LimitToCone(const OrientedLight& light, Vec3f axis, float cos_end, LightBounds* bounds) {
  const Vec3f(&rows)[3] = light.light_from_render;
  if (!IsSimilarity(rows)) return;
  bounds->normal = Normalize(axis.x * rows[0] + axis.y * rows[1] + axis.z * rows[2]);
  bounds->cos_end = cos_end - kConeSlack;
}

Vec3d ToRender(const OrientedLight& light, Vec3d w_light) {
  return Inverse(AffineOf(light.light_from_render)).Vector(w_light);
}

// A linear map L takes the solid angle about the unit vector w to |det L| / |L w|^3 times that.
struct Stretch {
  Vec3d in_light;  // Unit.
  double factor = 0;
};
Stretch StretchAlong(const OrientedLight& light, Vec3f w) {
  const Affine light_from_render = AffineOf(light.light_from_render);
  const Vec3d in_light = light_from_render.Vector(ToDouble(w));
  const double length = Length(in_light);
  return {in_light / length,
          std::fabs(light_from_render.Determinant()) / (length * length * length)};
}

// The smooth step of pbrt-v4's spot light: 0 at `low`, 1 at `high`.
float SmoothStep(float x, float low, float high) {
  if (!(x > low)) return 0;
  if (x >= high) return 1;
  const float t = (x - low) / (high - low);
  return t * t * (3 - 2 * t);
}

SpotDirections ConeOf(const SpotEmitter& spot) {
  return SpotDirections(spot.axis, spot.cos_start, spot.cos_end);
}

}  // namespace

// --- Distant lights ----------------------------------------------------------------------------

LightBounds DistantEmitter::Bounds(const LightMaps&) const {
  return {.kind = LightBounds::Kind::kInfinite, .strength = StrengthOf(emission.rgb)};
}
double DistantEmitter::Power(const LightMaps&, double cross_section) const {
  return cross_section * LuminanceOf(emission.rgb);
}

// --- Point lights ------------------------------------------------------------------------------

Vec3d PointEmitter::SampleDirection(const ImageSamplers&, Vec2f u) const {
  return ToDouble(UniformDirection(u));
}
double PointEmitter::DirectionPdf(const ImageSamplers&, Vec3f) const { return 1 / (4 * kPi); }
LightBounds PointEmitter::Bounds(const LightMaps&) const { return BoundsAt(*this, Rgb::Gray(1)); }
double PointEmitter::Power(const LightMaps&, double) const {
  return 4 * kPi * LuminanceOf(emission.rgb);
}

// --- Spot lights -------------------------------------------------------------------------------

float SpotEmitter::FalloffAlong(const LightMaps&, Vec3f w) const {
  const Vec3f w_light = Rotate(light_from_render, w);
  const float cosine = Dot(w_light, axis) / Length(w_light);
  return SmoothStep(cosine, cos_end, cos_start);
}
Vec3d SpotEmitter::SampleDirection(const ImageSamplers&, Vec2f u) const {
  return ToRender(*this, ConeOf(*this).Sample(u));
}
double SpotEmitter::DirectionPdf(const ImageSamplers&, Vec3f w) const {
  const Stretch stretch = StretchAlong(*this, w);
  return stretch.factor * ConeOf(*this).Pdf(stretch.in_light);
}
LightBounds SpotEmitter::Bounds(const LightMaps&) const {
  LightBounds bounds = BoundsAt(*this, Rgb::Gray(1));
  LimitToCone(*this, axis, cos_end, &bounds);
  return bounds;
}
double SpotEmitter::Power(const LightMaps&, double) const {
  return ConeOf(*this).Integral() * LuminanceOf(emission.rgb);
}

// --- Goniometric lights ------------------------------------------------------------------------

float GoniometricEmitter::FalloffAlong(const LightMaps& maps, Vec3f w) const {
  const Vec3f w_light = Rotate(light_from_render, w);
  return std::visit([&](const auto& intensity) { return intensity.At(w_light / Length(w_light)); },
                    maps.intensities[image]);
}
Vec3d GoniometricEmitter::SampleDirection(const ImageSamplers& samplers, Vec2f u) const {
  return ToRender(*this, std::visit([&](const auto& directions) { return directions.Sample(u); },
                                    samplers.intensities[image]));
}
double GoniometricEmitter::DirectionPdf(const ImageSamplers& samplers, Vec3f w) const {
  // The vector by which FalloffAlong chooses the texel.
  const Vec3f w_light = Rotate(light_from_render, w);
  return StretchAlong(*this, w).factor *
         std::visit(
             [&](const auto& directions) { return directions.Pdf(w_light / Length(w_light)); },
             samplers.intensities[image]);
}
LightBounds GoniometricEmitter::Bounds(const LightMaps& maps) const {
  return BoundsAt(*this, Rgb::Gray(std::visit([](const auto& i) { return i.peak(); },
                                              maps.intensities[image])));
}
double GoniometricEmitter::Power(const LightMaps& maps, double) const {
  return 4 * kPi * LuminanceOf(emission.rgb) *
         std::visit([](const auto& i) { return i.mean(); }, maps.intensities[image]);
}

// --- Projections -------------------------------------------------------------------------------

Rgb ProjectionEmitter::FalloffAlong(const LightMaps& maps, Vec3f w) const {
  return maps.projected[image].At(Rotate(light_from_render, w));
}
Vec3d ProjectionEmitter::SampleDirection(const ImageSamplers& samplers, Vec2f u) const {
  return ToRender(*this, samplers.projected[image].Sample(u));
}
double ProjectionEmitter::DirectionPdf(const ImageSamplers& samplers, Vec3f w) const {
  return StretchAlong(*this, w).factor *
         samplers.projected[image].Pdf(Rotate(light_from_render, w));
}
LightBounds ProjectionEmitter::Bounds(const LightMaps& maps) const {
  LightBounds bounds = BoundsAt(*this, maps.projected[image].peak());
  LimitToCone(*this, {0, 0, 1}, cos_end, &bounds);
  return bounds;
}
double ProjectionEmitter::Power(const LightMaps& maps, double) const {
  return maps.projected[image].Power() * LuminanceOf(emission.rgb);
}

}  // namespace sheaf::render
