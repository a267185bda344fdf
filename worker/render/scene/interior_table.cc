// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "worker/render/scene/interior_table.h"

#include <array>
#include <string>
#include <tuple>
#include <variant>

#include "absl/strings/str_cat.h"
#include "common/scene/spectrum/spectrum.h"
#include "worker/render/bsdf/energy_table.h"
#include "worker/render/geometry/surface_point.h"

namespace sheaf::render {
namespace {

RefractiveIndex IndexOfMaterial(const MaterialDescription& material) {
  if (const auto* glass = std::get_if<DielectricMaterial>(&material.material)) return glass->eta;
  if (const auto* skin = std::get_if<SubsurfaceMaterial>(&material.material)) return skin->eta;
  return {1, {}};
}

// The sort key of ranks. Interiors with the same key are the same.
using Key = std::tuple<int32_t, float, std::string, std::vector<float>, int32_t>;

template <typename Function>
void ForEachSurface(SceneGeometry* geometry, const Function& function) {
  for (GeometryGroup& group : geometry->groups) {
    for (BakedMesh& mesh : group.meshes) function(&mesh.surface);
    for (BakedQuadric& quadric : group.quadrics) function(&quadric.surface);
    for (BakedPatches& patches : group.patches) function(&patches.surface);
    for (BakedCurves& curves : group.curves) function(&curves.surface);
  }
}

// Returns the ranks of the interiors that contain a point, as found along d.
MediumSet InteriorsAlong(const SceneGeometry& geometry, const EmbreeScene& tracer, Vec3f o,
                         Vec3f d) {
  constexpr int kBoundariesMax = 1024;
  MediumSet entered, inside;
  Ray ray;
  ray.o = o;
  ray.d = d;
  ray.mask = BitOf(RayKind::kCamera);
  for (int i = 0; i < kBoundariesMax; ++i) {
    RawHit hit;
    if (!tracer.Intersect(ray, &hit)) break;
    const SurfacePoint point = MakeSurfacePoint<kAllTraits>(geometry, ray, hit);
    const uint16_t rank = point.surface->rank;
    const bool is_seen = (point.surface->invisible & BitOf(RayKind::kCamera)) == 0;
    if (rank != kNoRank && is_seen) {
      const bool enters = Dot(d, point.ng) < 0;
      if (enters ? !entered.Add(rank) : (!entered.Remove(rank) && !inside.Add(rank))) break;
    }
    Leave(point, d, &ray);
  }
  return inside;
}

}  // namespace

absl::StatusOr<std::unique_ptr<InteriorTable>> InteriorTable::Build(
    const SceneDescription& scene, const MediumTable* media, const MaterialTable& materials,
    bool spectral, bool single_scattering, SceneGeometry* geometry) {
  const auto priority_of = [&scene](const Surface& surface) {
    return surface.material == kNone
               ? std::optional<int32_t>()
               : scene.materials[static_cast<size_t>(surface.material)].priority;
  };
  const auto key_of = [&](const Surface& surface) {
    const auto& material = scene.materials[static_cast<size_t>(surface.material)];
    const RefractiveIndex eta = IndexOfMaterial(material);
    const int32_t medium = scene.shapes[static_cast<size_t>(surface.shape)].media.inside;
    return Key{*material.priority, eta.mean, eta.spectrum.name, eta.spectrum.values,
               media == nullptr || medium == kNone ? kNone : media->IndexOf(medium)};
  };
  auto table = std::make_unique<InteriorTable>();
  std::map<Key, const Surface*> kinds;
  absl::Status status;
  ForEachSurface(geometry, [&](Surface* surface) {
    if (!priority_of(*surface).has_value()) return;
    kinds.emplace(key_of(*surface), surface);
    const ShapeDescription& shape = scene.shapes[static_cast<size_t>(surface->shape)];
    if (std::holds_alternative<CurveShape>(shape.shape) && status.ok()) {
      status = absl::InvalidArgumentError(
          absl::StrCat(FormatLocation(scene, shape.location),
                       ": curves have no inside, but the material has a \"priority\"; remove it"));
    }
  });
  if (!status.ok()) return status;
  if (kinds.size() >= kNoRank) {
    return absl::ResourceExhaustedError(
        absl::StrCat("the scene has ", kinds.size(),
                     " kinds of interior with a priority, more than the limit of ", kNoRank - 1));
  }
  std::map<Key, uint16_t> ranks;
  for (const auto& [key, surface] : kinds) {
    ranks[key] = static_cast<uint16_t>(table->interiors_.size());
    const auto& material = scene.materials[static_cast<size_t>(surface->material)];
    const RefractiveIndex eta = IndexOfMaterial(material);
    Interior interior;
    interior.eta = eta.mean;
    interior.disperses = spectral && eta.Disperses();
    if (interior.disperses) {
      interior.index =
          SpectralColor::Tabulate([&](double nm) { return IndexAt(eta.spectrum, nm); });
    }
    interior.medium = std::get<4>(key);
    table->interiors_.push_back(std::move(interior));
  }
  ForEachSurface(geometry, [&](Surface* surface) {
    if (priority_of(*surface).has_value()) surface->rank = ranks[key_of(*surface)];
  });
  if (!single_scattering) table->MakeRows(scene, materials);
  return table;
}

void InteriorTable::MakeRows(const SceneDescription& scene, const MaterialTable& materials) {
  std::map<std::tuple<float, float, float>, DielectricEnergyRow> known;
  for (size_t i = 0; i < scene.materials.size(); ++i) {
    const MaterialDescription& material = scene.materials[i];
    if (!material.priority.has_value() ||
        std::holds_alternative<InterfaceMaterial>(material.material)) {
      continue;
    }
    const auto index = static_cast<int32_t>(i);
    const Bsdf bsdf = materials.Evaluate<kAllTraits>(index, {}, 0);
    const Ggx ggx{bsdf.alpha_x, bsdf.alpha_y};
    if (ggx.IsSmooth()) continue;
    for (size_t other = 0; other < interiors_.size(); ++other) {
      const float eta = IndexOfMaterial(material).mean / interiors_[other].eta;
      if (eta == 1) continue;
      const auto [row, is_new] = known.try_emplace({ggx.alpha_x, ggx.alpha_y, eta});
      if (is_new) row->second = MakeDielectricEnergyRow(ggx, eta);
      rows_.emplace(std::pair(index, static_cast<uint16_t>(other)), row->second);
    }
  }
}

void InteriorTable::FindEnclosing(const SceneGeometry& geometry, const EmbreeScene& tracer,
                                  Vec3f camera_o) {
  // No two of them pass through the same edge of a right-angled body.
  constexpr std::array<Vec3f, 3> kDirections{
      {{0.267f, 0.845f, 0.463f}, {-0.813f, 0.229f, 0.535f}, {0.371f, -0.557f, -0.743f}}};
  std::array<MediumSet, 3> found;
  for (size_t i = 0; i < found.size(); ++i) {
    found[i] = InteriorsAlong(geometry, tracer, camera_o, kDirections[i]);
  }
  camera_interiors_ = found[1] == found[2] ? found[1] : found[0];
}

}  // namespace sheaf::render
