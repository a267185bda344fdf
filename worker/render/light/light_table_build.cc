// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// SceneDescription > LightTable: combines the emitters of the geometry with the lights of the scene
// file, and computes their bounds for light selection.
#include <algorithm>
#include <memory>
#include <set>
#include <utility>
#include <variant>

#include "common/base/check.h"
#include "common/base/load_phases.h"
#include "common/base/vector_bytes.h"
#include "worker/render/light/light_reader.h"
#include "worker/render/light/light_table.h"
#include "worker/render/light/light_table_impl.h"

namespace sheaf::render {
namespace {

LightBounds BoundsOfLight(const LightTable::Impl& impl, uint32_t light) {
  return impl.Visit(light, [&](const auto& kind) { return kind.Bounds(impl.light_maps); });
}

std::vector<LightBounds> AllBounds(const LightTable::Impl& impl) {
  std::vector<LightBounds> bounds(impl.light_count());
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
  uint64_t bytes =
      VectorBytes(impl.triangles, impl.spheres, impl.disks, impl.detail_of, impl.details,
                  impl.quadrics, impl.deltas, impl.light_maps.intensities,
                  impl.light_maps.projected, impl.infinites, impl.spectra) +
      impl.choice.memory_bytes();
  // Shapes with the same image share its map.
  std::set<const void*> images;
  for (const auto& map : impl.maps) {
    if (map != nullptr && images.insert(map->image_identity()).second) bytes += map->memory_bytes();
  }
  for (const IntensityDistribution& intensity : impl.light_maps.intensities) {
    if (const auto* map = std::get_if<IntensityMap>(&intensity)) bytes += map->memory_bytes();
  }
  for (const ProjectedImage& image : impl.light_maps.projected) bytes += image.memory_bytes();
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

uint32_t LightTable::light_count() const { return impl_->light_count(); }
LightBounds LightTable::BoundsOf(uint32_t light) const { return BoundsOfLight(*impl_, light); }

int32_t LightTable::DescriptionOf(uint32_t light) const {
  return impl_->Visit(light, [](const auto& kind) {
    if constexpr (requires { kind.description; }) {
      return kind.description;
    } else {
      return int32_t{kNone};
    }
  });
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
  group_of_light.reserve(impl_->light_count());
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
  for (uint32_t light = impl_->first_delta(); light < impl_->light_count(); ++light) {
    group_of_light.push_back(of_light[static_cast<size_t>(DescriptionOf(light))]);
  }
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
