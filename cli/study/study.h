// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Study: what the accuracy of a scene costs, by which settings. Tiles spread over the frame are
// rendered with every setting of a ladder, in turns, and held against a reference of many samples:
//
//     MakeLadder > reference > MeasureLadder > AnalyzeStudy > Recommend
//     MeasurePlan: each effect;  PathNoiseSums: each kind of light path
//
// All on this machine, whose CPU time is the cost.
#pragma once

#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "cli/study/study_analysis.h"
#include "common/scene/file_source.h"
#include "common/scene/scene_description.h"
#include "common/scene/settings/render_settings.h"
#include "worker/render/ablation/plan_measurement.h"
#include "worker/render/path_noise.h"

namespace sheaf::cli {

// What a study may take.
inline constexpr double kStudyMinutesMin = 0.2, kStudyMinutesMax = 24 * 60;

struct StudyPath {
  LightPathKind kind;
  render::PathShares shares;
};

// A tile whose errors are not reliable (mean_interval.h), and the kind of path that is to blame.
struct UnreliableTile {
  PixelRect rect;
  LightPathKind kind;
  double variance_share = 0;  // Of the tile's variance, the kind's.
};

struct StudyResult {
  std::string scene;
  int32_t width_px = 0, height_px = 0;  // Of the window.
  int64_t pixels = 0;                   // Of the tiles that were rendered.
  double seconds = 0;
  int threads = 0;
  uint64_t reference_samples = 0;
  double reference_relative_mse = 0, reference_cpu_seconds = 0;
  std::vector<StudyCurve> curves;  // The base first.
  render::PlanMeasurement effects;
  std::vector<StudyPath> paths;  // Those that bring light.
  std::vector<UnreliableTile> unreliable_tiles;
  std::vector<std::string> recommendation, not_studied;
};

struct StudyOptions {
  double minutes = 10;  // About what it takes.
  int threads = 1;
  // Told what is being done, a line at a time.
  std::function<void(const std::string&)> on_progress;
};

// Errors: as CompileScene; kInvalidArgument where minutes is out of range; kResourceExhausted where
// the scene is too slow for any tile in that time.
absl::StatusOr<StudyResult> RunStudy(const SceneDescription& scene, const FrameSettings& settings,
                                     FileSource& files, const StudyOptions& options);

// study_words.cc: what the figures advise, in sentences with the figures.
std::vector<std::string> Recommend(const StudyResult& result);
// study_json.cc: one object, as docs/study.md describes.
std::string StudyJson(const StudyResult& result);

}  // namespace sheaf::cli
