// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// The emission of a MediumTable's media, as sources of light: of heterogeneous media by their
// densities, of homogeneous ones by the bodies that they fill.
#include <cstdint>
#include <vector>

#include "worker/render/geometry/bounds.h"
#include "worker/render/geometry/deforming_mesh.h"
#include "worker/render/medium/medium.h"

namespace sheaf::render {
namespace {

// Bodies of one medium that have boxes of their own; more share one. Every line is intersected with
// each.
constexpr size_t kBodiesMax = 64;

void AddBox(const Bounds& box, const Affine& transform, Bounds* bounds) {
  const Vec3d lower = box.lower(), upper = box.upper();
  for (int corner = 0; corner < 8; ++corner) {
    bounds->Add(transform.Point({corner & 1 ? upper.x : lower.x, corner & 2 ? upper.y : lower.y,
                                 corner & 4 ? upper.z : lower.z}));
  }
}

bool MayBound(const Surface& surface, int32_t medium) {
  return surface.media.Separates() &&
         (surface.media.inside == medium || surface.media.outside == medium);
}

// The boxes, in the group's space, of its surfaces that bound the medium.
std::vector<Bounds> BoxesIn(const GeometryGroup& group, int32_t medium) {
  std::vector<Bounds> boxes;
  for (const BakedMesh& mesh : group.meshes) {
    if (!MayBound(mesh.surface, medium)) continue;
    Bounds& box = boxes.emplace_back();
    for (size_t step = 0; step <= mesh.steps.size(); ++step) {
      const std::vector<Vec3f>& positions = PositionsOfStep(mesh, step);
      for (const uint32_t i : mesh.indices) box.Add(ToDouble(positions[i]));
    }
  }
  for (const BakedQuadric& quadric : group.quadrics) {
    if (!MayBound(quadric.surface, medium)) continue;
    Bounds& box = boxes.emplace_back();
    for (const Vec3f& corner : QuadricBounds(quadric.quadric)) box.Add(ToDouble(corner));
  }
  return boxes;
}

// Boxes of render space, over the whole shutter interval, that together contain a medium which only
// closed surfaces bound.
std::vector<Bounds> BodiesOf(const SceneGeometry& geometry, int32_t medium) {
  std::vector<Bounds> bodies = BoxesIn(geometry.groups[0], medium);
  for (const PlacedGroup& placed : geometry.still) {
    for (const Bounds& box : BoxesIn(geometry.groups[placed.group], medium)) {
      AddBox(box, placed.render_from_group, &bodies.emplace_back());
    }
  }
  for (const PlacedGroup& placed : geometry.moving) {
    if (BoxesIn(geometry.groups[placed.group], medium).empty()) continue;
    Bounds& body = bodies.emplace_back();
    for (uint32_t step = 0; step < kMotionStepCount; ++step) {
      const PlacedBounds box = BoundsOfMoving(geometry, placed, step);
      body.Add(ToDouble(box.lower));
      body.Add(ToDouble(box.upper));
    }
  }
  if (bodies.size() <= kBodiesMax) return bodies;
  Bounds all;
  for (const Bounds& body : bodies) {
    all.Add(body.lower());
    all.Add(body.upper());
  }
  return {all};
}

}  // namespace

std::vector<EmissiveDensity> MediumTable::EmissiveDensities() const {
  std::vector<EmissiveDensity> sources;
  for (uint16_t medium = 0; medium < media_.size(); ++medium) {
    for (uint16_t part = 0; part < media_[medium].parts.size(); ++part) {
      const MediumEmission* medium_emission = MediumEmissionOf({medium, part});
      if (medium_emission == nullptr) continue;
      sources.push_back(
          {&DensityOf({medium, part}), medium_emission,
           CoefficientsOf<Rgb>({medium, part}, NoWavelengths{}, MediumForm::kTrue).sigma_a});
    }
  }
  return sources;
}

EmissionPoints MediumTable::MakeEmissionPoints(const SceneGeometry& geometry) const {
  std::vector<EmissionPoints::Body> bodies;
  for (size_t i = 0; i < index_of_.size(); ++i) {
    const Medium& medium = media_[index_of_[i]];
    if (!medium.emits || !medium.IsBody()) continue;
    const auto emission = static_cast<double>(Luminance(medium.radiance * medium.sigma_a));
    const auto extinction = static_cast<double>(Luminance(medium.sigma_a + medium.sigma_s));
    for (const Bounds& body : BodiesOf(geometry, static_cast<int32_t>(i))) {
      if (!body.empty()) bodies.push_back({body.lower(), body.upper(), emission, extinction});
    }
  }
  return EmissionPoints(EmissiveDensities(), bodies);
}

}  // namespace sheaf::render
