// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "common/scene/reader/scene_file_reader.h"

#include <algorithm>
#include <vector>

#include "absl/strings/ascii.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "common/base/file.h"
#include "common/base/load_phases.h"
#include "common/base/status.h"
#include "common/scene/gltf/gltf_reader.h"
#include "common/scene/gltf/gltf_view.h"

namespace sheaf {
namespace {

constexpr uint64_t kViewBytesMax = uint64_t{64} << 10;

// With the view of the file GltfViewFile, if there is one.
absl::StatusOr<ReadSceneResult> ReadGltfAsViewed(const std::string& main_file, FileSource& files,
                                                 const SceneReaderLimits& limits) {
  GltfView view;
  if (const absl::StatusOr<std::string> path = files.LocalPath(GltfViewFile(main_file));
      path.ok()) {
    const absl::StatusOr<std::string> text = ReadWholeFile(*path, kViewBytesMax);
    if (!text.ok()) return text.status();
    const absl::StatusOr<GltfView> decoded = DecodeGltfView(*text);
    if (!decoded.ok()) return Annotate(decoded.status(), main_file);
    view = *decoded;
  }
  return ReadGltf(main_file, files, view, limits);
}

constexpr const char* kPbrtEndings[] = {".pbrt"};
constexpr SceneFileFormat kFormats[] = {
    {"pbrt-v4", kPbrtEndings,
     [](const std::string& main_file, FileSource& files, const SceneReaderLimits& limits) {
       return ReadScene(main_file, files, limits);
     }},
    {"glTF 2.0", kGltfEndings, ReadGltfAsViewed}};

const SceneFileFormat* FindFormat(const std::string& name) {
  const std::string lower = absl::AsciiStrToLower(name);
  for (const SceneFileFormat& format : kFormats) {
    const bool fits = std::ranges::any_of(
        format.endings, [&lower](const char* ending) { return lower.ends_with(ending); });
    if (fits) return &format;
  }
  return nullptr;
}

}  // namespace

std::span<const SceneFileFormat> SceneFileFormats() { return kFormats; }

bool HasSceneEnding(const std::string& name) { return FindFormat(name) != nullptr; }

std::string SceneEndings() {
  std::vector<std::string> all;
  for (const SceneFileFormat& format : kFormats) {
    all.insert(all.end(), format.endings.begin(), format.endings.end());
  }
  const std::string last = all.back();
  all.pop_back();
  return absl::StrCat(absl::StrJoin(all, ", "), " or ", last);
}

absl::StatusOr<ReadSceneResult> ReadSceneByName(const std::string& main_file, FileSource& files,
                                                const SceneReaderLimits& limits) {
  const PhaseTimer timer(LoadPhase::kRead);
  const SceneFileFormat* const format = FindFormat(main_file);
  return (format == nullptr ? kFormats[0] : *format).read(main_file, files, limits);
}

}  // namespace sheaf
