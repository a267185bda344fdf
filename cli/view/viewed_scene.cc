// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "cli/view/viewed_scene.h"

#include <utility>

#include "common/base/first_error.h"
#include "common/base/parallel.h"
#include "common/film/film_tile.h"
#include "common/scene/film_size.h"
#include "worker/render/scene/compiled_scene.h"
#include "worker/render/tile_pass.h"

namespace sheaf::cli {
namespace {

// Small, so that all threads end a pass at the same time.
constexpr int32_t kTilePx = 16;

}  // namespace

ViewImage::ViewImage(const PixelRect& window)
    : window_(window), sums_(kSums * static_cast<size_t>(window.PixelCount())) {}

void ViewImage::Add(const FilmTile& part) {
  const PixelRect& rect = part.rect();
  const auto sum = [&part](FilmChannel high, FilmChannel low, size_t i) {
    return static_cast<double>(part.channel(high)[i]) + static_cast<double>(part.channel(low)[i]);
  };
  for (int32_t y = rect.y0; y < rect.y1; ++y) {
    for (int32_t x = rect.x0; x < rect.x1; ++x) {
      const size_t i = rect.IndexOf(x, y);
      double* const to = &sums_[kSums * window_.IndexOf(x, y)];
      to[0] += sum(FilmChannel::kRedHi, FilmChannel::kRedLo, i);
      to[1] += sum(FilmChannel::kGreenHi, FilmChannel::kGreenLo, i);
      to[2] += sum(FilmChannel::kBlueHi, FilmChannel::kBlueLo, i);
      to[3] += static_cast<double>(part.channel(FilmChannel::kAlpha)[i]);
      to[4] += sum(FilmChannel::kWeight, FilmChannel::kWeightLo, i);
    }
  }
}

std::vector<float> ViewImage::Pixels() const {
  const size_t count = sums_.size() / kSums;
  std::vector<float> pixels(4 * count);
  for (size_t i = 0; i < count; ++i) {
    const double* const from = &sums_[kSums * i];
    if (!(from[4] > 0)) continue;
    for (size_t c = 0; c < 4; ++c) pixels[4 * i + c] = static_cast<float>(from[c] / from[4]);
  }
  return pixels;
}

absl::StatusOr<std::unique_ptr<ViewedScene>> ViewedScene::Load(const std::string& path,
                                                               const RenderSettings& settings,
                                                               const SampledView* view) {
  std::unique_ptr<ViewedScene> viewed(new ViewedScene);
  viewed->gltf_ = std::make_unique<GltfInputs>(GltfArguments{}, FilmSize{});
  absl::StatusOr<SceneFile> file = ReadSceneFile(path, viewed->gltf_.get());
  if (!file.ok()) return file.status();
  for (const SceneDiagnostic& diagnostic : file->read.diagnostics) {
    viewed->notes_.push_back(diagnostic.text);
  }
  SceneDescription& scene = file->read.scene;
  if (view != nullptr) {
    const int32_t medium = scene.camera.medium;
    scene.camera = view->view.camera;
    scene.camera.medium = medium;
    viewed->first_view_ = *view;
  } else {
    const absl::StatusOr<SampledView> own = ViewOf(scene, settings);
    if (!own.ok()) return own.status();
    viewed->first_view_ = *own;
  }
  absl::StatusOr<FrameSettings> resolved = ResolveSettings(scene, settings);
  if (!resolved.ok()) return resolved.status();
  // Each other technique is made for one view.
  resolved->techniques = TechniqueSet::kCamera;
  resolved->outputs = {};
  resolved->width_px = viewed->first_view_.view.width_px;
  resolved->height_px = viewed->first_view_.view.height_px;
  resolved->window = viewed->first_view_.view.window;
  // Compiling resizes the film, which changes a camera's screen where the sizes differ.
  scene.film.width_px = resolved->width_px;
  scene.film.height_px = resolved->height_px;
  render::CompileTechniques techniques;
  techniques.merge_media = false;
  viewed->files_ = std::move(file->files);
  absl::StatusOr<render::ChangeableScenePtr> compiled =
      render::CompileChangeableScene(std::move(scene), *resolved, *viewed->files_, {}, techniques);
  if (!compiled.ok()) return compiled.status();
  viewed->scene_ = *std::move(compiled);
  return viewed;
}

absl::Status ViewedScene::Show(const render::SceneView& view) {
  return render::SetView(view, *files_, scene_.get());
}

absl::Status ViewedScene::Render(SampleBlock block, int threads, const std::stop_token& stop,
                                 ViewImage* image) const {
  const std::vector<PixelRect> tiles = CutTiles(image->window(), kTilePx);
  FirstError failure;
  ParallelRanges(tiles.size(), 1, threads, [&](uint64_t i, uint64_t) {
    if (stop.stop_requested()) return;
    render::RenderStats stats;
    const absl::StatusOr<FilmTile> part =
        render::RenderTilePass(*scene_, tiles[i], block, stop, &stats);
    if (part.ok()) {
      image->Add(*part);
    } else {
      failure.Update(part.status());
    }
  });
  if (stop.stop_requested()) return absl::CancelledError("another view is wanted");
  if (absl::Status status = failure.Get(); !status.ok()) return status;
  return render::CheckVolumes(*scene_);
}

}  // namespace sheaf::cli
