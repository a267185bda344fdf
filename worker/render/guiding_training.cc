// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "worker/render/guiding_training.h"

#include <algorithm>
#include <atomic>
#include <cmath>
#include <thread>
#include <utility>

#include "common/base/cpu_clock.h"
#include "common/base/mutex.h"
#include "common/base/parallel.h"
#include "worker/render/guiding/contribution_statistics.h"
#include "worker/render/guiding/emission_statistics.h"
#include "worker/render/guiding/guiding_statistics.h"
#include "worker/render/guiding/learned_fields.h"
#include "worker/render/guiding/light_tries.h"
#include "worker/render/guiding/training_size.h"
#include "worker/render/integrator/variants.h"
#include "worker/render/scene/compiled_scene.h"

namespace sheaf::render {
namespace {

// Paths that one thread traces before it looks for a request to stop.
constexpr uint64_t kPathsAtOnce = 256;
// Paths that find the scale of the light, and how far below it values are still told apart.
constexpr uint64_t kScalePaths = 4096;
constexpr int kScaleBits = 20;

// Finds the scale of the light: the mean binary exponent of what paths find. A sum of integers, so
// that neither the order of the paths nor the unit of the light matters.
class ScaleSink : public GuidingSink {
 public:
  void AddDirection(const FoundLight& found) override {
    if (!(found.scattered > 0) || !std::isfinite(found.scattered)) return;
    int exponent = 0;
    std::frexp(found.scattered, &exponent);
    sum_.fetch_add(exponent, std::memory_order_relaxed);
    count_.fetch_add(1, std::memory_order_relaxed);
  }
  void AddLight(const TriedLight&) override {}
  void AddPath(int32_t, int32_t, double, uint64_t) override {}
  // 0 where there is no light.
  int Exponent() const {
    const int64_t count = count_;
    if (count == 0) return 0;
    return static_cast<int>(std::floor(static_cast<double>(sum_) / static_cast<double>(count)));
  }

 private:
  std::atomic<int64_t> sum_ = 0, count_ = 0;
};

// Learns where light comes from.
class DirectionsSink : public GuidingSink {
 public:
  explicit DirectionsSink(GuidingStatistics* statistics) : statistics_(statistics) {}
  void AddDirection(const FoundLight& found) override { statistics_->Add(found); }
  void AddLight(const TriedLight&) override {}
  void AddPath(int32_t, int32_t, double, uint64_t) override {}

 private:
  GuidingStatistics* const statistics_;
};

// Learns which lights are hidden from each region of the finished field.
class LightsSink : public GuidingSink {
 public:
  LightsSink(const GuidingField& field, LightVisibilityStatistics* statistics)
      : field_(field), statistics_(statistics) {}
  void AddDirection(const FoundLight&) override {}
  void AddLight(const TriedLight& tried) override {
    statistics_->Add(field_.RegionIndexAt(tried.from), tried.light, tried.is_visible);
  }
  void AddPath(int32_t, int32_t, double, uint64_t) override {}

 private:
  const GuidingField& field_;
  LightVisibilityStatistics* const statistics_;
};

// Collects tries of lights.
class TriesSink : public GuidingSink {
 public:
  explicit TriesSink(LightTries* tries) : tries_(tries) {}
  void AddDirection(const FoundLight&) override {}
  void AddLight(const TriedLight& tried) override { tries_->Add(tried); }
  void AddPath(int32_t, int32_t, double, uint64_t) override {}

 private:
  LightTries* const tries_;
};

// Learns what paths contribute, by regions of the finished field and by pixels.
class ContributionsSink : public GuidingSink {
 public:
  ContributionsSink(const GuidingField& field, ContributionStatistics* statistics)
      : field_(field), statistics_(statistics) {}
  void AddDirection(const FoundLight& found) override {
    statistics_->AddVertex(field_.RegionIndexAt(found.from), found.scattered, found.rays);
  }
  void AddLight(const TriedLight&) override {}
  void AddPath(int32_t x, int32_t y, double radiance, uint64_t rays) override {
    statistics_->AddPath(x, y, radiance, rays);
  }

 private:
  const GuidingField& field_;
  ContributionStatistics* const statistics_;
};

class Training {
 public:
  Training(const CompiledScene& scene, uint32_t threads, std::stop_token stop,
           const TrainingPaths& paths = {})
      : scene_(scene),
        paths_(SizesFor(scene, paths)),
        threads_(static_cast<int>(std::max(1u, threads))),
        stop_(std::move(stop)),
        train_(LearnsFromCamera(scene.settings.techniques) ? FunctionFor(scene) : nullptr) {}

  absl::StatusOr<LearnedFields> Run() {
    const FrameSettings& settings = scene_.settings;
    const uint64_t paths = paths_.first;
    LearnedFields fields{GuidingField(BoxOf(scene_)), {}, {}, {}};
    if (GuidesEmission(settings.techniques)) {
      if (!LearnEmission(paths_.emission_first, &fields)) return Cancelled();
      emission_rays_ = counts_.rays;
    }
    if (!LearnsFromCamera(settings.techniques)) return fields;
    if (!IsGuided(settings.techniques)) {
      if (!LearnLights(paths_.lights, &fields)) return Cancelled();
      return fields;
    }
    ScaleSink scale;
    if (!Trace(0, fields, std::min(kScalePaths, paths), &scale)) return Cancelled();
    const int unit_exponent = std::clamp(scale.Exponent() - kScaleBits, -kGuidingUnitExponentMax,
                                         kGuidingUnitExponentMax);
    GuidingSums sums;
    for (uint32_t i = 0; i < kTrainingIterations; ++i) {
      GuidingStatistics statistics(fields.directions, unit_exponent);
      DirectionsSink sink(&statistics);
      if (!Trace(i, fields, paths << i, &sink)) return Cancelled();
      fields.directions = Refine(fields.directions, statistics, static_cast<int>(i), &sums);
    }
    const bool has_lights = LearnsLights(settings.techniques)
                                ? LearnLights(paths << kLightsShift, &fields)
                                : LearnVisibility(paths << kLightsShift, &fields);
    if (!has_lights) return Cancelled();
    if (SplitsPaths(settings.techniques) &&
        !LearnContributions(paths << kContributionsShift, unit_exponent, &fields)) {
      return Cancelled();
    }
    return fields;
  }

  void AddTo(RenderStats* stats) const {
    stats->rays += counts_.rays;
    stats->shadow_rays += counts_.shadow_rays;
    stats->cpu_seconds += cpu_seconds_;
  }
  TrainingRays rays() const { return {counts_.rays - emission_rays_, emission_rays_}; }

 private:
  static TrainingPaths SizesFor(const CompiledScene& scene, TrainingPaths paths) {
    const FrameSettings& settings = scene.settings;
    if (paths.first == 0) paths.first = scene.training_paths_first;
    if (paths.first == 0) paths.first = TrainingPathsFirst(settings.width_px, settings.height_px);
    if (paths.emission_first == 0) paths.emission_first = paths.first;
    if (paths.lights == 0) paths.lights = paths.first << kLightsShift;
    return paths;
  }
  static TrainingFunction FunctionFor(const CompiledScene& scene) {
    const TraitBits traits = scene.plan.traits;
    const bool generic = scene.settings.force_generic_variant;
    if (scene.emission == nullptr) return TrainingFunctionOf(ChooseVariant(traits, generic));
    return TrainingBesideLightOf(ChooseLightPathVariant(traits, generic));
  }
  static Bounds BoxOf(const CompiledScene& scene) {
    Bounds box;
    const Vec3d lower = ToDouble(scene.geometry.bounds_lower),
                upper = ToDouble(scene.geometry.bounds_upper);
    if (lower.x <= upper.x) {
      box.Add(lower);
      box.Add(upper);
    }
    return box;
  }
  static absl::Status Cancelled() { return absl::CancelledError("the training was stopped"); }

  // False where a stop was requested.
  bool LearnEmission(uint64_t paths, LearnedFields* fields) {
    const FrameSettings& settings = scene_.settings;
    const LightTrainingFunction train = LightTrainingFunctionOf(
        ChooseLightPathVariant(scene_.plan.traits, settings.force_generic_variant));
    EmissionStatistics statistics(*scene_.emission);
    for (uint32_t i = 0; i < kEmissionIterations; ++i) {
      const TrainingPass pass{settings.seed ^ kLightPathSeed, i, settings.width_px,
                              settings.height_px};
      statistics.Begin(fields->emission, paths << i);
      const bool is_done = TraceRanges(paths << i, [&](uint64_t first, uint64_t end, RayCounts* c) {
        train(scene_, pass, *fields, first, end, &statistics, c);
      });
      if (!is_done) return false;
      const double start_seconds = ThreadCpuSeconds();
      fields->emission = statistics.Fit();
      cpu_seconds_ += ThreadCpuSeconds() - start_seconds;
    }
    return true;
  }

  static bool LearnsFromCamera(TechniqueSet techniques) {
    return IsGuided(techniques) || LearnsLights(techniques);
  }

  // Which lights are hidden, by the finished regions. False where a stop was requested.
  bool LearnVisibility(uint64_t paths, LearnedFields* fields) {
    LightVisibilityStatistics statistics(scene_.lights->choice(),
                                         static_cast<uint32_t>(fields->directions.region_count()));
    LightsSink sink(fields->directions, &statistics);
    if (!Trace(kTrainingIterations, *fields, paths, &sink)) return false;
    fields->lights = statistics.Freeze();
    return true;
  }

  // Cuts of the light tree; by the finished regions, or, without guiding, by new ones. False where
  // a stop was requested.
  bool LearnLights(uint64_t paths, LearnedFields* fields) {
    LightTries tries(scene_.lights->choice());
    TriesSink sink(&tries);
    for (uint64_t first = 0; first < paths && tries.size() < kLightTriesMax;
         first += kLightPathsAtOnce) {
      const uint64_t count = std::min(kLightPathsAtOnce, paths - first);
      if (!Trace(kTrainingIterations, *fields, count, &sink, first)) return false;
    }
    const double start_seconds = ThreadCpuSeconds();
    if (!IsGuided(scene_.settings.techniques)) {
      fields->directions = tries.MakeRegions(BoxOf(scene_));
    }
    fields->lights = tries.Learn(fields->directions);
    cpu_seconds_ += ThreadCpuSeconds() - start_seconds;
    return true;
  }

  // False where a stop was requested.
  bool LearnContributions(uint64_t paths, int unit_exponent, LearnedFields* fields) {
    const FrameSettings& settings = scene_.settings;
    const ContributionGrid grid = ContributionGridFor(settings.width_px, settings.height_px, paths);
    for (uint32_t pass = 0; pass < kContributionPasses; ++pass) {
      ContributionStatistics statistics(static_cast<uint32_t>(fields->directions.region_count()),
                                        grid, unit_exponent);
      ContributionsSink sink(fields->directions, &statistics);
      if (!Trace(kTrainingIterations + 1 + pass, *fields, paths, &sink)) return false;
      fields->contributions = statistics.Freeze();
    }
    return true;
  }

  // The paths from number `from` on. False where a stop was requested.
  bool Trace(uint32_t iteration, const LearnedFields& fields, uint64_t paths, GuidingSink* sink,
             uint64_t from = 0) {
    const FrameSettings& settings = scene_.settings;
    const TrainingPass pass{settings.seed, iteration, settings.width_px, settings.height_px};
    return TraceRanges(paths, [&](uint64_t first, uint64_t end, RayCounts* counts) {
      train_(scene_, pass, fields, from + first, from + end, sink, counts);
    });
  }

  // Calls trace(first, end, &counts) for ranges of the paths, on all threads. False where a stop
  // was requested.
  template <typename Trace>
  bool TraceRanges(uint64_t paths, const Trace& trace) {
    ParallelRanges(paths, kPathsAtOnce, threads_, [&](uint64_t first, uint64_t end) {
      if (stop_.stop_requested()) return;
      const double start_seconds = ThreadCpuSeconds();
      RayCounts counts;
      counts.majorant_factor = scene_.majorant_factor;
      trace(first, end, &counts);
      const MutexLock lock(&mutex_);
      counts_.Add(counts);
      cpu_seconds_ += ThreadCpuSeconds() - start_seconds;
    });
    return !stop_.stop_requested();
  }

  const CompiledScene& scene_;
  const TrainingPaths paths_;
  const int threads_;
  const std::stop_token stop_;
  const TrainingFunction train_;
  Mutex mutex_;
  RayCounts counts_;
  uint64_t emission_rays_ = 0;
  double cpu_seconds_ = 0;
};

uint32_t EmittingCount(const CompiledScene& scene) {
  return scene.emission == nullptr || scene.emission->empty() ? 0 : scene.emission->choice_count();
}

uint32_t ThreadsOfMachine() { return std::max(1u, std::thread::hardware_concurrency()); }

absl::Status CheckTrains(const CompiledScene& scene) {
  if (scene.guiding != nullptr) return absl::OkStatus();
  return absl::InvalidArgumentError(
      "a training was requested of a frame that needs none; its techniques must have guiding, "
      "emission-guiding or learned-lights");
}

}  // namespace

absl::StatusOr<std::string> TrainGuiding(const CompiledScene& scene, uint32_t threads,
                                         std::stop_token stop, RenderStats* stats) {
  if (absl::Status status = CheckTrains(scene); !status.ok()) return status;
  Training training(scene, threads, std::move(stop));
  const absl::StatusOr<LearnedFields> fields = training.Run();
  if (stats != nullptr) training.AddTo(stats);
  if (!fields.ok()) return fields.status();
  return fields->Encode();
}

absl::StatusOr<std::string> TrainGuidingOfSize(const CompiledScene& scene,
                                               const TrainingPaths& paths, TrainingRays* rays) {
  if (absl::Status status = CheckTrains(scene); !status.ok()) return status;
  Training training(scene, 1, {}, paths);
  const absl::StatusOr<LearnedFields> fields = training.Run();
  *rays = training.rays();
  if (!fields.ok()) return fields.status();
  return fields->Encode();
}

absl::Status SetGuiding(const CompiledScene& scene, std::string_view fields) {
  if (scene.guiding == nullptr) {
    return absl::InvalidArgumentError("a frame without guiding was given learned fields");
  }
  return scene.guiding->SetOnce(
      [&] { return LearnedFields::Decode(fields, scene.lights->choice(), EmittingCount(scene)); });
}

absl::Status EnsureGuiding(const CompiledScene& scene, std::stop_token stop) {
  if (scene.guiding == nullptr || scene.guiding->fields() != nullptr) return absl::OkStatus();
  return scene.guiding->SetOnce(
      [&] { return Training(scene, ThreadsOfMachine(), std::move(stop)).Run(); });
}

}  // namespace sheaf::render
