// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// sheaf view: shows a scene to another program, which moves the camera (view_server.h).
#include <cstdio>
#include <iostream>
#include <nlohmann/json.hpp>
#include <string>
#include <thread>
#include <vector>

#include "cli/commands/command.h"
#include "cli/commands/options.h"
#include "cli/message.h"
#include "cli/view/view_server.h"
#include "common/base/log.h"
#include "common/command_line/command_line.h"

namespace sheaf::cli {
namespace {

// Longer requests are refused: no camera has that many bytes.
constexpr size_t kRequestBytesMax = 1 << 20;

bool Print(const nlohmann::ordered_json& json, const std::vector<float>* pixels = nullptr) {
  const std::string line =
      json.dump(-1, ' ', false, nlohmann::json::error_handler_t::replace) + "\n";
  bool is_written = std::fwrite(line.data(), 1, line.size(), stdout) == line.size();
  if (pixels != nullptr) {
    is_written = is_written && std::fwrite(pixels->data(), sizeof(float), pixels->size(), stdout) ==
                                   pixels->size();
  }
  return is_written && std::fflush(stdout) == 0;
}

bool PrintFrame(const ViewFrame& frame) {
  const PixelRect& window = frame.window;
  return Print({{"id", frame.id},
                {"image",
                 {{"width", window.Width()},
                  {"height", window.Height()},
                  {"x0", window.x0 * frame.divisor},
                  {"y0", window.y0 * frame.divisor},
                  {"x1", window.x1 * frame.divisor},
                  {"y1", window.y1 * frame.divisor},
                  {"film_width", frame.film_width_px},
                  {"film_height", frame.film_height_px},
                  {"samples", frame.samples},
                  {"complete", frame.is_complete},
                  {"byte_count", frame.pixels.size() * sizeof(float)}}}},
               &frame.pixels);
}

bool PrintLoaded(int64_t id, const ViewedScene& scene, double seconds) {
  for (const std::string& note : scene.notes()) PrintSceneNote(note);
  return Print({{"id", id}, {"loaded", {{"seconds", seconds}}}});
}

bool PrintFailure(int64_t id, const absl::Status& status) {
  return Print({{"id", id}, {"error", std::string(status.message())}});
}

class ViewCommand : public Command {
 public:
  CLI::App* AddTo(CLI::App* app) override {
    CLI::App* command = app->add_subcommand(
        "view",
        "Show a scene to another program, such as Blender's viewport, which moves the "
        "camera");
    AddJsonFlag(command, &json_);
    command->add_option("--threads", threads_, "Threads; 0: all processors")
        ->check(InRange(0, 4096))
        ->capture_default_str();
    command->footer(
        "Reads requests from standard input, lines of JSON, and writes images to standard output\n"
        "(docs/viewing.md). It ends with its input.\n"
        "Example:\n"
        "  echo '{\"id\": 1, \"scene\": \"room.pbrt\"}' | sheaf view > answers");
    return command;
  }

  ExitCode Run() override {
    SetLogName("sheaf view");
    SetLogLevel(LogLevel::kError);  // Views are looked at while they change.
    const int threads = threads_ > 0 ? static_cast<int>(threads_)
                                     : static_cast<int>(std::thread::hardware_concurrency());
    ViewServer server({}, std::max(1, threads), {PrintFrame, PrintLoaded, PrintFailure});
    std::vector<char> line(kRequestBytesMax + 1);
    // Fails, but at the end of the input, where a line is longer.
    while (std::cin.getline(line.data(), static_cast<std::streamsize>(line.size())) ||
           !std::cin.eof()) {
      if (!std::cin.fail() && line[0] == '\0') continue;
      absl::StatusOr<ViewRequest> request =
          std::cin.fail() ? absl::InvalidArgumentError("the request is too long")
                          : ParseViewRequest(line.data());
      if (!request.ok()) return ReportError(ExitCode::kUsage, request.status());
      server.Ask(*std::move(request));
    }
    return ExitCode::kOk;
  }

 private:
  bool json_ = false;  // Messages; answers always are.
  uint32_t threads_ = 0;
};

}  // namespace

std::unique_ptr<Command> MakeViewCommand() { return std::make_unique<ViewCommand>(); }

}  // namespace sheaf::cli
