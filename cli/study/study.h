// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Study: measures what accuracy costs for a scene and for which settings. Tiles spread over the
// frame are rendered in turns with every setting of a ladder and compared with a reference of many
// samples:
//
//     MakeLadder > reference > MeasureLadder > AnalyzeStudy > Recommend
//     ChooseCrops > RenderCrops: the image at four prices
//     MeasurePlan: each effect;  PathNoiseSums: each kind of path
//
// Everything runs on this machine; the cost is its CPU time. Times on a farm are those of as fast
// threads.
#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "cli/study/study_analysis.h"
#include "cli/study/study_crops.h"
#include "cli/study/study_prices.h"
#include "common/scene/file_source.h"
#include "common/scene/scene_description.h"
#include "common/scene/settings/render_settings.h"
#include "worker/render/ablation/plan_measurement.h"
#include "worker/render/path_noise.h"

namespace sheaf::cli {

// Limits of a study's duration.
inline constexpr double kStudyMinutesMin = 0.2, kStudyMinutesMax = 24 * 60;

struct StudyPath {
  LightPathKind kind;
  render::PathFractions fractions;
};

// A tile whose error estimate is unreliable (mean_interval.h), and the kind of path that causes it.
struct UnreliableTile {
  PixelRect rect;
  LightPathKind kind;
  double variance_fraction = 0;  // Fraction of the tile's variance due to this kind.
};

struct StudyResult {
  std::string scene;
  int32_t width_px = 0, height_px = 0;  // The window's size.
  int64_t pixels = 0;                   // Number of rendered pixels.
  double seconds = 0;
  int threads = 0;
  uint64_t reference_samples = 0;
  double reference_relative_mse = 0, reference_cpu_seconds = 0;
  std::vector<StudyCurve> curves;     // The base is the first.
  double cpu_seconds_per_sample = 0;  // Of the base: for one sample of every pixel of the image.
  std::vector<StudyCrop> crops;
  std::vector<StudyPrice> prices;  // Those that the crops' images have, in their order.
  std::optional<StudyFarm> farm;   // If a coordinator was named.
  render::PlanMeasurement effects;
  std::vector<StudyPath> paths;    // Kinds with a contribution.
  size_t assessed_tile_count = 0;  // Those whose reliability is known.
  std::vector<UnreliableTile> unreliable_tiles;
  std::vector<std::string> recommendation, not_studied;
};

struct StudyOptions {
  double minutes = 10;  // Approximate duration.
  int threads = 1;
  std::optional<StudyFarm> farm = {};  // The farm to name prices for.
  // Receives the progress, a line at a time.
  std::function<void(const std::string&)> on_progress;
};

// Requires: the settings' techniques have no light paths (CheckCameraPaths). Errors: as
// CompileScene; kInvalidArgument if minutes is out of range; kResourceExhausted if the
// time is too short for even a few tiles.
absl::StatusOr<StudyResult> RunStudy(const SceneDescription& scene, const FrameSettings& settings,
                                     FileSource& files, const StudyOptions& options);

// Recommendations from the measurements, in sentences with the figures (study_words.cc).
std::vector<std::string> Recommend(const StudyResult& result);
// One JSON object as docs/study.md describes it (study_json.cc).
std::string StudyJson(const StudyResult& result);

}  // namespace sheaf::cli
