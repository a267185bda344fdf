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
#include "cli/study/light_passes.h"
#include "cli/study/setting_renderer.h"
#include "cli/study/study_costs.h"
#include "cli/study/study_plan.h"
#include "cli/study/study_reference.h"
#include "cli/study/study_scenes.h"
#include "cli/study/study_tiles.h"
#include "common/film/error/error_estimate.h"
#include "coordinator/core/frame/sample_rounds.h"

namespace sheaf::cli {
namespace {

constexpr uint64_t kReferenceSeed = 0x5ea5eed;
// The maximum pixels of the frame on which kinds of light paths are distinguished; and the part of
// their time for its passes.
constexpr double kPathPixelsMax = 1 << 14, kLightPathsPart = 0.5;

using Clock = std::chrono::steady_clock;

class Study {
 public:
  Study(const SceneDescription& scene, const FrameSettings& settings, FileSource& files,
        const StudyOptions& options)
      : scene_(scene),
        settings_(settings),
        files_(files),
        options_(options),
        scenes_(scene, files, options.threads) {
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

  // Belongs to a setting, with the frame of its light passes.
  absl::StatusOr<StudyScene> Compile(const FrameSettings& settings,
                                     const render::CompileTechniques& techniques = {}) {
    return scenes_.Compile(settings, plan_.shrink, techniques);
  }
  bool HasLight() const { return HasLightPaths(settings_.techniques); }
  int64_t FramePixels() const { return coordinator::PathsPerLightPass(settings_); }

  absl::Status Prepare() {
    absl::StatusOr<StudyScene> base = Compile(settings_);
    if (!base.ok()) return base.status();
    ladder_ = MakeLadder(settings_, PlanOf(*base->frame));
    result_.not_studied = MissingLadders(settings_, PlanOf(*base->frame));
    const absl::StatusOr<StudyCosts> costs =
        MeasureCosts(options_.minutes, options_.threads, ladder_, &scenes_, &*base);
    if (!costs.ok()) return costs.status();
    const absl::StatusOr<StudyPlan> plan = PlanStudy(*costs);
    if (!plan.ok()) return plan.status();
    plan_ = *plan;
    tiles_ = ChooseTiles(settings_.window, plan_.tile_count);
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
    base_ = *std::move(base);
    if (absl::Status status = scenes_.CompileSmall(plan_.shrink, {}, &base_); !status.ok()) {
      return status;
    }
    result_.training_cpu_seconds = base_.training_cpu_seconds;
    if (HasLight()) NoteLight(*costs);
    return absl::OkStatus();
  }

  void NoteLight(const StudyCosts& costs) {
    const FrameSettings& frame = SettingsOf(*base_.light());
    StudyLight& light = result_.light.emplace();
    light.shrink = plan_.shrink;
    light.width_px = frame.window.Width();
    light.height_px = frame.window.Height();
    light.reference_passes = plan_.light_reference_blocks * kStudyBlockSamples;
    const double seconds = kLightPathsPart * kPathsFraction * Budget();
    const double paths = seconds / std::max(costs.seconds_per_light_path, 1e-12);
    light.paths_shrink =
        ShrinkTo(std::min(kPathPixelsMax, paths / kPathSamples), costs.frame_pixels);
  }

  absl::Status MakeReference() {
    FrameSettings settings = settings_;
    settings.seed ^= kReferenceSeed;
    settings.one_sequence = false;  // So that its own error can be estimated.
    const absl::StatusOr<StudyScene> scene = Compile(settings);
    if (!scene.ok()) return scene.status();
    TileRenderer renderer(*scene->frame, tiles_, options_.threads);
    const double until = Seconds() + 2 * kReferenceFraction * Budget();
    absl::Status status =
        RenderBlocks(&renderer, plan_.reference_blocks, [&] { return Seconds() < until; });
    if (!status.ok()) return status;
    result_.reference_samples = renderer.samples(0);
    result_.reference_cpu_seconds = scale_ * renderer.CpuSeconds();
    std::vector<TilePixels> camera = DevelopAll(renderer, tiles_.size());
    if (HasLight()) {
      status = AddReferenceLight(*scene, camera);
      if (!status.ok()) return status;
    } else {
      reference_.emplace(std::move(camera));
    }
    result_.reference_relative_mse = reference_->RelativeMse();
    return absl::OkStatus();
  }

  // Renders the reference's light passes, for the frame itself and for the smaller one, and keeps
  // those that the crops show.
  absl::Status AddReferenceLight(const StudyScene& scene, const std::vector<TilePixels>& camera) {
    const auto of_tiles = [&](LightPasses* passes) {
      return LightOfTiles(passes->Image(), tiles_, settings_.width_px, settings_.height_px);
    };
    PrintInfo("rendering light passes of the reference");
    LightPasses passes(*scene.frame, options_.threads);
    for (const uint64_t blocks : plan_.crops.blocks) {
      absl::Status status = passes.RenderUntil(blocks * kStudyBlockSamples);
      if (!status.ok()) return status;
      crop_light_.push_back(passes.Image());
    }
    absl::Status status = passes.RenderUntil(result_.light->reference_passes);
    if (!status.ok()) return status;
    result_.reference_cpu_seconds += passes.CpuSeconds(FramePixels());
    const std::vector<TilePixels> light = of_tiles(&passes);
    if (scene.small == nullptr) {
      reference_.emplace(camera, light, light);
      return absl::OkStatus();
    }
    LightPasses small(*scene.small, options_.threads);
    status = small.RenderUntil(result_.reference_samples);
    if (!status.ok()) return status;
    reference_.emplace(camera, light, of_tiles(&small));
    return absl::OkStatus();
  }

  // cpu_seconds: of the whole image. has_light: the pixels contain light paths.
  template <typename PixelsOf>
  StudyCheckpoint CheckpointOf(double samples, double cpu_seconds, bool has_light,
                               const PixelsOf& of) const {
    StudyCheckpoint checkpoint{samples, cpu_seconds, {}, {}};
    for (size_t tile = 0; tile < tiles_.size(); ++tile) {
      const TilePixels pixels = of(tile);
      checkpoint.error.push_back(reference_->ErrorOf(tile, pixels, has_light));
      checkpoint.variance.push_back(reference_->VarianceOf(tile, pixels));
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
    std::unique_ptr<StudyScene> scene;
    std::unique_ptr<SettingRenderer> renderer;
    std::vector<double> block_seconds;  // CPU time of each block.
  };

  absl::Status StartLadder(std::vector<Running>* running, std::vector<Clamped>* clamped) {
    for (const StudySetting& setting : ladder_) {
      if (setting.stops_tiles) continue;
      const size_t index = measurements_.size();
      measurements_.push_back({setting, {}});
      if (setting.clamp_means != 0) {
        clamped->push_back({index, {tiles_, setting.clamp_means * reference_->mean()}});
        continue;
      }
      absl::StatusOr<StudyScene> scene = Compile(setting.settings, setting.techniques);
      if (!scene.ok()) {
        measurements_.pop_back();
        result_.not_studied.push_back(
            absl::StrCat(setting.name, ": ", std::string(scene.status().message())));
        continue;
      }
      auto kept = std::make_unique<StudyScene>(*std::move(scene));
      auto renderer = std::make_unique<SettingRenderer>(*kept, tiles_, scale_, options_.threads);
      running->push_back({index, std::move(kept), std::move(renderer), {}});
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
    for (uint64_t block = 0; block < plan_.blocks && (block < kStudyBlocksMin || Seconds() < until);
         ++block) {
      for (size_t i = 0; i < running.size(); ++i) {
        Running& one = running[(i + block) % running.size()];
        const bool is_base = measurements_[one.measurement].setting.is_base;
        const double before = one.renderer->CpuSeconds();
        const absl::Status status = one.renderer->tiles().RenderBlock(
            nullptr, is_base ? TileRenderer::OnPart(on_part) : TileRenderer::OnPart());
        if (!status.ok()) return status;
        one.block_seconds.push_back(one.renderer->CpuSeconds() - before);
      }
      if (std::has_single_bit(block + 1)) NoteCheckpoints(block + 1, running, clamped);
    }
    for (const Running& one : running) {
      measurements_[one.measurement].time_deviation =
          RatioDeviation(one.block_seconds, running.front().block_seconds);
    }
    NoteBaseCosts(*running.front().renderer);
    std::vector<PixelRect> rects;
    target_ = EstimateError(running.front().renderer->tiles().Pack(&rects)).relative_mse;
    return absl::OkStatus();
  }

  void NoteCheckpoints(uint64_t blocks, const std::vector<Running>& running,
                       const std::vector<Clamped>& clamped) {
    const auto samples = static_cast<double>(blocks * kStudyBlockSamples);
    for (const Running& one : running) {
      measurements_[one.measurement].checkpoints.push_back(
          CheckpointOf(samples, one.renderer->CpuSeconds(), one.renderer->has_light(),
                       [&](size_t tile) { return one.renderer->tiles().Develop(tile); }));
    }
    SettingRenderer& base = *running.front().renderer;
    for (const Clamped& one : clamped) {
      const auto pixels_of = [&](size_t tile) {
        TilePixels pixels = one.tiles.Develop(tile);
        base.AddLightTo(tiles_[tile], &pixels);
        return pixels;
      };
      measurements_[one.measurement].checkpoints.push_back(
          CheckpointOf(samples, base.CpuSeconds(), base.has_light(), pixels_of));
    }
    PrintInfo(absl::StrFormat("%.0f samples", samples));
  }

  void NoteBaseCosts(const SettingRenderer& base) {
    const TileRenderer& tiles = base.tiles();
    for (size_t tile = 0; tile < tiles_.size(); ++tile) {
      base_seconds_per_sample_.push_back(tiles.cpu_seconds(tile) /
                                         static_cast<double>(tiles.samples(tile)));
    }
    const auto samples = static_cast<double>(tiles.samples(0));
    result_.cpu_seconds_per_sample = scale_ * tiles.CpuSeconds() / samples;
    if (!result_.light) return;
    result_.light->cpu_seconds_per_pass = base.LightCpuSeconds() / samples;
    result_.cpu_seconds_per_sample += result_.light->cpu_seconds_per_pass;
  }

  // CPU seconds of the whole image with the tiles' numbers of samples, at the base's times.
  double BaseSecondsOf(const TileRenderer& renderer) const {
    double cpu_seconds = 0;
    uint64_t most = 0;
    for (size_t tile = 0; tile < tiles_.size(); ++tile) {
      cpu_seconds += static_cast<double>(renderer.samples(tile)) * base_seconds_per_sample_[tile];
      most = std::max(most, renderer.samples(tile));
    }
    cpu_seconds = scale_ * cpu_seconds + result_.training_cpu_seconds;
    if (!result_.light) return cpu_seconds;
    return cpu_seconds + static_cast<double>(most) * result_.light->cpu_seconds_per_pass;
  }

  // Renders until the error of the base's last image is reached, in rounds as the coordinator
  // decides them. Its time is computed from the base's time per sample in each tile, for a fair
  // comparison.
  absl::Status MeasureStopping() {
    const auto setting = std::find_if(ladder_.begin(), ladder_.end(),
                                      [](const StudySetting& s) { return s.stops_tiles; });
    if (setting == ladder_.end() || !(target_ > 0)) return absl::OkStatus();
    StudyMeasurement measured{*setting, {}};
    SettingRenderer stopping(base_, tiles_, scale_, options_.threads);
    TileRenderer& renderer = stopping.tiles();
    const double until = (1 - kEffectsFraction - kPathsFraction - kCropsFraction) * Budget() * 1.1;
    const uint64_t samples_max = 4 * plan_.blocks * kStudyBlockSamples;
    std::vector<uint64_t> wanted(tiles_.size(), kStudyBlockSamples);
    std::vector<coordinator::CellRound> before;
    for (int round = 0; !wanted.empty() && (round < 2 || Seconds() < until); ++round) {
      const uint64_t most = *std::max_element(wanted.begin(), wanted.end());
      for (uint64_t n = 0; n < most; n += kStudyBlockSamples) {
        if (absl::Status status = renderer.RenderBlock(&wanted); !status.ok()) return status;
      }
      double samples = 0;
      std::vector<PixelRect> rects;
      const FrameImage packed = renderer.Pack(&rects);
      const std::vector<ErrorSums> errors = EstimateTileErrors(packed, rects);
      std::vector<coordinator::CellRound> tiles;
      for (size_t tile = 0; tile < tiles_.size(); ++tile) {
        samples += static_cast<double>(renderer.samples(tile)) * pixel_counts_[tile] /
                   static_cast<double>(result_.pixels);
        tiles.push_back({renderer.samples(tile), errors[tile]});
      }
      measured.checkpoints.push_back(
          CheckpointOf(samples, BaseSecondsOf(renderer), stopping.has_light(),
                       [&](size_t tile) { return renderer.Develop(tile); }));
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
        ChooseCrops(settings_.window, plan_.crops, tiles_,
                    tells_variance ? last.variance : last.error, pixel_counts_);
    const double until = Seconds() + 2 * kCropsFraction * Budget();
    absl::StatusOr<std::vector<StudyCrop>> crops =
        RenderCrops(*base_.frame, regions, plan_.crops, crop_light_, options_.threads,
                    [&] { return Seconds() < until; });
    if (!crops.ok()) return crops.status();
    result_.crops = *std::move(crops);
    crop_light_.clear();
    for (size_t i = 0; i < result_.crops.front().images.size(); ++i) {
      const auto samples = static_cast<double>(plan_.crops.blocks[i] * kStudyBlockSamples);
      result_.prices.push_back(
          {samples, result_.training_cpu_seconds + samples * result_.cpu_seconds_per_sample,
           ErrorAt(result_.curves.front(), samples)});
    }
    return absl::OkStatus();
  }

  absl::Status MeasurePaths() {
    FrameSettings settings = settings_;
    settings.outputs.AddLightPaths();
    const absl::StatusOr<StudyScene> scene =
        scenes_.Compile(settings, result_.light ? result_.light->paths_shrink : 0);
    if (!scene.ok()) return scene.status();
    const double part = HasLight() ? 1 - kLightPathsPart : 1;
    absl::StatusOr<StudyPaths> paths = MeasurePathNoise(
        *scene, tiles_, reference_->mean(), options_.threads, part * kPathsFraction * Budget());
    if (!paths.ok()) return paths.status();
    result_.paths = std::move(paths->paths);
    result_.unreliable_tiles = std::move(paths->unreliable_tiles);
    result_.assessed_tile_count = paths->assessed_tile_count;
    if (result_.assessed_tile_count < tiles_.size()) {
      result_.not_studied.push_back(
          absl::StrCat("kinds of paths of ", tiles_.size() - result_.assessed_tile_count, " of ",
                       tiles_.size(), " tiles: the time limit was reached"));
    }
    return absl::OkStatus();
  }

  absl::Status MeasureEffects() {
    const double seconds =
        std::max(kEffectsFraction * Budget(), std::min(0.97 * Budget() - Seconds(), Budget() / 4));
    FrameSettings settings = settings_;
    settings.techniques = settings.techniques.Without(Technique::kLightPaths);
    absl::StatusOr<render::PlanMeasurement> effects =
        render::MeasurePlan(scene_, settings, files_, seconds);
    if (!effects.ok()) return effects.status();
    result_.effects = *std::move(effects);
    return absl::OkStatus();
  }

  const SceneDescription& scene_;
  FrameSettings settings_;
  FileSource& files_;
  const StudyOptions& options_;
  const Clock::time_point start_ = Clock::now();

  StudyScenes scenes_;
  StudyScene base_;
  std::vector<StudySetting> ladder_;
  StudyPlan plan_;
  std::vector<PixelRect> tiles_;
  std::vector<double> pixel_counts_;
  double scale_ = 1;  // Pixels of the window over those of the tiles.
  std::optional<StudyReference> reference_;
  std::vector<FrameImage> crop_light_;  // Light paths at the crops' prices; empty without such.
  std::vector<StudyMeasurement> measurements_;
  std::vector<double> base_seconds_per_sample_;  // By tile.
  double target_ = 0;                            // Target error for tiles that stop.
  StudyResult result_;
};

}  // namespace

absl::StatusOr<StudyResult> RunStudy(const SceneDescription& scene, const FrameSettings& settings,
                                     FileSource& files, const StudyOptions& options) {
  if (!(options.minutes >= kStudyMinutesMin && options.minutes <= kStudyMinutesMax)) {
    return absl::InvalidArgumentError(absl::StrFormat("a study takes %g to %g minutes, not %g",
                                                      kStudyMinutesMin, kStudyMinutesMax,
                                                      options.minutes));
  }
  return Study(scene, settings, files, options).Run();
}

}  // namespace sheaf::cli
