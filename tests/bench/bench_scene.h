// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Helpers for benchmarks that read scenes from files.
#pragma once

#include <algorithm>
#include <cstdint>
#include <cstdio>
#include <filesystem>
#include <string>
#include <system_error>
#include <utility>
#include <vector>

#include "absl/status/statusor.h"
#include "common/film/tile_geometry.h"
#include "common/scene/pbrt/scene_reader.h"
#include "common/scene/settings/render_settings.h"
#include "tests/bench/measures.h"
#include "worker/render/tile_pass.h"

namespace sheaf::render {

// The scene files at or below a path, sorted. Empty if there are none.
inline std::vector<std::filesystem::path> SceneFilesAt(const std::filesystem::path& path) {
  std::error_code error;
  if (std::filesystem::is_regular_file(path, error)) return {path};
  std::vector<std::filesystem::path> files;
  if (!std::filesystem::is_directory(path, error)) return files;
  for (const auto& entry : std::filesystem::recursive_directory_iterator(path, error)) {
    if (entry.path().extension() == ".pbrt") files.push_back(entry.path());
  }
  std::sort(files.begin(), files.end());
  return files;
}

// A scene as read and resolved, not yet compiled. Must outlive scenes compiled from it.
struct ReadFile {
  explicit ReadFile(const std::filesystem::path& path)
      : files(path.has_parent_path() ? path.parent_path().string() : ".") {}
  DirectoryFileSource files;
  SceneDescription scene;
  FrameSettings settings;
};
// samples 0: as in the file.
inline absl::Status ReadSceneFile(const std::filesystem::path& path, uint64_t samples,
                                  ReadFile* file) {
  auto read = ReadScene(path.filename().string(), file->files);
  if (!read.ok()) return read.status();
  RenderSettings wished;
  if (samples > 0) wished.samples = samples;
  auto settings = ResolveSettings(read->scene, wished);
  if (!settings.ok()) return settings.status();
  file->scene = std::move(read->scene);
  file->settings = *std::move(settings);
  return absl::OkStatus();
}

// At most count_max of a frame's tiles, spread evenly over it.
inline std::vector<PixelRect> SomeTiles(const PixelRect& window, int32_t size_px,
                                        size_t count_max) {
  const std::vector<PixelRect> all = CutTiles(window, size_px);
  const size_t step = (all.size() + count_max - 1) / count_max;
  std::vector<PixelRect> tiles;
  for (size_t i = 0; i < all.size(); i += step) tiles.push_back(all[i]);
  return tiles;
}

// Prints one line for a file that Sheaf does not render: a fragment of a scene or an unsupported
// one.
inline void PrintNotRendered(const std::filesystem::path& path, const absl::Status& status) {
  const std::string reason(status.message());
  std::printf("%-36s not rendered: %s\n", path.filename().c_str(),
              reason.substr(0, reason.find('\n')).c_str());
  std::fflush(stdout);
}

}  // namespace sheaf::render
