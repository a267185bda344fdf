// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "cli/commands/effect_costs.h"

#include <cmath>

#include "cli/job/frames/frame_range.h"
#include "cli/job/opened_scene.h"
#include "worker/render/ablation/plan_measurement.h"

namespace sheaf::cli {
namespace {

v1::EffectCost ToWire(const render::EffectMeasurement& effect) {
  v1::EffectCost wire;
  wire.set_name(effect.name);
  wire.set_problem(effect.problem);
  if (!effect.problem.empty()) return wire;
  const double ratio = effect.time_ratio.value;
  wire.set_ablation(effect.ablation);
  wire.set_time_fraction(effect.TimeFraction());
  wire.set_time_fraction_error(effect.time_ratio.error / (ratio * ratio));
  wire.set_mean_change(effect.mean_change.value);
  wire.set_mean_change_error(effect.mean_change.error);
  wire.set_relative_mse(effect.relative_mse);
  // 0: unknown, for example if there is no variance without the effect.
  wire.set_variance_ratio(std::isfinite(effect.variance_ratio) ? effect.variance_ratio : 0);
  return wire;
}

}  // namespace

absl::StatusOr<std::vector<v1::EffectCost>> MeasureEffects(const JobArguments& arguments,
                                                           double seconds) {
  const absl::StatusOr<std::vector<int32_t>> numbers = FrameNumbers(arguments);
  if (!numbers.ok()) return numbers.status();
  const int32_t number = numbers->front();
  const absl::StatusOr<FramePath> scene = ScenePath(arguments);
  if (!scene.ok()) return scene.status();
  GltfInputs gltf(arguments.gltf, arguments.size);
  const absl::StatusOr<SceneFile> file = ReadSceneFile(scene->Of(number), &gltf, number);
  if (!file.ok()) return file.status();
  const absl::StatusOr<FrameSettings> settings =
      ResolveSettings(file->read.scene, arguments.settings);
  if (!settings.ok()) return settings.status();
  const absl::StatusOr<render::PlanMeasurement> measured =
      render::MeasurePlan(file->read.scene, *settings, *file->files, seconds);
  if (!measured.ok()) return measured.status();
  std::vector<v1::EffectCost> costs;
  for (const render::EffectMeasurement& effect : measured->effects) {
    costs.push_back(ToWire(effect));
  }
  return costs;
}

}  // namespace sheaf::cli
