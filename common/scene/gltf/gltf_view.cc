// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "common/scene/gltf/gltf_view.h"

#include <algorithm>
#include <vector>

#include "absl/strings/match.h"
#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "absl/strings/str_split.h"

namespace sheaf {
namespace {

constexpr char kFirstLine[] = "sheaf glTF view 1";

absl::Status BadView(const std::string& line) {
  return absl::InvalidArgumentError(absl::StrCat("the view of a glTF scene has the line \"",
                                                 line.substr(0, 80), "\", which is not valid"));
}

bool ParseSeconds(const std::string& text, double least, double* seconds) {
  return absl::SimpleAtod(text, seconds) && *seconds >= least && *seconds <= GltfView::kTimeMax;
}

bool ParsePixels(const std::string& text, int32_t* pixels) {
  return absl::SimpleAtoi(text, pixels) && *pixels > 0 && *pixels <= GltfView::kSizePxMax;
}

}  // namespace

bool IsGltfName(const std::string& name) {
  return std::ranges::any_of(
      kGltfEndings, [&name](const char* ending) { return absl::EndsWithIgnoreCase(name, ending); });
}

std::string GltfViewFile(const std::string& main_file) { return main_file + ".view"; }

std::string EncodeGltfView(const GltfView& view) {
  std::string text = absl::StrCat(kFirstLine, "\n");
  const auto add = [&](const char* key, const std::string& value) {
    if (!value.empty()) absl::StrAppend(&text, key, " ", value, "\n");
  };
  add("camera", view.camera);
  add("right_camera", view.right_camera);
  add("animation", view.animation);
  // 17 digits give back the same number.
  if (view.time_s != 0) add("time", absl::StrFormat("%.17g", view.time_s));
  if (view.shutter_s != 0) add("shutter", absl::StrFormat("%.17g", view.shutter_s));
  add("environment", view.environment);
  if (view.width_px > 0) add("width", absl::StrCat(view.width_px));
  if (view.height_px > 0) add("height", absl::StrCat(view.height_px));
  return text;
}

absl::StatusOr<GltfView> DecodeGltfView(const std::string& text) {
  GltfView view;
  const std::vector<std::string> lines = absl::StrSplit(text, '\n');
  if (lines.front() != kFirstLine) return BadView(lines.front());
  for (size_t i = 1; i < lines.size(); ++i) {
    const std::string& line = lines[i];
    if (line.empty()) continue;
    const size_t space = line.find(' ');
    if (space == std::string::npos) return BadView(line);
    const std::string key = line.substr(0, space), value = line.substr(space + 1);
    bool ok = true;
    if (key == "camera") {
      view.camera = value;
    } else if (key == "right_camera") {
      view.right_camera = value;
    } else if (key == "animation") {
      view.animation = value;
    } else if (key == "time") {
      ok = ParseSeconds(value, -GltfView::kTimeMax, &view.time_s);
    } else if (key == "shutter") {
      ok = ParseSeconds(value, 0, &view.shutter_s);
    } else if (key == "environment") {
      view.environment = value;
    } else if (key == "width") {
      ok = ParsePixels(value, &view.width_px);
    } else if (key == "height") {
      ok = ParsePixels(value, &view.height_px);
    } else {
      ok = false;
    }
    if (!ok) return BadView(line);
  }
  return view;
}

}  // namespace sheaf
