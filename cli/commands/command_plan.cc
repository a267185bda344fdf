// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// sheaf plan: prints which effects a scene needs, which statements need them, and which compiled
// variant renders it; on request also the cost and the gain of each effect, and what loading takes.
#include <cstdio>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "cli/commands/command.h"
#include "cli/commands/first_image.h"
#include "cli/commands/options.h"
#include "cli/interruption.h"
#include "cli/job/camera_paths_check.h"
#include "cli/job/input_check.h"
#include "cli/job/opened_scene.h"
#include "cli/job/volume_extents.h"
#include "cli/profile/load_report.h"
#include "cli/profile/memory_account.h"
#include "common/base/printable.h"
#include "common/command_line/command_line.h"
#include "common/scene/settings/path_shares.h"
#include "common/scene/settings/ray_visibility_check.h"
#include "worker/render/ablation/plan_measurement.h"
#include "worker/render/ablation/technique_choices.h"
#include "worker/render/ablation/technique_measurement.h"
#include "worker/render/medium/file_emission.h"
#include "worker/render/plan/render_plan.h"
#include "worker/render/scene/memory_estimate.h"
#include "worker/render/scene/scene_check.h"

namespace sheaf::cli {
namespace {

class PlanCommand : public Command {
 public:
  CLI::App* AddTo(CLI::App* app) override {
    CLI::App* command = app->add_subcommand(
        "plan", "Show which effects a scene uses, and which variant renders it");
    AddSettingsOptions(command, &arguments_);
    AddJsonFlag(command, &json_);
    command->add_flag(
        "--measure", measure_,
        "Render with and without each effect to measure its cost and its influence on the image");
    command
        ->add_option("--measure-seconds", measure_seconds_,
                     "Seconds to measure; more seconds give less noise")
        ->check(InRange(render::kMeasureSecondsMin, render::kMeasureSecondsMax))
        ->capture_default_str();
    command->add_flag("--timings", timings_,
                      "Render one sample a pixel as sheaf render does, and show the time of each "
                      "phase of loading");
    command->add_flag("--memory", memory_,
                      "Render one sample a pixel as sheaf render does, and show what the process' "
                      "memory holds");
    command->footer(
        "Examples:\n  sheaf plan room.pbrt\n  sheaf plan room.pbrt --json\n"
        "  sheaf plan room.pbrt --measure --measure-seconds 60\n"
        "  sheaf plan room.pbrt --timings --memory");
    return command;
  }

  ExitCode Run() override {
    const Interruption interruption;
    std::optional<FirstImage> first;
    if (timings_ || memory_) {  // Before anything of the scene is read.
      const ExitCode code = RenderFirstImage(arguments_, memory_, interruption, &first.emplace());
      if (code != ExitCode::kOk) return code;
    }
    OpenedScene opened;
    if (const ExitCode code = OpenScene(arguments_, &opened); code != ExitCode::kOk) return code;
    SceneDescription& scene = opened.file.read.scene;
    VolumeReader reader;
    render::ResolveFileEmission(*opened.file.files, &scene, &reader);
    const render::RenderPlan plan = render::MakeRenderPlan(scene, opened.settings);
    std::optional<render::PlanMeasurement> measurement;
    std::optional<render::TechniqueMeasurement> techniques;
    if (measure_ && HasOneTile(opened.settings)) {
      return ReportError(
          ExitCode::kUsage,
          absl::InvalidArgumentError("--measure knows paths of one pixel; remove --stereo, and "
                                     "+sharing or +mutations of --techniques"));
    }
    if (measure_ && HasChains(opened.settings.techniques)) {
      return ReportError(ExitCode::kUsage,
                         absl::InvalidArgumentError("--measure knows no chains; remove +chains of "
                                                    "--techniques"));
    }
    if (measure_) {
      if (FirstInvisible(scene) == nullptr) {
        absl::StatusOr<render::TechniqueMeasurement> compared = render::MeasureTechniques(
            scene, opened.settings, *opened.file.files, render::TechniqueEffort::kAsked);
        if (!compared.ok()) return ReportSceneError(compared.status());
        techniques = *std::move(compared);
      }
      if (absl::Status status = CheckCameraPaths("measurements of effects", scene, opened.settings);
          !status.ok()) {
        return ReportError(ExitCode::kUsage, status);
      }
      absl::StatusOr<render::PlanMeasurement> measured =
          render::MeasurePlan(scene, opened.settings, *opened.file.files, measure_seconds_);
      if (!measured.ok()) return ReportSceneError(measured.status());
      measurement = *std::move(measured);
    }
    const render::MemoryEstimate memory = render::EstimateMemory(scene, *opened.file.files);
    const std::vector<VolumeExtent> volumes = VolumeExtents(scene, *opened.file.files, &reader);
    if (!measure_) {  // Which compiles the scene.
      absl::Status checked = CheckFiles(&scene, opened.settings, *opened.file.files, &reader);
      if (!checked.ok()) return ReportSceneError(checked);
    }
    if (json_) {
      nlohmann::ordered_json json =
          PlanJson(plan, opened.settings, arguments_.settings.measure_techniques, memory, volumes,
                   measurement, techniques);
      if (timings_) json["timings"] = LoadTimesJson(first->times);
      if (memory_) json["memory_account"] = MemoryAccountJson(first->memory);
      std::printf("%s\n",
                  json.dump(-1, ' ', false, nlohmann::json::error_handler_t::replace).c_str());
    } else {
      std::fputs(PrintableLines(render::FormatRenderPlan(plan)).c_str(), stdout);
      std::printf("memory: about %s\n", render::FormatMemoryEstimate(memory).c_str());
      for (const VolumeExtent& volume : volumes) {
        std::printf("volume: %s\n", Printable(FormatVolumeExtent(volume)).c_str());
      }
      const std::string note = render::PageFileNote(memory);
      if (!note.empty()) std::printf("note: %s\n", note.c_str());
      if (arguments_.settings.measure_techniques && !techniques) {
        std::printf("%s\n", render::FormatTechniqueChoices().c_str());
      }
      if (measurement) {
        std::printf("\n%s", PrintableLines(render::FormatPlanMeasurement(*measurement)).c_str());
        std::printf("%s\n", render::FormatTechniqueMeasurement(*techniques).c_str());
      }
      if (timings_) std::printf("\n%s", FormatLoadTimes(first->times).c_str());
      if (memory_) std::printf("\n%s", FormatMemoryAccount(first->memory).c_str());
    }
    return ExitCode::kOk;
  }

 private:
  // Finds what a worker would refuse. Takes the scene, whose copy may be large.
  static absl::Status CheckFiles(SceneDescription* scene, const FrameSettings& settings,
                                 FileSource& files, VolumeReader* reader) {
    absl::Status checked = InputChecks(reader).Check(*scene, files);
    if (checked.ok()) checked = render::CheckScene(std::move(*scene), settings, files);
    // Without its library no image can be read; this is not an error of the scene.
    return absl::IsFailedPrecondition(checked) ? absl::OkStatus() : checked;
  }

  static nlohmann::ordered_json MeasurementJson(const render::PlanMeasurement& measurement) {
    nlohmann::ordered_json json = {{"seconds", measurement.seconds},
                                   {"pixels", measurement.pixels},
                                   {"microseconds_per_sample", measurement.microseconds_per_sample},
                                   {"effects", nlohmann::ordered_json::array()}};
    for (const render::EffectMeasurement& effect : measurement.effects) {
      if (!effect.problem.empty()) {
        json["effects"].push_back({{"name", effect.name}, {"problem", effect.problem}});
        continue;
      }
      json["effects"].push_back({{"name", effect.name},
                                 {"ablation", effect.ablation},
                                 {"samples", effect.samples},
                                 {"time_fraction", effect.TimeFraction()},
                                 {"time_ratio", effect.time_ratio.value},
                                 {"time_ratio_error", effect.time_ratio.error},
                                 {"variance_ratio", effect.variance_ratio},
                                 {"mean_change", effect.mean_change.value},
                                 {"mean_change_error", effect.mean_change.error},
                                 {"relative_mse", effect.relative_mse}});
    }
    return json;
  }

  static nlohmann::ordered_json TechniquesJson(const render::TechniqueMeasurement& measured) {
    nlohmann::ordered_json gains, costs;
    for (const TechniqueSet techniques : measured.Measured()) {
      const render::TechniqueCost& cost = *measured.Find(techniques);
      costs[techniques.Name()] = {{"relative_mse", cost.relative_mse},
                                  {"cost_rays_per_sample", cost.cost_rays}};
      if (!(techniques == TechniqueSet::kCamera)) {
        gains[techniques.Name()] = measured.Gain(techniques);
      }
    }
    const TechniqueSet unsplit = measured.Best().Without(Technique::kSplitting);
    return {{"best", measured.Best().Name()},
            {"gain", measured.Gain(measured.Best())},
            {"least_gain", measured.LeastGain(unsplit)},
            {"gains", gains},
            {"light_share", measured.light_share},
            {"only_light_share", measured.only_light_share},
            {"missing_relative_mse", measured.missing_mse},
            {"unmerged_missing_relative_mse", measured.unmerged_missing_mse},
            {"merge_bias_relative_mse", measured.bias_mse},
            {"width_px", measured.width_px},
            {"height_px", measured.height_px},
            {"samples", measured.samples},
            {"costs", costs}};
  }

  // is_auto: the frame's techniques are those that a measurement chooses.
  static nlohmann::ordered_json PlanJson(
      const render::RenderPlan& plan, const FrameSettings& settings, bool is_auto,
      const render::MemoryEstimate& memory, const std::vector<VolumeExtent>& volumes,
      const std::optional<render::PlanMeasurement>& measurement,
      const std::optional<render::TechniqueMeasurement>& techniques) {
    nlohmann::ordered_json json = {{"variant", plan.variant_name},
                                   {"traits", plan.traits},
                                   {"variant_traits", plan.variant_traits},
                                   {"light_count", plan.light_count},
                                   {"max_depth", plan.max_depth},
                                   {"techniques", settings.techniques.Name()},
                                   {"techniques_are_measured", is_auto},
                                   {"memory_bytes", memory.TotalBytes()},
                                   {"triangle_count", memory.triangle_count},
                                   {"effects", nlohmann::ordered_json::array()},
                                   {"unused", plan.unused},
                                   {"notes", plan.notes}};
    for (const render::PlannedEffect& effect : plan.effects) {
      json["effects"].push_back({{"name", effect.name}, {"cause", effect.cause}});
      if (effect.expected_time_ratio > 0) {
        json["effects"].back()["expected_time_ratio"] = effect.expected_time_ratio;
      }
    }
    for (const VolumeExtent& volume : volumes) {
      const auto point = [](const Vec3d& p) { return nlohmann::json{p.x, p.y, p.z}; };
      json["volumes"].push_back({{"medium", volume.medium},
                                 {"file", volume.file},
                                 {"grid", volume.grid},
                                 {"active_voxel_count", volume.active_voxel_count}});
      if (volume.lo.x > volume.hi.x) continue;
      json["volumes"].back()["box_min"] = point(volume.lo);
      json["volumes"].back()["box_max"] = point(volume.hi);
    }
    if (measurement) json["measurement"] = MeasurementJson(*measurement);
    if (techniques) json["measurement"]["techniques"] = TechniquesJson(*techniques);
    return json;
  }

  JobArguments arguments_;
  bool json_ = false;
  bool measure_ = false;
  bool timings_ = false;
  bool memory_ = false;
  double measure_seconds_ = 20;
};

}  // namespace

std::unique_ptr<Command> MakePlanCommand() { return std::make_unique<PlanCommand>(); }

}  // namespace sheaf::cli
