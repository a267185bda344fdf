// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "worker/render/mutations/mutation_passes.h"

#include <algorithm>
#include <array>
#include <utility>

#include "absl/status/status.h"
#include "common/film/tile_tree.h"
#include "worker/render/scene/compiled_scene.h"
#include "worker/render/traits/variant_choice.h"

namespace sheaf::render {
namespace {

// The pilot's samples are those of pass 0 of another seed, at every fourth pixel of every fourth
// row.
constexpr uint64_t kPilotSeed = 0x70696c6f74u;
constexpr int32_t kPilotStepPx = 4;
// The means whose median is that of a region; its pilot samples are dealt to them in turn. A single
// bright sample moves one of them. Source: Nemirovsky and Yudin 1983, "Problem Complexity and
// Method Efficiency in Optimization" (medians of means).
constexpr size_t kMeansInRegion = 8;
// Regions count as no darker than this part of the mean of all regions: what is darker brings
// little noise.
constexpr double kDarkestOverMean = 1.0 / 8;

// The sums of the pilot.
class PilotFilm : public MutationSink {
 public:
  explicit PilotFilm(const FrameSettings& settings)
      : columns_((settings.width_px + kRegionSizePx - 1) / kRegionSizePx),
        rows_((settings.height_px + kRegionSizePx - 1) / kRegionSizePx),
        regions_(static_cast<size_t>(columns_) * static_cast<size_t>(rows_)) {}

  void Add(int32_t x, int32_t y, const FilmSample& sample) override {
    const int32_t number = y / kRegionSizePx * columns_ + x / kRegionSizePx;
    Region& region = regions_[static_cast<size_t>(number)];
    Mean& mean = region.means[region.samples++ % kMeansInRegion];
    if (!IsFinite(sample.radiance)) return;
    mean.sum += std::max(0.0, static_cast<double>(Luminance(sample.radiance)));
    ++mean.count;
  }
  void Deposit(int32_t, int32_t, const std::array<double, 3>&) override {}

  ChainRules Rules() const {
    ChainRules rules;
    rules.regions_in_row = columns_;
    double sum = 0;
    for (const Region& region : regions_) {
      rules.thresholds.push_back(MedianOf(region));
      sum += rules.thresholds.back();
    }
    const double darkest = kDarkestOverMean * sum / static_cast<double>(regions_.size());
    if (!(darkest > 0)) rules.thresholds.clear();
    for (double& threshold : rules.thresholds) {
      threshold = kBrightOverMean * std::max(threshold, darkest);
    }
    return rules;
  }

 private:
  struct Mean {
    double sum = 0;
    uint32_t count = 0;
  };
  struct Region {
    std::array<Mean, kMeansInRegion> means;
    size_t samples = 0;
  };

  static double MedianOf(const Region& region) {
    std::vector<double> means;
    for (const Mean& mean : region.means) {
      if (mean.count > 0) means.push_back(mean.sum / mean.count);
    }
    if (means.empty()) return 0;
    std::sort(means.begin(), means.end());
    return (means[(means.size() - 1) / 2] + means[means.size() / 2]) / 2;
  }

  const int32_t columns_, rows_;
  std::vector<Region> regions_;
};

// One pass over the film.
class MutationFilm : public MutationSink {
 public:
  explicit MutationFilm(const FrameSettings& settings)
      : width_px_(settings.width_px), height_px_(settings.height_px) {
    pixels_.resize(static_cast<size_t>(width_px_) * static_cast<size_t>(height_px_));
  }

  void Add(int32_t x, int32_t y, const FilmSample& sample) override { At(x, y).own = sample; }
  void Deposit(int32_t x, int32_t y, const std::array<double, 3>& weighted) override {
    Pixel& pixel = At(x, y);
    for (size_t c = 0; c < 3; ++c) pixel.deposits[c] += weighted[c];
  }

  // The pass as a tile; clears the film for the next one.
  FilmTile Take(uint64_t pass, std::vector<PixelAccumulator::NonFinite>* lost) {
    FilmTile tile({0, 0, width_px_, height_px_}, {pass, 1});
    PixelAccumulator accumulator(&tile);
    for (int32_t y = 0; y < height_px_; ++y) {
      for (int32_t x = 0; x < width_px_; ++x) {
        Pixel& pixel = At(x, y);
        accumulator.Begin(x, y);
        accumulator.Add(pass, SampleOf(pixel));
        accumulator.End();
        pixel = {};
      }
    }
    for (const PixelAccumulator::NonFinite& sample : accumulator.non_finite()) {
      if (lost->size() < PixelAccumulator::kNonFiniteReportsMax) lost->push_back(sample);
    }
    return tile;
  }

 private:
  struct Pixel {
    FilmSample own;
    std::array<double, 3> deposits{};
  };

  Pixel& At(int32_t x, int32_t y) {
    return pixels_[static_cast<size_t>(y) * static_cast<size_t>(width_px_) +
                   static_cast<size_t>(x)];
  }
  static FilmSample SampleOf(const Pixel& pixel) {
    FilmSample sample = pixel.own;
    const auto weight = static_cast<double>(sample.filter_weight);
    for (size_t c = 0; c < 3; ++c) {
      if (pixel.deposits[c] == 0) continue;
      // The film multiplies by the weight. No filter samples points where it is 0.
      sample.radiance[c] =
          static_cast<float>(static_cast<double>(sample.radiance[c]) + pixel.deposits[c] / weight);
    }
    return sample;
  }

  const int32_t width_px_, height_px_;
  std::vector<Pixel> pixels_;
};

MutationRowFunction RowFunctionFor(const CompiledScene& scene) {
  return MutationRowFunctionOf(
      ChooseMutationVariant(scene.plan.traits, scene.settings.force_generic_variant));
}

}  // namespace

ChainRules ChainRulesOf(const CompiledScene& scene, RayCounts* counts) {
  const FrameSettings& settings = scene.settings;
  const MutationRowFunction trace_row = RowFunctionFor(scene);
  PilotFilm film(settings);
  const ChainRules no_chains;
  for (int32_t y = 0; y < settings.height_px; y += kPilotStepPx) {
    trace_row(scene, no_chains, settings.seed ^ kPilotSeed, kPilotStepPx, y, 0, &film, counts);
  }
  return film.Rules();
}

absl::StatusOr<FilmTile> RenderMutationPasses(const CompiledScene& scene, const ChainRules& rules,
                                              SampleBlock block, const std::stop_token& stop,
                                              RayCounts* counts,
                                              std::vector<PixelAccumulator::NonFinite>* lost) {
  const FrameSettings& settings = scene.settings;
  const MutationRowFunction trace_row = RowFunctionFor(scene);
  MutationFilm film(settings);
  TileTree tree({0, 0, settings.width_px, settings.height_px});
  for (uint64_t pass = block.first; pass < block.End(); ++pass) {
    for (int32_t y = 0; y < settings.height_px; ++y) {
      if (stop.stop_requested()) return absl::CancelledError("the pass was stopped");
      trace_row(scene, rules, settings.seed, 1, y, pass, &film, counts);
    }
    if (absl::Status status = tree.Insert(film.Take(pass, lost)); !status.ok()) return status;
  }
  return tree.nodes().at(block.first);  // All passes are one node.
}

}  // namespace sheaf::render
