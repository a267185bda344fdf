// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "worker/render/eyes/eye_passes.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <utility>

#include "common/film/tile_tree.h"
#include "worker/render/eyes/eye_variants.h"
#include "worker/render/scene/compiled_scene.h"
#include "worker/render/traits/variant_choice.h"

namespace sheaf::render {
namespace {

// One pass over the film of all eyes.
class EyeFilm : public EyeSink {
 public:
  explicit EyeFilm(const CompiledScene& scene)
      : scene_(scene),
        stride_px_(scene.settings.width_px),
        width_px_(FilmWidthOf(scene)),
        height_px_(scene.settings.height_px),
        radius_(scene.filter.radius_px()) {
    sums_.resize(static_cast<size_t>(stride_px_) * static_cast<size_t>(height_px_));
  }

  void Add(Eye eye, int32_t x, int32_t y, const SharedSample& sample) override {
    const FilmSample& own = sample.own;
    if (sample.own_share != 0) {
      AddTo(IndexOf(eye, x, y), own,
            {eye, {}, own.radiance, own.normal, own.depth, sample.own_share}, own.filter_weight);
    }
    for (int32_t i = 0; i < sample.place_count; ++i) {
      const SharedSample::Place& place = sample.places[static_cast<size_t>(i)];
      const Rgb& radiance = place.radiance;
      if (std::isfinite(radiance.r + radiance.g + radiance.b)) {
        AddAround(own, place);
      } else if (sample.own_share == 0) {  // Otherwise `own` reports the path.
        AddTo(IndexOf(eye, x, y), own, place, 1);
      }
    }
  }

  // The pass as a tile; clears the film for the next one.
  FilmTile Take(uint64_t pass, std::vector<PixelAccumulator::NonFinite>* lost) {
    FilmTile tile({0, 0, stride_px_, height_px_}, {pass, 1});
    PixelAccumulator accumulator(&tile);
    for (int32_t y = 0; y < height_px_; ++y) {
      for (int32_t x = 0; x < stride_px_; ++x) {
        const size_t at = IndexOf(Eye::kLeft, x, y);
        accumulator.Begin(x, y);
        accumulator.Add(pass, SampleAt(at));
        accumulator.End();
        sums_[at] = {};
      }
    }
    for (const PixelAccumulator::NonFinite& sample : accumulator.non_finite()) {
      if (lost->size() < PixelAccumulator::kNonFiniteReportsMax) lost->push_back(sample);
    }
    return tile;
  }

 private:
  // Sums of one pixel: of the channels of samples, and of their parts of a sample.
  struct Sum {
    std::array<double, 3> radiance{}, albedo{}, normal{};
    double alpha = 0, depth = 0, share = 0;
  };

  size_t IndexOf(Eye eye, int32_t x, int32_t y) const {
    const int32_t column = eye == Eye::kLeft ? x : x + width_px_;
    return static_cast<size_t>(y) * static_cast<size_t>(stride_px_) + static_cast<size_t>(column);
  }
  // weight: that of the pixel's filter.
  void AddTo(size_t at, const FilmSample& own, const SharedSample::Place& place, double weight) {
    Sum& sum = sums_[at];
    const double part = weight * static_cast<double>(place.share);
    for (size_t c = 0; c < 3; ++c) {
      sum.radiance[c] += weight * static_cast<double>(place.radiance[c]);
      sum.albedo[c] += part * static_cast<double>(own.albedo[c]);
      sum.normal[c] += part * static_cast<double>(place.normal[c]);
    }
    sum.alpha += part * static_cast<double>(own.alpha);
    sum.depth += part * static_cast<double>(place.depth);
    sum.share += part;
  }
  static std::pair<int32_t, int32_t> PixelsNear(double at, double radius, int32_t end) {
    const double low = std::clamp<double>(std::ceil(at - radius - 0.5), 0, end);
    const double high = std::clamp<double>(std::floor(at + radius - 0.5) + 1, 0, end);
    return {static_cast<int32_t>(low), static_cast<int32_t>(high)};
  }
  // Adds to the pixels whose filters cover the place.
  void AddAround(const FilmSample& own, const SharedSample::Place& place) {
    const auto [x0, x1] = PixelsNear(place.film.x, radius_.x, width_px_);
    const auto [y0, y1] = PixelsNear(place.film.y, radius_.y, height_px_);
    columns_.clear();
    for (int32_t x = x0; x < x1; ++x) {
      columns_.push_back(scene_.filter.EvaluateX(place.film.x - (x + 0.5)));
    }
    for (int32_t y = y0; y < y1; ++y) {
      const double row = scene_.filter.EvaluateY(place.film.y - (y + 0.5));
      for (int32_t x = x0; x < x1; ++x) {
        const double weight = columns_[static_cast<size_t>(x - x0)] * row;
        if (weight != 0) AddTo(IndexOf(place.eye, x, y), own, place, weight);
      }
    }
  }
  FilmSample SampleAt(size_t at) const {
    const Sum& sum = sums_[at];
    const auto mean = [&sum](double of_all) { return static_cast<float>(of_all / sum.share); };
    FilmSample sample;
    sample.filter_weight = 0;
    if (sum.share == 0) return sample;
    for (size_t c = 0; c < 3; ++c) {
      sample.radiance[c] = mean(sum.radiance[c]);
      sample.albedo[c] = mean(sum.albedo[c]);
      sample.normal[c] = mean(sum.normal[c]);
    }
    sample.alpha = mean(sum.alpha);
    sample.depth = mean(sum.depth);
    sample.filter_weight = static_cast<float>(sum.share);
    float unused = 1;
    scene_.film.Clamp(&sample.radiance, &unused);
    return sample;
  }

  const CompiledScene& scene_;
  const int32_t stride_px_;             // The width of the film of all eyes.
  const int32_t width_px_, height_px_;  // The size of the film of each eye.
  const Vec2d radius_;
  std::vector<Sum> sums_;
  std::vector<double> columns_;  // Factors of the filter by column, for AddAround.
};

}  // namespace

absl::StatusOr<FilmTile> RenderEyePasses(const CompiledScene& scene, SampleBlock block,
                                         const std::stop_token& stop, RayCounts* counts,
                                         std::vector<PixelAccumulator::NonFinite>* lost) {
  const FrameSettings& settings = scene.settings;
  const EyeRowFunction trace_row =
      EyeRowFunctionOf(ChooseEyeVariant(scene.plan.traits, settings.force_generic_variant));
  const PathSharing sharing = SharingOf(scene);
  EyeFilm film(scene);
  TileTree tree({0, 0, settings.width_px, settings.height_px});
  for (uint64_t pass = block.first; pass < block.End(); ++pass) {
    for (const Eye eye : {Eye::kLeft, Eye::kRight}) {
      if (eye == Eye::kRight && scene.eyes == nullptr) continue;
      for (int32_t y = 0; y < settings.height_px; ++y) {
        if (stop.stop_requested()) return absl::CancelledError("the pass was stopped");
        trace_row(scene, sharing, eye, y, pass, &film, counts);
      }
    }
    if (absl::Status status = tree.Insert(film.Take(pass, lost)); !status.ok()) return status;
  }
  return tree.nodes().at(block.first);  // All passes are one node.
}

uint64_t EyePassMemoryBytes(int64_t pixel_count, SampleBlock block) {
  // The film, the tile of one pass, and the nodes of the tree: each holds its replicates, and they
  // halve from the root down.
  constexpr uint64_t kFilm = 12 * sizeof(double);
  const uint64_t nodes = static_cast<uint64_t>(std::bit_width(block.count)) + 2;
  const uint64_t replicates = std::min<uint64_t>(block.count, kReplicateCount);
  const uint64_t planes = nodes * kFilmChannelCount + 3 * replicates * kReplicateChannelCount;
  return static_cast<uint64_t>(pixel_count) * (kFilm + planes * sizeof(float));
}

}  // namespace sheaf::render
