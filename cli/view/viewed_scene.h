// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// ViewedScene: a scene, loaded once, and images of it from any side.
#pragma once

#include <cstdint>
#include <memory>
#include <stop_token>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "cli/job/opened_scene.h"
#include "cli/view/view_request.h"
#include "common/film/tile_geometry.h"
#include "common/scene/settings/render_settings.h"
#include "worker/render/scene/compile_scene.h"

namespace sheaf::cli {

// An image as the sums over its samples.
class ViewImage {
 public:
  // Without samples.
  explicit ViewImage(const PixelRect& window = {});

  const PixelRect& window() const { return window_; }
  // Adds a part. Thread safety: parts of distinct pixels may be added concurrently.
  void Add(const FilmTile& part);
  // R, G, B (linear sRGB) and alpha of each pixel, row by row from the top; 0 without samples.
  std::vector<float> Pixels() const;

 private:
  static constexpr size_t kSums = 5;  // R, G, B, alpha, weight.
  PixelRect window_;
  std::vector<double> sums_;
};

// Not thread-safe.
class ViewedScene {
 public:
  // Reads a scene file and compiles it for paths from the camera: for the view, or for the scene's
  // own camera, where it is null. Errors: those of ReadSceneFile, ResolveSettings and CompileScene.
  static absl::StatusOr<std::unique_ptr<ViewedScene>> Load(const std::string& path,
                                                           const RenderSettings& settings,
                                                           const SampledView* view);

  // The scene's own view, or the one it was loaded for.
  const SampledView& first_view() const { return first_view_; }
  // Lines about the scene, for people.
  const std::vector<std::string>& notes() const { return notes_; }
  // Chooses what the next samples show. Errors: those of SetView.
  absl::Status Show(const render::SceneView& view);
  // Renders a block of samples of each pixel of the window, and adds them to the image, which has
  // this window. Errors: kCancelled after a request to stop, the image is then incomplete; those
  // of RenderTilePass and CheckVolumes.
  absl::Status Render(SampleBlock block, int threads, const std::stop_token& stop,
                      ViewImage* image) const;

 private:
  ViewedScene() = default;

  std::unique_ptr<GltfInputs> gltf_;  // Keeps derived files.
  std::unique_ptr<OpenedFiles> files_;
  SampledView first_view_;
  std::vector<std::string> notes_;
  render::ChangeableScenePtr scene_;
};

}  // namespace sheaf::cli
