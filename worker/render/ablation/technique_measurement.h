// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// MeasureTechniques: whether light paths and guiding pay in a scene: renders a small image of the
// frame by camera paths alone, with light paths, with guiding, and with both (and, where guiding
// pays, with splitting; where light paths pay, with guided emission; where the camera sees rough
// surfaces through smooth glass or in mirrors, with merging; where small lamps may shine through
// smooth glass or by mirrors, with chains; where there are several lights, with
// learned lights; where there are many and glossy surfaces, by product), and compares error times
// cost. The cost is counted in rays, not in time, so that the answer is the same on every machine;
// guiding also pays for its training. Source: Grittmann et al. 2022, "Efficiency-aware Multiple
// Importance Sampling for Bidirectional Rendering Algorithms".
//
// The smallest of these images come first. Where they promise no gain, nothing more is rendered, so
// that a frame of plain light loses little by the question. Else images follow whose samples are a
// fraction of the frame's.
//
// Both the camera's and light paths may miss light that chains find: the moments that both would
// have there are known likewise.
//
// Camera paths alone may miss light altogether that they find once in a million samples, and then
// look better than they are. Light paths find it: from the densities of both, the second moment
// that camera paths would have there is estimated too, and the larger of the two variances counts.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "absl/status/statusor.h"
#include "common/scene/file_source.h"
#include "common/scene/scene_description.h"
#include "common/scene/settings/render_settings.h"

namespace sheaf::render {

// Samples of a small image by one choice of techniques: in the first look, and after it. They are
// fractions of the frame's, rounded down to a power of two, within limits.
inline constexpr uint64_t kFrameSamplesPerLookSample = 512, kFrameSamplesPerPilotSample = 32;
inline constexpr uint64_t kLookSamplesMax = uint64_t{1} << 14,
                          kThoroughSamplesMin = kLookSamplesMax;
// More images follow the first look where it finds so great a gain by light paths or by guiding.
inline constexpr double kPromisingGainMin = 1.25;
// They also follow where camera paths cannot find this fraction of the light.
inline constexpr double kMissingShareMin = 0.05;
// Techniques must be this many times as efficient as camera paths alone to be chosen, and more
// efficient with 95 % confidence: the measurement has noise, and frames with other techniques have
// fewer compiled variants. Light paths and guiding together must be kCombinationGainMin times as
// efficient as either; so must splitting, merging, guided emission and, beside other techniques,
// learned lights and products, as without.
inline constexpr double kTechniqueGainMin = 1.5, kCombinationGainMin = 1.25;

// Light that camera paths miss counts as in a frame of this many times the samples: nothing that is
// rendered later reduces it.
inline constexpr double kMissingLightFactor = 4;

// Why a frame is measured. kAsked: --techniques auto. kUnasked: no flag asks, so that the price of
// the first look stays within a hundredth of the frame's, and of all images about a thirtieth,
// where the first look promises kTechniqueGainMin with 95 % confidence. Merging, which is biased,
// is no choice then. docs/adr/0129.
enum class TechniqueEffort { kAsked, kUnasked };
// Unasked: frames of fewer samples, and of scenes with more bytes for each, keep camera paths: the
// images would cost more than a hundredth, with compiling the scene for them.
inline constexpr double kUnaskedSamplesMin = 1 << 24, kSceneBytesPerSampleMax = 4;
inline constexpr uint64_t kFrameSamplesPerUnaskedPilotSample = 512;
// Unasked: chains cost as much as the other images of the first look together, and are measured in
// frames of this many samples or more.
inline constexpr double kUnaskedChainSamplesMin = 1 << 25;
// Whether MeasureTechniques may be called unasked. scene_bytes: EstimateMemory.
bool MayMeasureUnasked(const FrameSettings& settings, uint64_t scene_bytes);

struct TechniqueCost {
  // The error of an image with one sample a pixel (and one pass of light paths).
  double relative_mse = 0;
  // A pixel and sample, with its part of the training, in rays of unguided paths from the camera
  // (kLightRayCost).
  double cost_rays = 0;
  std::vector<double> pixel_errors;  // relative_mse is their mean; may be empty.

  TechniqueCost() = default;
  TechniqueCost(double mse, double rays, std::vector<double> errors = {})
      : relative_mse(mse), cost_rays(rays), pixel_errors(std::move(errors)) {}
  double ErrorTimesCost() const { return relative_mse * cost_rays; }
};

struct TechniqueMeasurement {
  int32_t width_px = 0, height_px = 0;
  uint64_t samples = 0;
  TechniqueCost camera, both;  // both: with light paths.
  TechniqueCost guided;        // Camera paths with guiding.
  // Light paths and guiding: not measured where the first look promises no gain by either.
  std::optional<TechniqueCost> guided_both;
  // The chosen one of the last two, with splitting: measured where guiding pays.
  std::optional<TechniqueCost> split;
  // BaseOfLight with merging: measured where the camera sees through smooth glass or in mirrors.
  std::optional<TechniqueCost> merged;
  // BaseOfLight with guided emission, and with both: measured where light paths pay, or camera
  // paths miss much.
  std::optional<TechniqueCost> emission_guided, emission_guided_merged;
  // BestOfPlain with learned lights: measured where there are lights to choose among; in the first
  // look, camera paths with learned lights.
  std::optional<TechniqueCost> learned_lights;
  // BestOfPlain with choices by product: measured beside no light paths, where there are many
  // lights and glossy surfaces (kProductLightsMin); in the first look, camera paths.
  std::optional<TechniqueCost> product;
  // Chains beside no other technique: measured where the scene has what they may connect.
  std::optional<TechniqueCost> chained;
  // BestOfPlain where the last ones were chosen to be measured; else it follows from the costs.
  std::optional<TechniqueSet> plain;
  // Fractions of the light: found by light paths, by their weights; and found by them alone, since
  // camera paths cannot find it (a light without size, seen by specular reflection of its light).
  double light_share = 0, only_light_share = 0;
  // The relMSE of an image without the light that camera paths cannot find, whatever its samples.
  double missing_mse = 0;
  // The same of an image without the light that only merging finds; and by the bias of merging, in
  // the frame.
  double unmerged_missing_mse = 0, bias_mse = 0;
  uint64_t frame_samples = 1;  // A pixel of the frame.

  // How many times as efficient the techniques are as the camera's paths: the ratio of error times
  // cost, where errors hold the missing light and the bias of a frame of frame_samples. 1 where the
  // image is black or has no error. Requires: techniques that were measured; not kLight. Splitting
  // gains as much beside merging and guided emission as without.
  double Gain(TechniqueSet techniques) const;
  // The lower end of a two-sided interval of 95 % about the gain, by the spread of the pixels; not
  // more than the gain without the pixel that speaks most for it, as one pixel with a rare bright
  // sample is no evidence. The gain where the errors of pixels are not known.
  double LeastGain(TechniqueSet techniques) const;
  // How many times as efficient BaseOfLight is with guided emission, and with merging; and
  // BestOfPlain with learned lights, and by product. Requires: that was measured.
  double GainOfGuidedEmission() const;
  double GainOfMerging() const;
  double GainOfLearnedLights() const;
  double GainOfProduct() const;
  // Never kLight.
  TechniqueSet Best() const;
  // The best without splitting, merging, guided emission, learned lights and products.
  TechniqueSet BestOfPlain() const;
  // That, or kCameraAndLight where it has no light paths: what merging and guided emission are
  // measured with.
  TechniqueSet BaseOfLight() const;

  // The measured sets, camera paths first.
  std::vector<TechniqueSet> Measured() const;
  // Null where they were not measured.
  const TechniqueCost* Find(TechniqueSet techniques) const;

 private:
  double RatioOf(TechniqueSet over, TechniqueSet under) const;
  // Whether they were measured, and are to be chosen rather than camera paths.
  bool Pays(TechniqueSet techniques) const;
  // Error that samples do not reduce: missing light and bias, as noise of one sample that would
  // leave the same error in the frame.
  double LastingError(TechniqueSet techniques) const;
  // 0 for other techniques than the camera's without an error.
  double ErrorTimesCost(TechniqueSet techniques) const;
};

// A pure function of its arguments. The settings' own techniques do not count. Runs on the calling
// thread, except for building the acceleration structure. Errors: as CompileScene.
absl::StatusOr<TechniqueMeasurement> MeasureTechniques(const SceneDescription& scene,
                                                       const FrameSettings& settings,
                                                       FileSource& files, TechniqueEffort effort);

// One line: the techniques that are best, and their gain.
std::string FormatTechniqueMeasurement(const TechniqueMeasurement& measurement);

}  // namespace sheaf::render
