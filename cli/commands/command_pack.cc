// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// sheaf pack: makes the page file of a volume, which renders in bounded memory.
#include <cstdio>
#include <nlohmann/json.hpp>
#include <string>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "cli/commands/command.h"
#include "cli/commands/options.h"
#include "cli/message.h"
#include "common/base/memory_room.h"
#include "common/base/printable.h"
#include "common/volume/page_maker.h"

namespace sheaf::cli {
namespace {

using Json = nlohmann::ordered_json;

class PackCommand : public Command {
 public:
  CLI::App* AddTo(CLI::App* app) override {
    CLI::App* command =
        app->add_subcommand("pack", "Make a page file of a volume, to render it in bounded memory");
    command->add_option("VOLUME", volume_, "Volume file (.vdb, .nvdb)")->required();
    command->add_option("-o,--output", output_, "Page file to write; scenes name it as a volume")
        ->required();
    AddJsonFlag(command, &json_);
    command->footer(
        "The page file holds all grids of numbers, to the bit; grids of vectors are left out. It\n"
        "is read page by page: sheaf render and sheaf-worker keep up to --volume-memory-max of it\n"
        "in memory. A .nvdb file without compression is packed page by page, too; the grids of\n"
        "other files are in memory, one at a time, while they are packed.\n\n"
        "Examples:\n"
        "  sheaf pack cloud.vdb -o cloud.pages\n"
        "  sheaf render cloud.pbrt --volume-memory-max 2G   # \"string filename\" \"cloud.pages\"");
    return command;
  }

  ExitCode Run() override {
    const absl::StatusOr<PageFileSummary> made = MakePageFile(volume_, volume_, output_);
    if (!made.ok()) return ReportSceneError(made.status());
    if (!made->left_out.empty()) {
      PrintNote(absl::StrCat(volume_, ": left out grids that are not numbers: ",
                             Printable(absl::StrJoin(made->left_out, ", "))));
    }
    if (json_) {
      const Json object = {{"file", output_},
                           {"grids", made->grids},
                           {"left_out", made->left_out},
                           {"grid_bytes", made->image_bytes},
                           {"file_bytes", made->file_bytes}};
      std::printf("%s\n", object.dump(-1, ' ', false, Json::error_handler_t::replace).c_str());
    } else {
      std::printf("%s: %s of grids in %s: %s\n", output_.c_str(),
                  FormatMemory(made->image_bytes).c_str(), FormatMemory(made->file_bytes).c_str(),
                  Printable(absl::StrJoin(made->grids, ", ")).c_str());
    }
    return ExitCode::kOk;
  }

 private:
  std::string volume_, output_;
  bool json_ = false;
};

}  // namespace

std::unique_ptr<Command> MakePackCommand() { return std::make_unique<PackCommand>(); }

}  // namespace sheaf::cli
