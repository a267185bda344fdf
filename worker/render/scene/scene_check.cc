// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "worker/render/scene/scene_check.h"

#include <algorithm>
#include <filesystem>
#include <memory>
#include <string>
#include <system_error>
#include <utility>
#include <variant>
#include <vector>

#include "absl/status/statusor.h"
#include "common/base/log_silence.h"
#include "worker/render/camera/camera.h"
#include "worker/render/light/light_table.h"
#include "worker/render/material/material.h"
#include "worker/render/medium/medium.h"
#include "worker/render/medium/medium_velocities.h"
#include "worker/render/plan/render_plan.h"
#include "worker/render/sampling/filter.h"
#include "worker/render/scene/interior_table.h"
#include "worker/render/scene/scene_baker.h"

namespace sheaf::render {
namespace {

constexpr uint64_t kTextureCacheBytes = uint64_t{16} << 20;

const std::string* FileOf(const LightDescription& light) {
  return std::visit(
      [](const auto& kind) -> const std::string* {
        if constexpr (requires { kind.file; }) return &kind.file;
        return nullptr;
      },
      light.light);
}

bool IsLarge(const std::string& file, FileSource& files) {
  if (file.empty()) return false;
  const absl::StatusOr<std::string> path = files.LocalPath(file);
  if (!path.ok()) return false;  // Reading it says so.
  std::error_code error;
  const uint64_t bytes = std::filesystem::file_size(*path, error);
  return !error && bytes > kCheckedImageBytesMax;
}

void LeaveOutFiles(SceneDescription* scene, FileSource& files) {
  std::erase_if(scene->lights, [&](const LightDescription& light) {
    const std::string* file = FileOf(light);
    return file != nullptr && IsLarge(*file, files);
  });
  for (AreaLightDescription& light : scene->area_lights) {
    if (IsLarge(light.file, files)) light.file.clear();
  }
  for (MediumDescription& medium : scene->media) {
    if (std::holds_alternative<VolumeFileMedium>(medium.kind)) medium.kind = HomogeneousMedium{};
  }
}

absl::Status CheckTables(const SceneDescription& scene, const FrameSettings& settings,
                         FileSource& files, MediumVelocities velocities, BakedScene baked) {
  const RenderPlan plan = MakeRenderPlan(scene, settings);
  const bool spectral = Has(plan.traits, Trait::kSpectral);
  const auto materials = MaterialTable::Build(
      scene, files, {kTextureCacheBytes, spectral, settings.single_scattering});
  if (!materials.ok()) return materials.status();
  baked.emitters.spectral = spectral;
  baked.emitters.splits = Has(plan.traits, Trait::kLightSplits);
  const auto lights = LightTable::Build(scene, std::move(baked.emitters), files);
  if (!lights.ok()) return lights.status();
  std::unique_ptr<const MediumTable> media;
  if ((plan.traits & kInsides) != 0) {
    auto built = MediumTable::Build(scene, baked.geometry, std::move(velocities), files,
                                    {spectral, /*thread_count=*/1, /*bound_once=*/true});
    if (!built.ok()) return built.status();
    media = *std::move(built);
  }
  if (!Has(plan.traits, Trait::kNestedDielectrics)) return absl::OkStatus();
  return InteriorTable::Build(scene, media.get(), **materials, spectral, settings.single_scattering,
                              &baked.geometry)
      .status();
}

}  // namespace

absl::Status CheckScene(SceneDescription scene, const FrameSettings& settings, FileSource& files) {
  const LogSilence silence;
  LeaveOutFiles(&scene, files);
  absl::StatusOr<MediumVelocities> velocities = ReadMediumVelocities(files, 1, &scene);
  if (!velocities.ok()) return velocities.status();
  absl::StatusOr<EmissionMaps> maps = ReadEmissionMaps(scene, files);
  if (!maps.ok()) return maps.status();
  absl::StatusOr<BakedScene> baked = BakeScene(&scene, *std::move(maps));
  if (!baked.ok()) return baked.status();
  const absl::StatusOr<Camera> camera = Camera::Make(scene, settings.width_px, settings.height_px,
                                                     baked->geometry.render_origin_world, &files);
  if (!camera.ok()) return camera.status();
  if (const auto filter = PixelFilter::Make(scene); !filter.ok()) return filter.status();
  return CheckTables(scene, settings, files, *std::move(velocities), *std::move(baked));
}

}  // namespace sheaf::render
