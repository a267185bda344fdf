// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "cli/view/view_request.h"

#include <sys/mman.h>
#include <unistd.h>

#include <algorithm>
#include <nlohmann/json.hpp>
#include <utility>

#include "absl/strings/str_cat.h"
#include "common/scene/file_source.h"
#include "common/scene/pbrt/scene_reader.h"

namespace sheaf::cli {
namespace {

constexpr char kTextName[] = "camera";

// A file in memory, which ends with this.
class MemoryFile {
 public:
  explicit MemoryFile(const std::string& text) : fd_(memfd_create(kTextName, MFD_CLOEXEC)) {
    size_t written = 0;
    while (fd_ >= 0 && written < text.size()) {
      const ssize_t count = write(fd_, text.data() + written, text.size() - written);
      if (count <= 0) return;
      written += static_cast<size_t>(count);
    }
  }
  ~MemoryFile() {
    if (fd_ >= 0) close(fd_);
  }
  MemoryFile(const MemoryFile&) = delete;
  MemoryFile& operator=(const MemoryFile&) = delete;
  std::string path() const { return absl::StrCat("/proc/self/fd/", fd_); }

 private:
  const int fd_;
};

int32_t DividedUp(int32_t count, int32_t divisor) { return (count + divisor - 1) / divisor; }

}  // namespace

absl::StatusOr<ViewRequest> ParseViewRequest(const std::string& line) {
  const nlohmann::json json = nlohmann::json::parse(line, nullptr, /*allow_exceptions=*/false);
  const auto is_text = [&json](const char* name) {
    return !json.contains(name) || json[name].is_string();
  };
  if (!json.is_object() || !is_text("scene") || !is_text("camera") ||
      (json.contains("id") && !json["id"].is_number_integer())) {
    return absl::InvalidArgumentError(
        "a request is a line of JSON such as {\"id\": 1, \"scene\": \"a.pbrt\", \"camera\": "
        "\"...\"}; see docs/viewing.md");
  }
  ViewRequest request{json.value("id", int64_t{0}), json.value("scene", std::string()),
                      json.value("camera", std::string())};
  if (request.scene.empty() && request.camera.empty()) {
    return absl::InvalidArgumentError("the request has neither a scene nor a camera");
  }
  return request;
}

absl::StatusOr<SampledView> ViewOf(const SceneDescription& scene, const RenderSettings& settings) {
  const absl::StatusOr<FrameSettings> resolved = ResolveSettings(scene, settings);
  if (!resolved.ok()) return resolved.status();
  return SampledView{{scene.camera, resolved->width_px, resolved->height_px, resolved->window},
                     resolved->samples};
}

absl::StatusOr<SampledView> ReadView(const std::string& camera, const RenderSettings& settings) {
  const MemoryFile file(absl::StrCat(camera, "\nWorldBegin\n"));
  TableFileSource files({{kTextName, file.path()}});
  const absl::StatusOr<ReadSceneResult> read = ReadScene(kTextName, files);
  if (!read.ok()) return absl::InvalidArgumentError(read.status().message());
  return ViewOf(read->scene, settings);
}

render::SceneView Coarse(const render::SceneView& view, int32_t divisor) {
  render::SceneView coarse = view;
  coarse.width_px = DividedUp(view.width_px, divisor);
  coarse.height_px = DividedUp(view.height_px, divisor);
  // The film's last column and row may reach beyond the view: the screen grows by as much.
  double* const screen = coarse.camera.screen_window;
  const double wider = static_cast<double>(coarse.width_px) * divisor / view.width_px;
  const double higher = static_cast<double>(coarse.height_px) * divisor / view.height_px;
  screen[1] = screen[0] + (screen[1] - screen[0]) * wider;
  screen[2] = screen[3] - (screen[3] - screen[2]) * higher;
  coarse.window = {view.window.x0 / divisor, view.window.y0 / divisor,
                   DividedUp(view.window.x1, divisor), DividedUp(view.window.y1, divisor)};
  return coarse;
}

}  // namespace sheaf::cli
