// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// sheaf plan: which effects a scene calls for, who asked, and which compiled variant serves them.
#include <cstdio>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <string>

#include "cli/command.h"
#include "cli/options.h"
#include "common/base/status.h"
#include "common/scene/file_source.h"
#include "common/scene/scene_reader.h"
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
    command->footer("Examples:\n  sheaf plan room.pbrt\n  sheaf plan room.pbrt --json");
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
    if (json_) {
      PrintJson(plan);
    } else {
      std::fputs(render::FormatRenderPlan(plan).c_str(), stdout);
    }
    return ExitCode::kOk;
  }

 private:
  static void PrintJson(const render::RenderPlan& plan) {
    nlohmann::ordered_json json = {{"variant", plan.variant_name},
                                   {"traits", plan.traits},
                                   {"variant_traits", plan.variant_traits},
                                   {"light_count", plan.light_count},
                                   {"effects", nlohmann::ordered_json::array()},
                                   {"unused", plan.unused}};
    for (const render::PlannedEffect& effect : plan.effects) {
      json["effects"].push_back({{"name", effect.name}, {"cause", effect.cause}});
    }
    std::printf("%s\n",
                json.dump(-1, ' ', false, nlohmann::json::error_handler_t::replace).c_str());
  }

  JobArguments arguments_;
  bool json_ = false;
};

}  // namespace

std::unique_ptr<Command> MakePlanCommand() { return std::make_unique<PlanCommand>(); }

}  // namespace sheaf::cli
