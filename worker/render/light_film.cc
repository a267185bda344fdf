// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "worker/render/light_film.h"

#include <algorithm>
#include <cmath>
#include <optional>
#include <utility>

#include "common/base/check.h"
#include "common/film/light/light_pass_accumulator.h"
#include "common/film/tile_tree.h"

namespace sheaf::render {
namespace {

// The film point in copy (i, j) of the frame that shows `s`, in units of the frame.
Vec2d ImageIn(FilmEdges edges, int i, int j, Vec2d s) {
  if (edges == FilmEdges::kEqualArea && (i + j) % 2 != 0) return {i + 1 - s.x, j + 1 - s.y};
  if (edges == FilmEdges::kEquirectangular && j % 2 != 0) return {i + 0.5 + s.x, j + 1 - s.y};
  return {i + s.x, j + s.y};
}

// Puts the splats of one pass after the other into an accumulator.
class FilteredSplats : public SplatSink {
 public:
  FilteredSplats(const LightFilm& film, LightPassAccumulator* sums, std::vector<LostSplat>* lost)
      : film_(film), radius_(film.filter->radius_px()), sums_(*sums), lost_(*lost) {}

  void BeginPass(uint64_t pass) { pass_ = pass; }

  bool Covers(Vec2d raster) const override {
    if (IsInside(raster) || film_.edges == FilmEdges::kNone) return IsNearWindow(raster);
    const std::vector<Vec2d> images = ImagesOf(film_, raster, radius_);
    return std::any_of(images.begin(), images.end(),
                       [this](Vec2d image) { return IsNearWindow(image); });
  }

  void Add(Vec2d raster, const Rgb& radiance, LightPathKind kind, uint32_t group) override {
    const std::optional<size_t> layer = LayerOf(kind, group);
    const bool is_placed = std::isfinite(raster.x) && std::isfinite(raster.y);
    if (!is_placed || !IsFinite(radiance)) Report(raster);
    if (!is_placed) return sums_.CountLost();
    if (IsInside(raster) || film_.edges == FilmEdges::kNone) {
      return AddAt(raster, radiance, layer);
    }
    for (const Vec2d& image : ImagesOf(film_, raster, radius_)) AddAt(image, radiance, layer);
  }

  void AddMerged(int32_t x, int32_t y, const Rgb& radiance, const Rgb& bias, LightPathKind kind,
                 uint32_t group) override {
    if (!IsFinite(radiance)) Report({x + 0.5, y + 0.5});
    sums_.Add(x, y, radiance, 1, LayerOf(kind, group));
    sums_.AddBias(x, y, bias);
  }

 private:
  // The layer beside the image; none if the film has no such.
  std::optional<size_t> LayerOf(LightPathKind kind, uint32_t group) const {
    if (film_.outputs.light_groups.empty()) return std::nullopt;
    return film_.outputs.light_paths ? static_cast<size_t>(kind) : size_t{group};
  }
  // The filter lies within the frame, so that the point has no other image.
  bool IsInside(Vec2d raster) const {
    return raster.x >= radius_.x && raster.x < film_.width_px - radius_.x &&
           raster.y >= radius_.y && raster.y < film_.height_px - radius_.y;
  }
  // Points that are not finite count, so that they are reported.
  bool IsNearWindow(Vec2d raster) const {
    const PixelRect& window = film_.window;
    return !(raster.x < window.x0 - radius_.x || raster.x > window.x1 + radius_.x ||
             raster.y < window.y0 - radius_.y || raster.y > window.y1 + radius_.y);
  }
  void Report(Vec2d raster) {
    if (lost_.size() < PixelAccumulator::kNonFiniteReportsMax) lost_.push_back({raster, pass_});
  }

  // Pixels of the window along one axis whose centers are no further than the radius; [first, end).
  static std::pair<int32_t, int32_t> PixelsNear(double at, double radius, int32_t first,
                                                int32_t end) {
    // Clamped first: a point far outside may not fit an integer.
    const double low = std::clamp<double>(std::ceil(at - radius - 0.5), first, end);
    const double high = std::clamp<double>(std::floor(at + radius - 0.5) + 1, first, end);
    return {static_cast<int32_t>(low), static_cast<int32_t>(high)};
  }

  void AddAt(Vec2d point, const Rgb& radiance, std::optional<size_t> layer) {
    const PixelRect& window = film_.window;
    const auto [x0, x1] = PixelsNear(point.x, radius_.x, window.x0, window.x1);
    const auto [y0, y1] = PixelsNear(point.y, radius_.y, window.y0, window.y1);
    for (int32_t y = y0; y < y1; ++y) {
      for (int32_t x = x0; x < x1; ++x) {
        const double weight = film_.filter->Evaluate({point.x - (x + 0.5), point.y - (y + 0.5)});
        if (weight != 0) sums_.Add(x, y, radiance, static_cast<float>(weight), layer);
      }
    }
  }

  const LightFilm& film_;
  const Vec2d radius_;
  LightPassAccumulator& sums_;
  std::vector<LostSplat>& lost_;
  uint64_t pass_ = 0;
};

}  // namespace

FilmEdges FilmEdgesOf(const CameraDescription& camera) {
  switch (camera.kind) {
    case CameraDescription::Kind::kEquirectangular:
      return FilmEdges::kEquirectangular;
    case CameraDescription::Kind::kEqualArea:
      return FilmEdges::kEqualArea;
    default:
      return FilmEdges::kNone;
  }
}

std::vector<Vec2d> ImagesOf(const LightFilm& film, Vec2d raster, Vec2d radius_px) {
  std::vector<Vec2d> images{raster};
  if (film.edges == FilmEdges::kNone) return images;
  const Vec2d size{static_cast<double>(film.width_px), static_cast<double>(film.height_px)};
  const Vec2d s{raster.x / size.x, raster.y / size.y};
  // One more copy than the radius reaches: mirrored ones are moved by half a width.
  const int copies_x = static_cast<int>(std::ceil(radius_px.x / size.x)) + 1;
  const int copies_y = static_cast<int>(std::ceil(radius_px.y / size.y));
  for (int j = -copies_y; j <= copies_y; ++j) {
    for (int i = -copies_x; i <= copies_x; ++i) {
      if (i == 0 && j == 0) continue;
      const Vec2d in_frames = ImageIn(film.edges, i, j, s);
      const Vec2d image{in_frames.x * size.x, in_frames.y * size.y};
      const bool reaches = image.x > -radius_px.x && image.x < size.x + radius_px.x &&
                           image.y > -radius_px.y && image.y < size.y + radius_px.y;
      if (reaches) images.push_back(image);
    }
  }
  return images;
}

absl::StatusOr<FilmTile> SumLightPasses(const LightFilm& film, SampleBlock block,
                                        const TracePass& trace, std::vector<LostSplat>* lost) {
  SHEAF_CHECK(IsAligned(block));
  TileTree tree(film.window);
  for (const SampleBlock& part :
       CutSamples(block.first, block.count, LightPassAccumulator::kPassesMax)) {
    FilmTile tile(film.window, part, film.outputs);
    LightPassAccumulator sums(&tile);
    FilteredSplats splats(film, &sums, lost);
    for (uint64_t pass = part.first; pass < part.End(); ++pass) {
      splats.BeginPass(pass);
      if (absl::Status status = trace(pass, &splats); !status.ok()) return status;
      sums.EndPass();
    }
    sums.Finish();
    if (part == block) return tile;
    if (absl::Status status = tree.Insert(std::move(tile)); !status.ok()) return status;
  }
  return tree.nodes().at(block.first);  // All parts are one node.
}

}  // namespace sheaf::render
