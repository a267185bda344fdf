// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Study: measures the cost of accuracy for a scene and for which settings. Tiles spread over the
// frame are rendered in turns with every setting of a ladder and compared with a reference of many
// samples:
//
//     MakeLadder > reference > MeasureLadder > AnalyzeStudy > Recommend
//     ChooseCrops > RenderCrops: the image at four prices
//     MeasurePlan: each effect;  MeasurePathNoise: each kind of path
//
// A light pass covers the whole frame. So settings with light paths have a small image of the whole
// frame beside their tiles, as the pilots of quotes have: its light, errors and cost are added to
// those of the tiles at the same number of passes (docs/adr/0096). The reference and the crops have
// light passes of the frame itself. Effects are those of paths from the camera alone.
//
// Everything runs on this machine; the cost is its CPU time. Times on a farm assume equally fast
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
#include "cli/study/study_paths.h"
#include "cli/study/study_prices.h"
#include "common/scene/file_source.h"
#include "common/scene/scene_description.h"
#include "common/scene/settings/render_settings.h"
#include "worker/render/ablation/plan_measurement.h"

namespace sheaf::cli {

// Limits of a study's duration.
inline constexpr double kStudyMinutesMin = 0.2, kStudyMinutesMax = 24 * 60;

// The figures that a study measures in another way if the frame has light paths.
struct StudyLight {
  // The frame on which light passes are measured, and how many times smaller than the image's it
  // is; 1: light passes are those of the frame itself.
  int32_t shrink = 1, width_px = 0, height_px = 0;
  int32_t paths_shrink = 1;         // The same for kinds of paths.
  uint64_t reference_passes = 0;    // For the frame itself, in the reference and the crops.
  double cpu_seconds_per_pass = 0;  // For the base and the whole frame.
};

struct StudyResult {
  std::string scene;
  int32_t width_px = 0, height_px = 0;  // The window's size.
  int64_t pixels = 0;                   // Number of rendered pixels.
  double seconds = 0;
  int threads = 0;
  uint64_t reference_samples = 0;
  double reference_relative_mse = 0, reference_cpu_seconds = 0;
  std::vector<StudyCurve> curves;  // The base is the first.
  // The base's: for one sample of every pixel of the image, and a light pass if it has such.
  double cpu_seconds_per_sample = 0;
  double training_cpu_seconds = 0;  // Before the base's first sample; 0 if it is not guided.
  std::optional<StudyLight> light;  // If the base has light paths.
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

// Errors: as CompileScene; kInvalidArgument if minutes is out of range; kResourceExhausted if the
// time is too short for even a few tiles, or for a few light passes of the whole frame.
absl::StatusOr<StudyResult> RunStudy(const SceneDescription& scene, const FrameSettings& settings,
                                     FileSource& files, const StudyOptions& options);

// Recommendations from the measurements, in sentences with the figures (study_words.cc).
std::vector<std::string> Recommend(const StudyResult& result);
// One JSON object as docs/study.md describes it (study_json.cc).
std::string StudyJson(const StudyResult& result);

}  // namespace sheaf::cli
