// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// SceneDescription > LightTable: combines the emitters of the geometry with the lights of the scene
// file, and computes their bounds for light selection.
#include <algorithm>
#include <cmath>
#include <memory>
#include <set>
#include <utility>
#include <variant>

#include "common/base/check.h"
#include "common/base/load_phases.h"
#include "common/base/vector_bytes.h"
#include "common/math/elementary.h"
#include "worker/render/light/light_reader.h"
#include "worker/render/light/light_table.h"
#include "worker/render/light/light_table_impl.h"

namespace sheaf::render {
namespace {

// Relative tolerance within which a light's transform counts as a rotation with uniform scale, so
// that light selection can use the light's cone; and the slack that widens the cone's cosine for
// it.
constexpr float kSimilarityTolerance = 1e-5f, kConeSlack = 1e-4f;

// --- Bounds of emitters ------------------------------------------------------------------------

// Bounds of an emitter that is never chosen: no area, or values no sample may carry.
LightBounds NoLight() { return {.kind = LightBounds::Kind::kPlanar, .strength = 0}; }

LightBounds BoundsOf(const TriangleEmitter& t) {
  const Vec3d v0 = ToDouble(t.v0), e1 = ToDouble(t.v1) - v0, e2 = ToDouble(t.v2) - v0;
  const Vec3d normal = Cross(e1, e2);
  const double doubled_area = Length(normal);
  if (!(doubled_area > 0) || !std::isfinite(doubled_area)) return NoLight();
  const Vec3d center = v0 + (e1 + e2) / 3.0;
  const double radius =
      std::max({Length(v0 - center), Length(v0 + e1 - center), Length(v0 + e2 - center)});
  return {.kind = LightBounds::Kind::kPlanar,
          .two_sided = t.two_sided,
          .center = ToFloat(center),
          .normal = ToFloat(normal / doubled_area),
          .radius = static_cast<float>(radius),
          .area = static_cast<float>(0.5 * doubled_area),
          .strength = StrengthOf(t.radiance.rgb)};
}

LightBounds BoundsOf(const SphereEmitter& s) {
  const double area = kPi * s.radius * s.radius;
  if (!(s.radius > 0) || !std::isfinite(area) || !std::isfinite(LengthSquared(s.center))) {
    return NoLight();
  }
  return {.kind = LightBounds::Kind::kSphere,
          .center = ToFloat(s.center),
          .radius = static_cast<float>(s.radius),
          .area = static_cast<float>(area),
          .strength = StrengthOf(s.radiance.rgb)};
}

LightBounds BoundsOf(const DiskEmitter& d) {
  const double area = kPi * (d.radius - d.inner_radius) * (d.radius + d.inner_radius);
  if (!(area > 0) || !std::isfinite(area) || !std::isfinite(LengthSquared(d.center))) {
    return NoLight();
  }
  return {.kind = LightBounds::Kind::kPlanar,
          .two_sided = d.two_sided,
          .center = ToFloat(d.center),
          .normal = ToFloat(d.normal),
          .radius = static_cast<float>(d.radius),
          .area = static_cast<float>(area),
          .strength = StrengthOf(d.radiance.rgb)};
}

// Factor of the emission in the direction in which the light is brightest.
Rgb PeakOf(const LightTable::Impl& impl, const DeltaLight& light) {
  switch (light.kind) {
    case DeltaLight::Kind::kGoniometric:
      return Rgb::Gray(std::visit([](const auto& intensity) { return intensity.peak(); },
                                  impl.intensities[light.image]));
    case DeltaLight::Kind::kProjection:
      return impl.projected_images[light.image].peak();
    default:
      return Rgb::Gray(1);
  }
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

LightBounds BoundsOf(const LightTable::Impl& impl, const DeltaLight& light) {
  if (light.kind == DeltaLight::Kind::kDistant) {
    return {.kind = LightBounds::Kind::kInfinite, .strength = StrengthOf(light.emission.rgb)};
  }
  LightBounds bounds{.kind = LightBounds::Kind::kPoint,
                     .center = ToFloat(light.position),
                     .strength = StrengthOf(light.emission.rgb * PeakOf(impl, light))};
  const bool has_cone =
      light.kind == DeltaLight::Kind::kSpot || light.kind == DeltaLight::Kind::kProjection;
  if (has_cone && IsSimilarity(light.light_from_render)) {
    const Vec3f(&rows)[3] = light.light_from_render;
    bounds.normal =
        Normalize(light.axis.x * rows[0] + light.axis.y * rows[1] + light.axis.z * rows[2]);
    bounds.cos_end = light.cos_end - kConeSlack;
  }
  return bounds;
}

LightBounds BoundsOf(const InfiniteEmitter& light) {
  const float mean = light.map ? static_cast<float>(light.map->mean_luminance()) * light.scale
                               : StrengthOf(light.radiance.rgb);
  return {.kind = LightBounds::Kind::kInfinite,
          .strength = static_cast<float>(kPi) * std::fabs(mean)};
}

LightBounds BoundsOfLight(const LightTable::Impl& impl, uint32_t light) {
  if (light < impl.first_sphere()) return BoundsOf(impl.triangles[light]);
  if (light < impl.first_disk()) return BoundsOf(impl.spheres[light - impl.first_sphere()]);
  if (light < impl.first_delta()) return BoundsOf(impl.disks[light - impl.first_disk()]);
  if (light < impl.first_infinite()) return BoundsOf(impl, impl.deltas[light - impl.first_delta()]);
  return BoundsOf(impl.infinites[light - impl.first_infinite()]);
}

std::vector<LightBounds> AllBounds(const LightTable::Impl& impl) {
  std::vector<LightBounds> bounds(impl.first_infinite() + impl.infinites.size());
  for (uint32_t i = 0; i < bounds.size(); ++i) bounds[i] = BoundsOfLight(impl, i);
  return bounds;
}

// Bounds that give every light that emits the same weight.
LightBounds SameForAll(const LightBounds& light) {
  return {.kind = LightBounds::Kind::kInfinite, .strength = light.strength > 0 ? 1.0f : 0.0f};
}

}  // namespace

uint64_t LightTable::memory_bytes() const {
  const Impl& impl = *impl_;
  uint64_t bytes = VectorBytes(impl.triangles, impl.spheres, impl.disks, impl.detail_of,
                               impl.details, impl.quadrics, impl.deltas, impl.intensities,
                               impl.projected_images, impl.infinites, impl.spectra) +
                   impl.choice.memory_bytes();
  // Shapes with the same image share its map.
  std::set<const void*> images;
  for (const auto& map : impl.maps) {
    if (map != nullptr && images.insert(map->image_identity()).second) bytes += map->memory_bytes();
  }
  for (const IntensityDistribution& intensity : impl.intensities) {
    if (const auto* map = std::get_if<IntensityMap>(&intensity)) bytes += map->memory_bytes();
  }
  for (const ProjectedImage& image : impl.projected_images) bytes += image.memory_bytes();
  return bytes + environment_bytes();
}

uint64_t LightTable::environment_bytes() const {
  uint64_t bytes = 0;
  for (const InfiniteEmitter& light : impl_->infinites) {
    if (light.map) bytes += light.map->size_bytes();
    if (light.portal) bytes += light.portal->memory_bytes();
  }
  return bytes;
}

uint32_t LightTable::light_count() const {
  return impl_->first_infinite() + static_cast<uint32_t>(impl_->infinites.size());
}
LightBounds LightTable::BoundsOf(uint32_t light) const { return BoundsOfLight(*impl_, light); }

int32_t LightTable::DescriptionOf(uint32_t light) const {
  const size_t emitters = impl_->triangles.size() + impl_->spheres.size() + impl_->disks.size();
  if (light < emitters) return kNone;
  const size_t index = light - emitters, deltas = impl_->deltas.size();
  return index < deltas ? impl_->deltas[index].description
                        : impl_->infinites[index - deltas].description;
}

void LightTable::AssignGroups(const SceneDescription& scene,
                              const std::vector<std::string>& groups) {
  const auto index_of = [&groups](const std::string& name) {
    const auto at = std::lower_bound(groups.begin(), groups.end(), name);
    SHEAF_CHECK(at != groups.end() && *at == name);
    return static_cast<uint8_t>(at - groups.begin());
  };
  std::vector<uint8_t>& group_of_light = impl_->group_of_light;
  group_of_light.clear();
  group_of_light.reserve(impl_->first_infinite() + impl_->infinites.size());
  std::vector<uint8_t> of_area_light, of_light;
  for (const AreaLightDescription& l : scene.area_lights)
    of_area_light.push_back(index_of(l.group));
  for (const LightDescription& l : scene.lights) of_light.push_back(index_of(l.group));
  // An emitter's image or spectrum is that of its area light, under the same index.
  const auto add_emitters = [&](const auto& emitters) {
    for (const auto& emitter : emitters) {
      const auto id = static_cast<uint32_t>(group_of_light.size());
      const EmissionDetail* detail = impl_->DetailOf(id);
      const bool has_map = detail != nullptr && detail->map != kNone;
      const int32_t light = has_map ? detail->map : emitter.radiance.spectrum;
      group_of_light.push_back(of_area_light[static_cast<size_t>(light)]);
    }
  };
  add_emitters(impl_->triangles);
  add_emitters(impl_->spheres);
  add_emitters(impl_->disks);
  const auto add_lights = [&](const auto& lights) {
    for (const auto& light : lights) {
      group_of_light.push_back(of_light[static_cast<size_t>(light.description)]);
    }
  };
  add_lights(impl_->deltas);
  add_lights(impl_->infinites);
}

absl::StatusOr<std::unique_ptr<LightTable>> LightTable::Build(const SceneDescription& scene,
                                                              LightTableInput input,
                                                              FileSource& files) {
  const PhaseTimer timer(LoadPhase::kLights);
  std::unique_ptr<LightTable> table(new LightTable());
  table->impl_ = std::make_unique<Impl>();
  Impl& impl = *table->impl_;
  impl.triangles = std::move(input.triangles);
  impl.spheres = std::move(input.spheres);
  impl.disks = std::move(input.disks);
  impl.detail_of = std::move(input.detail_of);
  impl.details = std::move(input.details);
  impl.maps = std::move(input.maps);
  impl.quadrics = std::move(input.quadrics);
  if (input.spectral) {
    PrepareUpsampling();
    for (const AreaLightDescription& light : scene.area_lights) impl.AddSpectrum(light.radiance);
  }
  const absl::Status status =
      ReadLights(scene, input.render_origin_world, input.spectral, files, &impl);
  if (!status.ok()) return status;
  std::vector<LightBounds> bounds = AllBounds(impl);
  impl.empty = std::none_of(bounds.begin(), bounds.end(),
                            [](const LightBounds& light) { return light.strength > 0; });
  if (input.choose_evenly) {
    for (LightBounds& light : bounds) light = SameForAll(light);
  }
  impl.choice = LightChoice(std::move(bounds), input.splits);
  return table;
}

}  // namespace sheaf::render
