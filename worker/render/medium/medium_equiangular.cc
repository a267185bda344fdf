// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Selects the heterogeneous media through which rays gather light, and the part of a ray in them.
// The selection excludes dense media that are lit from outside, which saves a test per segment; in
// the other media the decision is made per segment (DistanceSamplingSpread).
#include <algorithm>
#include <cmath>

#include "worker/render/medium/medium.h"

namespace sheaf::render {
namespace {

// Optical thickness across a box up to which most rays through it are thin.
constexpr double kThickness = 2;

// Approximate distance of the light from the box; 0 where they overlap.
double DistanceTo(const HeterogeneousMedium& medium, const LightBounds& light) {
  const IndexBox& box = medium.majorants().box();
  const Vec3d center = ToDouble(light.center);
  const Vec3d at = Inverse(medium.render_from_index()).Point(center);
  Vec3d nearest;
  for (size_t a = 0; a < 3; ++a) nearest[a] = std::min(std::max(at[a], box.lo[a]), box.hi[a]);
  const double distance = Length(medium.render_from_index().Point(nearest) - center);
  return std::max(0.0, distance - static_cast<double>(light.radius));
}

// Whether gathering may pay off: the box is thin, or the light is within a mean free path of it.
bool MayPay(const HeterogeneousMedium& medium, double extinction, const LightTable& lights) {
  const IndexBox& box = medium.majorants().box();
  const double across = Length(medium.render_from_index().Vector(box.hi - box.lo));
  for (uint32_t light = 0; light < lights.light_count(); ++light) {
    const LightBounds bounds = lights.BoundsOf(light);
    if (bounds.kind == LightBounds::Kind::kInfinite || !(bounds.strength > 0)) continue;
    if (extinction * across < kThickness || DistanceTo(medium, bounds) * extinction < 1)
      return true;
  }
  return false;
}

}  // namespace

void MediumTable::ChooseEquiangular(const LightTable& lights, EquiangularMode mode) {
  gathers_always_ = mode == EquiangularMode::kAlways;
  if (mode == EquiangularMode::kNever) return;
  for (uint16_t index = 0; index < media_.size(); ++index) {
    Medium& medium = media_[index];
    bool scatters = false;
    for (uint16_t i = 0; i < medium.parts.size(); ++i) {
      const auto its = CoefficientsOf<Rgb>({index, i}, NoWavelengths{}, MediumForm::kTrue);
      const double mean = medium.parts[i].density.MeanDensity();
      medium.extinction +=
          mean * static_cast<double>(its.sigma_t.r + its.sigma_t.g + its.sigma_t.b) / 3;
      scatters = scatters || (!its.sigma_s.IsBlack() && mean > 0);
    }
    if (!scatters) continue;
    medium.gathers = gathers_always_ ||
                     std::any_of(medium.parts.begin(), medium.parts.end(), [&](const Part& part) {
                       return MayPay(part.density, medium.extinction, lights);
                     });
  }
}

MediumTable::EquiangularSpan MediumTable::EquiangularSpanOf(const MediumSet& media, Vec3d o,
                                                            Vec3d d, double length) const {
  EquiangularSpan hull;
  for (const uint16_t medium : media) {
    if (!Gathers(medium)) continue;
    hull.extinction += media_[medium].extinction;
    for (const Part& part : media_[medium].parts) {
      double begin = 0, end = length;
      if (!part.density.ClipToBox(o, d, &begin, &end)) continue;
      const bool is_first = hull.begin == hull.end;
      hull.begin = is_first ? begin : std::min(hull.begin, begin);
      hull.end = is_first ? end : std::max(hull.end, end);
    }
  }
  return hull;
}

}  // namespace sheaf::render
