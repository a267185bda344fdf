// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "worker/render/ablation/plan_measurement.h"

#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <functional>
#include <limits>
#include <utility>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "common/base/check.h"
#include "worker/render/ablation/ablate.h"
#include "worker/render/light/choice/light_choice.h"
#include "worker/render/tile_pass.h"

namespace sheaf::render {
namespace {

constexpr int32_t kTileSizePx = 16;
constexpr size_t kTilesMax = 64;
constexpr size_t kTrialTiles = 2;
// Number of turns for which an effect's time should suffice: their spread gives the error.
constexpr double kTurnsWanted = 16;
constexpr uint64_t kTurnsMax = 4096;
// From this depth on, half the depth is measured, too.
constexpr int32_t kHalvedDepthMin = 4;

using Clock = std::chrono::steady_clock;
double SecondsSince(Clock::time_point start) {
  return std::chrono::duration<double>(Clock::now() - start).count();
}

// The result of one turn of one scene: one sample in every pixel of the tiles.
struct TimedPass {
  double cpu_seconds = 0, sum = 0;
};

// A scene that is rendered turn by turn, and its images so far.
class Rendering {
 public:
  Rendering(const CompiledScene& scene, std::vector<PixelRect> tiles)
      : scene_(scene), tiles_(std::move(tiles)), pixels_(tiles_.size()) {
    for (size_t i = 0; i < tiles_.size(); ++i) pixels_[i].resize(tiles_[i].PixelCount());
  }

  // turn: the index of the sample.
  absl::StatusOr<TimedPass> Render(uint64_t turn) {
    TimedPass result;
    for (size_t i = 0; i < tiles_.size(); ++i) {
      RenderStats stats;
      const absl::StatusOr<FilmTile> film =
          RenderTilePass(scene_, tiles_[i], {turn, 1}, {}, &stats);
      if (!film.ok()) return film.status();
      result.cpu_seconds += stats.cpu_seconds;
      result.sum += Add(*film, turn % 2, &pixels_[i]);
    }
    return result;
  }

  struct Pixel {
    std::array<Rgb, 2> halves{};  // Independent sums over even and over odd turns.
    double sum = 0, square_sum = 0;
  };
  const std::vector<std::vector<Pixel>>& pixels() const { return pixels_; }

 private:
  static double Add(const FilmTile& film, size_t half, std::vector<Pixel>* pixels) {
    double sum = 0;
    for (size_t i = 0; i < pixels->size(); ++i) {
      const Rgb value{film.channel(FilmChannel::kRedHi)[i], film.channel(FilmChannel::kGreenHi)[i],
                      film.channel(FilmChannel::kBlueHi)[i]};
      Pixel& pixel = (*pixels)[i];
      pixel.halves[half] += value;
      const double gray = (static_cast<double>(value.r) + static_cast<double>(value.g) +
                           static_cast<double>(value.b)) /
                          3;
      pixel.sum += gray;
      pixel.square_sum += gray * gray;
      sum += gray;
    }
    return sum;
  }

  const CompiledScene& scene_;
  std::vector<PixelRect> tiles_;
  std::vector<std::vector<Pixel>> pixels_;  // Per tile.
};

// Ratio of two sums over turns: common variation of both cancels, the rest is the error.
Measured RatioOf(const std::vector<double>& over, const std::vector<double>& under) {
  double over_sum = 0, under_sum = 0;
  for (const double v : over) over_sum += v;
  for (const double v : under) under_sum += v;
  Measured ratio{over_sum / under_sum, 0};
  double square_sum = 0;
  for (size_t i = 0; i < over.size(); ++i) {
    const double rest = over[i] - ratio.value * under[i];
    square_sum += rest * rest;
  }
  const auto n = static_cast<double>(over.size());
  ratio.error = std::sqrt(square_sum * n / (n - 1)) / std::fabs(under_sum);
  return ratio;
}

double VarianceOf(const Rendering& rendering, double turns) {
  double variance = 0;
  for (const auto& tile : rendering.pixels()) {
    for (const Rendering::Pixel& pixel : tile) {
      variance += std::max(0.0, pixel.square_sum - pixel.sum * pixel.sum / turns);
    }
  }
  return variance;
}

// The halves' errors are independent, so the expectation of their product is the squared
// difference.
double RelMse(const Rendering& with, const Rendering& without, double turns) {
  double total = 0;
  size_t count = 0;
  for (size_t t = 0; t < with.pixels().size(); ++t) {
    const auto& a = with.pixels()[t];
    const auto& b = without.pixels()[t];
    double mean = 0, product = 0;
    for (size_t i = 0; i < a.size(); ++i) {
      mean += a[i].sum / turns / static_cast<double>(a.size());
      for (size_t c = 0; c < 3; ++c) {
        const auto difference = [&](size_t half) {
          return static_cast<double>(b[i].halves[half][c]) -
                 static_cast<double>(a[i].halves[half][c]);
        };
        product += difference(0) * difference(1) * 4 / (turns * turns) / 3;
      }
    }
    if (mean > 0) {
      total += product / (mean * mean);
      count += a.size();
    }
  }
  return count > 0 ? total / static_cast<double>(count) : 0;
}

std::vector<PixelRect> SpreadTiles(PixelRect window, size_t count) {
  const std::vector<PixelRect> all = CutTiles(window, kTileSizePx);
  count = std::min(count, all.size());
  std::vector<PixelRect> tiles;
  for (size_t i = 0; i < count; ++i) tiles.push_back(all[(2 * i + 1) * all.size() / (2 * count)]);
  return tiles;
}

// One ablation.
struct Omission {
  std::string name;
  std::function<absl::StatusOr<AblatedScene>()> make;
  CompileTechniques techniques;
};

class Measurer {
 public:
  Measurer(const SceneDescription& scene, const FrameSettings& settings, FileSource& files,
           double seconds)
      : scene_(scene), settings_(settings), files_(files), seconds_(seconds) {}

  absl::StatusOr<PlanMeasurement> Measure() {
    absl::StatusOr<CompiledScenePtr> whole = CompileScene(scene_, settings_, files_);
    if (!whole.ok()) return whole.status();
    whole_ = *std::move(whole);
    const std::vector<Omission> omissions = Omissions();
    if (absl::Status status = ChooseTiles(omissions.size()); !status.ok()) return status;
    for (size_t i = 0; i < omissions.size(); ++i) {
      EffectMeasurement effect;
      effect.name = omissions[i].name;
      const double left = seconds_ - SecondsSince(start_);
      if (left > 0) {
        const double until = seconds_ - left + left / static_cast<double>(omissions.size() - i);
        const absl::Status status = MeasureOne(omissions[i], until, &effect);
        if (!status.ok()) effect.problem = std::string(status.message());
      } else {
        effect.problem = "the time limit was reached";
      }
      result_.effects.push_back(std::move(effect));
    }
    result_.seconds = SecondsSince(start_);
    return std::move(result_);
  }

 private:
  std::vector<Omission> Omissions() const {
    std::vector<Omission> omissions;
    for (const PlannedEffect& effect : PlanOf(*whole_).effects) {
      const Trait trait = effect.trait;
      omissions.push_back(
          {effect.name, [=, this] { return Ablate(trait, scene_, settings_, files_); }, {}});
    }
    const int32_t depth = PlanOf(*whole_).max_depth;
    const auto with_depth = [this](int32_t limit) {
      return [this, limit] {
        AblatedScene shallow{scene_, settings_, absl::StrCat("depth ", limit)};
        shallow.settings.max_depth = limit;
        return absl::StatusOr<AblatedScene>(std::move(shallow));
      };
    };
    if (depth > 1) omissions.push_back({"indirect light", with_depth(1), {}});
    if (depth >= kHalvedDepthMin) {
      omissions.push_back({absl::StrCat("depth ", depth), with_depth(depth / 2), {}});
    }
    if (PlanOf(*whole_).light_count > kLightsWeighedMax) {
      omissions.push_back({"light hierarchy",
                           [this] {
                             return absl::StatusOr<AblatedScene>(AblatedScene{
                                 scene_, settings_, "all lights are equally probable"});
                           },
                           {.choose_lights_evenly = true}});
    }
    return omissions;
  }

  // Chooses as many tiles as allow kTurnsWanted turns of every effect.
  absl::Status ChooseTiles(size_t effects) {
    Rendering trial(*whole_, SpreadTiles(settings_.window, kTrialTiles));
    double seconds_per_tile = 0;
    for (int i = 0; i < 2; ++i) {  // The first run warms the caches.
      const Clock::time_point begin = Clock::now();
      const absl::StatusOr<TimedPass> turn = trial.Render(0);
      if (!turn.ok()) return turn.status();
      seconds_per_tile = SecondsSince(begin) / kTrialTiles;
    }
    const double left = std::max(0.0, seconds_ - SecondsSince(start_));
    const double tiles = left / (static_cast<double>(std::max<size_t>(effects, 1)) * 2 *
                                 kTurnsWanted * std::max(seconds_per_tile, 1e-6));
    tiles_ =
        SpreadTiles(settings_.window,
                    static_cast<size_t>(std::clamp(tiles, 1.0, static_cast<double>(kTilesMax))));
    for (const PixelRect& tile : tiles_) result_.pixels += static_cast<int64_t>(tile.PixelCount());
    return absl::OkStatus();
  }

  // until: seconds since the start.
  absl::Status MeasureOne(const Omission& omission, double until, EffectMeasurement* effect) {
    absl::StatusOr<AblatedScene> without = omission.make();
    if (!without.ok()) return without.status();
    effect->ablation = without->how;
    const absl::StatusOr<CompiledScenePtr> compiled =
        CompileScene(std::move(without->scene), without->settings, files_, {}, omission.techniques);
    if (!compiled.ok()) return compiled.status();
    Rendering with(*whole_, tiles_), less(**compiled, tiles_);
    std::vector<double> seconds[2], sums[2];
    uint64_t turn = 0;
    for (; turn < kTurnsMax && (turn < 2 || SecondsSince(start_) < until); ++turn) {
      if (turn < 2 && SecondsSince(start_) > seconds_) {
        return absl::DeadlineExceededError("the time limit was reached");
      }
      const bool with_first = turn % 2 == 0;
      absl::StatusOr<TimedPass> first = (with_first ? with : less).Render(turn);
      absl::StatusOr<TimedPass> second = (with_first ? less : with).Render(turn);
      if (!first.ok()) return first.status();
      if (!second.ok()) return second.status();
      if (!with_first) std::swap(*first, *second);
      seconds[0].push_back(first->cpu_seconds);
      seconds[1].push_back(second->cpu_seconds);
      sums[0].push_back(first->sum);
      sums[1].push_back(second->sum);
    }
    // Both halves of the images have the same number of samples.
    const auto turns = static_cast<double>(turn);
    effect->samples = turn;
    effect->time_ratio = RatioOf(seconds[0], seconds[1]);
    effect->mean_change = RatioOf(sums[1], sums[0]);
    effect->mean_change.value -= 1;
    effect->relative_mse = RelMse(with, less, turns);
    effect->variance_ratio = VarianceOf(with, turns) / VarianceOf(less, turns);
    double total = 0;
    for (const double s : seconds[0]) total += s;
    result_.microseconds_per_sample = 1e6 * total / (turns * static_cast<double>(result_.pixels));
    return absl::OkStatus();
  }

  const SceneDescription& scene_;
  const FrameSettings& settings_;
  FileSource& files_;
  const double seconds_;
  const Clock::time_point start_ = Clock::now();
  CompiledScenePtr whole_;
  std::vector<PixelRect> tiles_;
  PlanMeasurement result_;
};

}  // namespace

absl::StatusOr<PlanMeasurement> MeasurePlan(const SceneDescription& scene,
                                            const FrameSettings& settings, FileSource& files,
                                            double seconds) {
  SHEAF_CHECK(!HasLightPaths(settings.techniques));
  if (!(seconds >= kMeasureSecondsMin && seconds <= kMeasureSecondsMax)) {
    return absl::InvalidArgumentError(
        absl::StrFormat("a measurement takes between %g and %g seconds, not %g", kMeasureSecondsMin,
                        kMeasureSecondsMax, seconds));
  }
  return Measurer(scene, settings, files, seconds).Measure();
}

namespace {

// Number of standard errors beyond which an effect counts as seen.
constexpr double kSeenDeviations = 2;

// "41.2 %"; an effect that makes a sample cheaper saves a fraction of the time without it.
std::string TimeText(const Measured& time_ratio) {
  if (std::fabs(time_ratio.value - 1) <= kSeenDeviations * time_ratio.error) return "none seen";
  if (time_ratio.value < 1) return absl::StrFormat("saves %.1f %%", 100 * (1 - time_ratio.value));
  return absl::StrFormat("%.1f %%", 100 * (1 - 1 / time_ratio.value));
}

// If either variance is 0 there is no ratio.
std::string VarianceText(double ratio) {
  return std::isfinite(ratio) && ratio > 0 ? absl::StrFormat("%.2fx", ratio) : "-";
}

}  // namespace

std::string FormatPlanMeasurement(const PlanMeasurement& measurement) {
  size_t width = 6;
  for (const EffectMeasurement& effect : measurement.effects) {
    width = std::max(width, effect.name.size());
  }
  const int name_width = static_cast<int>(width);
  std::string text = absl::StrFormat("%-*s  %12s  %-15s  %8s  %-17s  %9s  %s\n", name_width,
                                     "effect", "of the time", "time ratio", "variance",
                                     "mean without", "relMSE", "ablated scene");
  for (const EffectMeasurement& effect : measurement.effects) {
    absl::StrAppendFormat(&text, "%-*s  ", name_width, effect.name);
    if (!effect.problem.empty()) {
      absl::StrAppend(&text, "not measured: ", effect.problem, "\n");
      continue;
    }
    absl::StrAppendFormat(
        &text, "%12s  %6.3f +- %5.3f  %8s  %+7.2f +- %4.2f %%  %9s  %s\n",
        TimeText(effect.time_ratio), effect.time_ratio.value, effect.time_ratio.error,
        VarianceText(effect.variance_ratio), 100 * effect.mean_change.value,
        100 * effect.mean_change.error,
        effect.relative_mse > 0 ? absl::StrFormat("%.2g", effect.relative_mse) : "none seen",
        effect.ablation);
  }
  absl::StrAppendFormat(&text, "%.2f us per sample, %d pixels, %.1f s\n",
                        measurement.microseconds_per_sample, measurement.pixels,
                        measurement.seconds);
  return text;
}

}  // namespace sheaf::render
