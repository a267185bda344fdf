// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "cli/study/study.h"

#include <algorithm>
#include <bit>
#include <chrono>
#include <cmath>
#include <memory>
#include <utility>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "cli/study/clamped_tiles.h"
#include "cli/study/study_tiles.h"
#include "common/base/check.h"
#include "common/film/error/error_estimate.h"
#include "common/film/error/mean_interval.h"
#include "coordinator/core/sample_rounds.h"

namespace sheaf::cli {
namespace {

constexpr int32_t kTileSizePx = 16;
// With fewer tiles their spread is a poor estimate.
constexpr size_t kTilesMin = 24;
constexpr size_t kTilesMax = 2048;
constexpr uint64_t kBlocksMin = 4, kBlocksMax = 64;  // For each setting; powers of two.
// Fractions of the time; the rest is for compiling scenes.
constexpr double kReferenceFraction = 0.27, kLadderFraction = 0.36, kCropsFraction = 0.08,
                 kPathsFraction = 0.08, kEffectsFraction = 0.15;
constexpr uint64_t kReferenceSeed = 0x5ea5eed;
constexpr uint64_t kPathSamples = 64;
// Guess of a setting's mean cost relative to the base; the clock ends the measurement in any case.
constexpr double kSettingCost = 1.1;

using Clock = std::chrono::steady_clock;

// Tiles of the window, evenly spaced if there are more than count.
std::vector<PixelRect> ChooseTiles(const PixelRect& window, size_t count) {
  const std::vector<PixelRect> all = CutTiles(window, kTileSizePx);
  count = std::min(count, all.size());
  std::vector<PixelRect> tiles;
  tiles.reserve(count);
  for (size_t i = 0; i < count; ++i) tiles.push_back(all[(2 * i + 1) * all.size() / (2 * count)]);
  return tiles;
}

class Study {
 public:
  Study(const SceneDescription& scene, const FrameSettings& settings, FileSource& files,
        const StudyOptions& options)
      : scene_(scene), settings_(settings), files_(files), options_(options) {
    // Only the outputs that the image needs; a study measures kinds of paths itself.
    settings_.outputs = {};
    settings_.lattice = {};
  }

  absl::StatusOr<StudyResult> Run() {
    const std::pair<const char*, absl::Status (Study::*)()> steps[] = {
        {"compiling the scene", &Study::Prepare},
        {"rendering the reference", &Study::MakeReference},
        {"rendering with each setting", &Study::MeasureLadder},
        {"rendering with adaptive sampling", &Study::MeasureStopping},
        {"rendering crops of the image", &Study::RenderPrices},
        {"measuring kinds of paths", &Study::MeasurePaths},
        {"measuring effects", &Study::MeasureEffects}};
    for (const auto& [what, step] : steps) {
      PrintInfo(what);
      if (absl::Status status = (this->*step)(); !status.ok()) return status;
    }
    result_.seconds = Seconds();
    result_.recommendation = Recommend(result_);
    return std::move(result_);
  }

 private:
  double Seconds() const { return std::chrono::duration<double>(Clock::now() - start_).count(); }
  double Budget() const { return options_.minutes * 60; }
  void PrintInfo(const std::string& what) const {
    if (options_.on_progress) options_.on_progress(absl::StrFormat("%5.0f s  %s", Seconds(), what));
  }

  absl::StatusOr<render::CompiledScenePtr> Compile(
      const FrameSettings& settings, const render::CompileTechniques& techniques = {}) {
    return render::CompileScene(scene_, settings, files_,
                                {.build_threads = static_cast<uint32_t>(options_.threads)},
                                techniques);
  }

  // Sizes the study by the time that a block takes.
  absl::Status Prepare() {
    absl::StatusOr<render::CompiledScenePtr> base = Compile(settings_);
    if (!base.ok()) return base.status();
    base_ = *std::move(base);
    ladder_ = MakeLadder(settings_, PlanOf(*base_));
    result_.not_studied = MissingLadders(PlanOf(*base_));
    const std::vector<PixelRect> trial_tiles = ChooseTiles(settings_.window, kTilesMin);
    TileRenderer trial(*base_, trial_tiles, options_.threads);
    double seconds_per_tile = 0;   // For a block.
    for (int i = 0; i < 2; ++i) {  // The first run warms caches.
      const double begin = Seconds();
      if (absl::Status status = trial.RenderBlock(); !status.ok()) return status;
      seconds_per_tile = (Seconds() - begin) / static_cast<double>(trial_tiles.size());
    }
    const auto rendered = static_cast<double>(std::count_if(
        ladder_.begin(), ladder_.end(), [](const StudySetting& s) { return s.clamp_means == 0; }));
    // Number of tiles times blocks per setting.
    const double affordable =
        kLadderFraction * Budget() / (rendered * kSettingCost * std::max(seconds_per_tile, 1e-7));
    blocks_ = kBlocksMin * 4;
    while (blocks_ > kBlocksMin && affordable / static_cast<double>(blocks_) < kTilesMin) {
      blocks_ /= 2;
    }
    const double count = affordable / static_cast<double>(blocks_);
    if (count < 2) {
      return absl::ResourceExhaustedError(
          absl::StrFormat("%g minutes are too few for this scene: 16 samples of %d x %d pixels "
                          "take %.2g s; give --minutes %.0f",
                          options_.minutes, kTileSizePx, kTileSizePx, seconds_per_tile,
                          std::ceil(options_.minutes * kTilesMin / count)));
    }
    tiles_ = ChooseTiles(settings_.window, std::min(static_cast<size_t>(count), kTilesMax));
    const double blocks = affordable / static_cast<double>(tiles_.size());
    blocks_ = std::clamp(std::bit_floor(static_cast<uint64_t>(blocks)), kBlocksMin, kBlocksMax);
    reference_blocks_ = static_cast<uint64_t>(std::max(
        2.0 * static_cast<double>(blocks_),
        kReferenceFraction * Budget() / (seconds_per_tile * static_cast<double>(tiles_.size()))));
    crop_plan_ = PlanCrops(kCropsFraction * Budget() / std::max(seconds_per_tile, 1e-7));
    for (const PixelRect& tile : tiles_) {
      pixel_counts_.push_back(static_cast<double>(tile.PixelCount()));
      result_.pixels += tile.PixelCount();
    }
    result_.width_px = settings_.window.Width();
    result_.height_px = settings_.window.Height();
    result_.threads = options_.threads;
    result_.farm = options_.farm;
    scale_ =
        static_cast<double>(settings_.window.PixelCount()) / static_cast<double>(result_.pixels);
    return absl::OkStatus();
  }

  absl::Status MakeReference() {
    FrameSettings settings = settings_;
    settings.seed ^= kReferenceSeed;
    settings.one_sequence = false;  // So that its own error can be estimated.
    const absl::StatusOr<render::CompiledScenePtr> scene = Compile(settings);
    if (!scene.ok()) return scene.status();
    TileRenderer renderer(**scene, tiles_, options_.threads);
    const double until = Seconds() + 2 * kReferenceFraction * Budget();
    absl::StatusOr<StudyReference> reference = RenderReference(
        &renderer, tiles_.size(), reference_blocks_, [&] { return Seconds() < until; });
    if (!reference.ok()) return reference.status();
    reference_ = *std::move(reference);
    result_.reference_samples = reference_.samples;
    result_.reference_cpu_seconds = scale_ * reference_.cpu_seconds;
    for (size_t tile = 0; tile < tiles_.size(); ++tile) {
      reference_variance_.push_back(VarianceOf(tile, reference_.tiles[tile]));
      result_.reference_relative_mse +=
          reference_variance_.back() / static_cast<double>(result_.pixels);
    }
    return absl::OkStatus();
  }

  double VarianceOf(size_t tile, const TilePixels& pixels) const {
    return reference_.RelativeSum(tile, [&](size_t c, size_t p) {
      const double d = pixels.deviation[p][c];
      return d * d;
    });
  }
  double ErrorOf(size_t tile, const TilePixels& pixels) const {
    const TilePixels& truth = reference_.tiles[tile];
    const double error = reference_.RelativeSum(tile, [&](size_t c, size_t p) {
      const double d = static_cast<double>(pixels.value[p][c]) - truth.value[p][c];
      return d * d;
    });
    return error - reference_variance_[tile];
  }
  template <typename PixelsOf>
  StudyCheckpoint CheckpointOf(double samples, double cpu_seconds, const PixelsOf& of) const {
    StudyCheckpoint checkpoint{samples, scale_ * cpu_seconds, {}, {}};
    for (size_t tile = 0; tile < tiles_.size(); ++tile) {
      const TilePixels pixels = of(tile);
      checkpoint.error.push_back(ErrorOf(tile, pixels));
      checkpoint.variance.push_back(VarianceOf(tile, pixels));
    }
    return checkpoint;
  }

  struct Clamped {
    size_t measurement;  // Index into measurements_.
    ClampedTiles tiles;
  };
  // A setting that is rendered in turns with others.
  struct Running {
    size_t measurement;  // Index into measurements_.
    render::CompiledScenePtr scene;
    std::unique_ptr<TileRenderer> renderer;
    std::vector<double> block_seconds;  // CPU time of each block.
  };

  absl::Status StartLadder(std::vector<Running>* running, std::vector<Clamped>* clamped) {
    for (const StudySetting& setting : ladder_) {
      if (setting.stops_tiles) continue;
      const size_t index = measurements_.size();
      measurements_.push_back({setting, {}});
      if (setting.clamp_means != 0) {
        clamped->push_back({index, {tiles_, setting.clamp_means * reference_.mean}});
        continue;
      }
      absl::StatusOr<render::CompiledScenePtr> scene =
          Compile(setting.settings, setting.techniques);
      if (!scene.ok()) {
        measurements_.pop_back();
        result_.not_studied.push_back(
            absl::StrCat(setting.name, ": ", std::string(scene.status().message())));
        continue;
      }
      auto renderer = std::make_unique<TileRenderer>(**scene, tiles_, options_.threads);
      running->push_back({index, *std::move(scene), std::move(renderer), {}});
    }
    return absl::OkStatus();
  }

  // Renders one block of each setting in turn, so that disturbances of the machine affect all
  // settings alike.
  absl::Status MeasureLadder() {
    std::vector<Running> running;
    std::vector<Clamped> clamped;
    if (absl::Status status = StartLadder(&running, &clamped); !status.ok()) return status;
    const auto on_part = [&](size_t tile, const FilmTile& part) {
      for (Clamped& one : clamped) one.tiles.Add(tile, part);
    };
    const double until = (1 - kEffectsFraction - kPathsFraction - kCropsFraction) * Budget();
    for (uint64_t block = 0; block < blocks_ && (block < kBlocksMin || Seconds() < until);
         ++block) {
      for (size_t i = 0; i < running.size(); ++i) {
        Running& one = running[(i + block) % running.size()];
        const bool is_base = measurements_[one.measurement].setting.is_base;
        const double before = one.renderer->CpuSeconds();
        const absl::Status status = one.renderer->RenderBlock(
            nullptr, is_base ? TileRenderer::OnPart(on_part) : TileRenderer::OnPart());
        if (!status.ok()) return status;
        one.block_seconds.push_back(one.renderer->CpuSeconds() - before);
      }
      if (!std::has_single_bit(block + 1)) continue;
      const auto samples = static_cast<double>((block + 1) * kStudyBlockSamples);
      for (const Running& one : running) {
        measurements_[one.measurement].checkpoints.push_back(
            CheckpointOf(samples, one.renderer->CpuSeconds(),
                         [&](size_t tile) { return one.renderer->Develop(tile); }));
      }
      for (const Clamped& one : clamped) {
        measurements_[one.measurement].checkpoints.push_back(
            CheckpointOf(samples, running.front().renderer->CpuSeconds(),
                         [&](size_t tile) { return one.tiles.Develop(tile); }));
      }
      PrintInfo(absl::StrFormat("%.0f samples", samples));
    }
    for (const Running& one : running) {
      measurements_[one.measurement].time_deviation =
          RatioDeviation(one.block_seconds, running.front().block_seconds);
    }
    const TileRenderer& base = *running.front().renderer;
    for (size_t tile = 0; tile < tiles_.size(); ++tile) {
      base_seconds_per_sample_.push_back(base.cpu_seconds(tile) /
                                         static_cast<double>(base.samples(tile)));
    }
    result_.cpu_seconds_per_sample =
        scale_ * base.CpuSeconds() / static_cast<double>(base.samples(0));
    std::vector<PixelRect> rects;
    target_ = EstimateError(base.Pack(&rects)).relative_mse;
    return absl::OkStatus();
  }

  // Renders until the error of the base's last image is reached, in rounds as the coordinator
  // decides them. Its time is computed from the base's time per sample in each tile, for a fair
  // comparison.
  absl::Status MeasureStopping() {
    const auto setting = std::find_if(ladder_.begin(), ladder_.end(),
                                      [](const StudySetting& s) { return s.stops_tiles; });
    if (setting == ladder_.end() || !(target_ > 0)) return absl::OkStatus();
    StudyMeasurement measured{*setting, {}};
    TileRenderer renderer(*base_, tiles_, options_.threads);
    const double until = (1 - kEffectsFraction - kPathsFraction - kCropsFraction) * Budget() * 1.1;
    const uint64_t samples_max = 4 * blocks_ * kStudyBlockSamples;
    std::vector<uint64_t> wanted(tiles_.size(), kStudyBlockSamples);
    std::vector<coordinator::CellRound> before;
    for (int round = 0; !wanted.empty() && (round < 2 || Seconds() < until); ++round) {
      const uint64_t most = *std::max_element(wanted.begin(), wanted.end());
      for (uint64_t n = 0; n < most; n += kStudyBlockSamples) {
        if (absl::Status status = renderer.RenderBlock(&wanted); !status.ok()) return status;
      }
      double samples = 0, cpu_seconds = 0;
      std::vector<PixelRect> rects;
      const FrameImage packed = renderer.Pack(&rects);
      const std::vector<ErrorSums> errors = EstimateTileErrors(packed, rects);
      std::vector<coordinator::CellRound> tiles;
      for (size_t tile = 0; tile < tiles_.size(); ++tile) {
        const auto count = static_cast<double>(renderer.samples(tile));
        samples += count * pixel_counts_[tile] / static_cast<double>(result_.pixels);
        cpu_seconds += count * base_seconds_per_sample_[tile];
        tiles.push_back({renderer.samples(tile), errors[tile]});
      }
      measured.checkpoints.push_back(
          CheckpointOf(samples, cpu_seconds, [&](size_t tile) { return renderer.Develop(tile); }));
      wanted =
          coordinator::DecideRound({.target_error = target_}, samples_max, round, tiles, before, {})
              .samples;
      before = std::move(tiles);
    }
    measurements_.insert(measurements_.begin() + 1, std::move(measured));
    return absl::OkStatus();
  }

  // Analyzes the measurements, which say where errors are, and renders crops there.
  absl::Status RenderPrices() {
    result_.curves = AnalyzeStudy(measurements_, pixel_counts_);
    const StudyCheckpoint& last = measurements_.front().checkpoints.back();
    const bool tells_variance = !settings_.one_sequence;
    const std::vector<CropRegion> regions =
        ChooseCrops(settings_.window, crop_plan_, tiles_,
                    tells_variance ? last.variance : last.error, pixel_counts_);
    const double until = Seconds() + 2 * kCropsFraction * Budget();
    absl::StatusOr<std::vector<StudyCrop>> crops = RenderCrops(
        *base_, regions, crop_plan_, options_.threads, [&] { return Seconds() < until; });
    if (!crops.ok()) return crops.status();
    result_.crops = *std::move(crops);
    for (size_t i = 0; i < result_.crops.front().images.size(); ++i) {
      const auto samples = static_cast<double>(crop_plan_.blocks[i] * kStudyBlockSamples);
      result_.prices.push_back({samples, samples * result_.cpu_seconds_per_sample,
                                ErrorAt(result_.curves.front(), samples)});
    }
    return absl::OkStatus();
  }

  absl::Status MeasurePaths() {
    FrameSettings settings = settings_;
    settings.outputs.AddLightPaths();
    const absl::StatusOr<render::CompiledScenePtr> scene = Compile(settings);
    if (!scene.ok()) return scene.status();
    std::vector<render::PathNoiseSums> of_tiles(tiles_.size());
    std::vector<char> done(tiles_.size());
    const double until = Seconds() + kPathsFraction * Budget();
    const absl::Status status = ForEachTile(options_.threads, tiles_.size(), [&](size_t i) {
      // Every eighth tile first, so that the tiles that fit into the time are spread over the
      // frame.
      const size_t tile = Interleaved(i, tiles_.size());
      if (Seconds() > until && i > 0) return absl::OkStatus();
      absl::StatusOr<render::PathNoiseSums> sums =
          render::PathNoiseSums::Of(**scene, tiles_[tile], kPathSamples, 0.1 * 3 * reference_.mean);
      if (!sums.ok()) return sums.status();
      of_tiles[tile] = *std::move(sums);
      done[tile] = 1;
      return absl::OkStatus();
    });
    if (!status.ok()) return status;
    render::PathNoiseSums all;
    size_t count = 0;
    for (size_t tile = 0; tile < tiles_.size(); ++tile) {
      if (done[tile] == 0) continue;
      ++count;
      all.Add(of_tiles[tile]);
      NoteUnreliable(tile, of_tiles[tile].Fractions());
    }
    const render::PathNoise noise = all.Fractions();
    for (size_t k = 0; k < kLightPathKindCount; ++k) {
      if (noise.kinds[k].light == 0) continue;
      result_.paths.push_back({static_cast<LightPathKind>(k), noise.kinds[k]});
    }
    result_.assessed_tile_count = count;
    if (count < tiles_.size()) {
      result_.not_studied.push_back(absl::StrCat("kinds of paths of ", tiles_.size() - count,
                                                 " of ", tiles_.size(),
                                                 " tiles: the time limit was reached"));
    }
    return absl::OkStatus();
  }

  static size_t Interleaved(size_t i, size_t count) {
    constexpr size_t kStride = 8;
    for (size_t first = 0; first < kStride; ++first) {
      const size_t in_turn = (count + kStride - 1 - first) / kStride;
      if (i < in_turn) return first + i * kStride;
      i -= in_turn;
    }
    return 0;
  }

  void NoteUnreliable(size_t tile, const render::PathNoise& noise) {
    if (noise.one_replicate_fraction <= kOneReplicateMax) return;
    const auto worst =
        std::max_element(noise.kinds.begin(), noise.kinds.end(),
                         [](const auto& a, const auto& b) { return a.variance < b.variance; });
    result_.unreliable_tiles.push_back(
        {tiles_[tile], static_cast<LightPathKind>(worst - noise.kinds.begin()), worst->variance});
  }

  absl::Status MeasureEffects() {
    const double seconds =
        std::max(kEffectsFraction * Budget(), std::min(0.97 * Budget() - Seconds(), Budget() / 4));
    absl::StatusOr<render::PlanMeasurement> effects =
        render::MeasurePlan(scene_, settings_, files_, seconds);
    if (!effects.ok()) return effects.status();
    result_.effects = *std::move(effects);
    return absl::OkStatus();
  }

  const SceneDescription& scene_;
  FrameSettings settings_;
  FileSource& files_;
  const StudyOptions& options_;
  const Clock::time_point start_ = Clock::now();

  render::CompiledScenePtr base_;
  std::vector<StudySetting> ladder_;
  std::vector<PixelRect> tiles_;
  std::vector<double> pixel_counts_;
  double scale_ = 1;  // Pixels of the window over those of the tiles.
  uint64_t blocks_ = 0, reference_blocks_ = 0;
  CropPlan crop_plan_;
  StudyReference reference_;
  std::vector<double> reference_variance_;  // By tile, as ErrorOf returns.
  std::vector<StudyMeasurement> measurements_;
  std::vector<double> base_seconds_per_sample_;  // By tile.
  double target_ = 0;                            // Target error for tiles that stop.
  StudyResult result_;
};

}  // namespace

absl::StatusOr<StudyResult> RunStudy(const SceneDescription& scene, const FrameSettings& settings,
                                     FileSource& files, const StudyOptions& options) {
  SHEAF_CHECK(!HasLightPaths(settings.techniques));
  if (!(options.minutes >= kStudyMinutesMin && options.minutes <= kStudyMinutesMax)) {
    return absl::InvalidArgumentError(absl::StrFormat("a study takes %g to %g minutes, not %g",
                                                      kStudyMinutesMin, kStudyMinutesMax,
                                                      options.minutes));
  }
  return Study(scene, settings, files, options).Run();
}

}  // namespace sheaf::cli
