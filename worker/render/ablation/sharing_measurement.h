// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// MeasureSharing: whether a frame gains where its paths count in several pixels: by the pixels'
// filters, and by points of the lens and times of the shutter. As MeasureTechniques does, it
// renders small images and compares error times cost, in rays. The filter is the scene's. Small
// images see less of what views gain, since blur spans fewer of their pixels. Noise of neighboring
// pixels is alike with sharing, so gains are judged by blocks of pixels.
#pragma once

#include <cstdint>
#include <optional>
#include <string>

#include "absl/status/statusor.h"
#include "common/scene/file_source.h"
#include "common/scene/scene_description.h"
#include "common/scene/settings/render_settings.h"

namespace sheaf::render {

// How many times as efficient as without.
struct SharingGains {
  double gain = 1;
  double least = 1;  // The lower end of a two-sided interval of 95 %.
};

struct SharingMeasurement {
  int32_t width_px = 0, height_px = 0;
  uint64_t samples = 0;
  SharingGains sharing;               // kSharing over paths of one pixel.
  std::optional<SharingGains> views;  // kSharing with kViews over the same; if there are any.

  // kSharing, with or without kViews, where it gains kTechniqueGainMin with confidence; views where
  // they gain kCombinationGainMin beside it. Else kCamera.
  TechniqueSet Best() const;
  double Gain() const;  // Best() over paths of one pixel.
};

// Whether the frame may share paths: see WhyNoSharing.
bool MayShare(const FrameSettings& settings);

// A pure function of its arguments; the settings' own techniques do not count. Both eyes of a
// stereo frame are measured together. Runs on the calling thread. Errors: as CompileScene.
// Requires: MayShare(settings).
absl::StatusOr<SharingMeasurement> MeasureSharing(const SceneDescription& scene,
                                                  const FrameSettings& settings, FileSource& files);

// One line: the gains, and what was chosen.
std::string FormatSharingMeasurement(const SharingMeasurement& measurement);

}  // namespace sheaf::render
