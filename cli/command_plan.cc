// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// sheaf plan: which effects a scene calls for, who asked, and which compiled variant serves them;
// and on request what each costs and gives.
#include <cstdio>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>

#include "cli/command.h"
#include "cli/options.h"
#include "common/base/status.h"
#include "common/scene/file_source.h"
#include "common/scene/scene_reader.h"
#include "worker/render/plan_measurement.h"
#include "worker/render/render_plan.h"

namespace sheaf::cli {
namespace {

class PlanCommand : public Command {
 public:
  CLI::App* AddTo(CLI::App* app) override {
    CLI::App* command =
        app->add_subcommand("plan", "Say which effects a scene calls for, and what will run");
    AddSettingsOptions(command, &arguments_);
    AddJsonFlag(command, &json_);
    command->add_flag("--measure", measure_,
                      "Render with and without each effect: what it costs, what the picture loses");
    command
        ->add_option("--measure-seconds", measure_seconds_,
                     "How long to measure; more seconds, less noise")
        ->check(CLI::Range(render::kMeasureSecondsMin, render::kMeasureSecondsMax))
        ->capture_default_str();
    command->footer(
        "Examples:\n  sheaf plan room.pbrt\n  sheaf plan room.pbrt --json\n"
        "  sheaf plan room.pbrt --measure --measure-seconds 60");
    return command;
  }

  ExitCode Run() override {
    const std::filesystem::path path(arguments_.scene);
    const std::string directory = path.parent_path().string();
    DirectoryFileSource files(directory.empty() ? "." : directory);
    const absl::StatusOr<ReadSceneResult> read = ReadScene(path.filename().string(), files);
    if (!read.ok()) return ReportSceneError(read.status());
    for (const SceneDiagnostic& diagnostic : read->diagnostics) {
      std::fprintf(stderr, "%s\n", diagnostic.text.c_str());
    }
    const absl::StatusOr<FrameSettings> settings =
        ResolveSettings(read->scene, arguments_.settings);
    if (!settings.ok()) {
      return ReportError(ExitCode::kUsage, Annotate(settings.status(), arguments_.scene));
    }
    const render::RenderPlan plan = render::MakeRenderPlan(read->scene, *settings);
    std::optional<render::PlanMeasurement> measurement;
    if (measure_) {
      absl::StatusOr<render::PlanMeasurement> measured =
          render::MeasurePlan(read->scene, *settings, files, measure_seconds_);
      if (!measured.ok()) return ReportSceneError(measured.status());
      measurement = *std::move(measured);
    }
    if (json_) {
      PrintJson(plan, measurement);
    } else {
      std::fputs(render::FormatRenderPlan(plan).c_str(), stdout);
      if (measurement) {
        std::printf("\n%s", render::FormatPlanMeasurement(*measurement).c_str());
      }
    }
    return ExitCode::kOk;
  }

 private:
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
                                 {"without", effect.without},
                                 {"samples", effect.samples},
                                 {"time_share", effect.TimeShare()},
                                 {"time_ratio", effect.time_ratio.value},
                                 {"time_ratio_error", effect.time_ratio.error},
                                 {"variance_ratio", effect.variance_ratio},
                                 {"mean_change", effect.mean_change.value},
                                 {"mean_change_error", effect.mean_change.error},
                                 {"rel_mse", effect.rel_mse}});
    }
    return json;
  }

  static void PrintJson(const render::RenderPlan& plan,
                        const std::optional<render::PlanMeasurement>& measurement) {
    nlohmann::ordered_json json = {{"variant", plan.variant_name},
                                   {"traits", plan.traits},
                                   {"variant_traits", plan.variant_traits},
                                   {"light_count", plan.light_count},
                                   {"max_depth", plan.max_depth},
                                   {"effects", nlohmann::ordered_json::array()},
                                   {"unused", plan.unused},
                                   {"notes", plan.notes}};
    for (const render::PlannedEffect& effect : plan.effects) {
      json["effects"].push_back({{"name", effect.name}, {"cause", effect.cause}});
      if (effect.expected_time_ratio > 0) {
        json["effects"].back()["expected_time_ratio"] = effect.expected_time_ratio;
      }
    }
    if (measurement) json["measurement"] = MeasurementJson(*measurement);
    std::printf("%s\n",
                json.dump(-1, ' ', false, nlohmann::json::error_handler_t::replace).c_str());
  }

  JobArguments arguments_;
  bool json_ = false;
  bool measure_ = false;
  double measure_seconds_ = 20;
};

}  // namespace

std::unique_ptr<Command> MakePlanCommand() { return std::make_unique<PlanCommand>(); }

}  // namespace sheaf::cli
