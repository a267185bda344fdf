// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "worker/render/ablation/technique_judge.h"

#include <algorithm>
#include <utility>

#include "worker/render/ablation/technique_choices.h"

namespace sheaf::render {
namespace {

// Dark pixels count against this fraction of the image's mean, as in relMSE.
constexpr double kDarkFraction = 0.1;

double MeanOf(const PilotReplicates& replicates) {
  double sum = 0;
  for (const double value : replicates) sum += value;
  return sum / kReplicateCount;
}

// The variance of one sample, from the spread of the replicates of `samples`.
double SampleVarianceOf(const PilotReplicates& replicates, uint64_t samples) {
  const double mean = MeanOf(replicates);
  double squares = 0;
  for (const double value : replicates) squares += (value - mean) * (value - mean);
  return squares / (kReplicateCount - 1) * static_cast<double>(samples / kReplicateCount);
}

// The weights of the pilots in the image that errors are relative to. One image for all techniques:
// an error relative to a pixel that has a rare bright sample looks small, so that a technique would
// seem the better the more of them it shares with the image. For the same reason, where guided
// emission may be much better than the others, only pilots that have all light count, by the
// inverse of their variance; else the means of all count alike.
std::vector<double> CommonWeights(const TechniquePilots& pilots, uint64_t samples) {
  const auto any = [&](bool (*has)(TechniqueSet)) {
    return std::ranges::any_of(pilots.all(), [&](const auto& pilot) { return has(pilot.first); });
  };
  const bool is_aimed = any([](TechniqueSet t) { return GuidesEmission(t); }),
             merges = any([](TechniqueSet t) { return MergesLightPaths(t); });
  std::vector<double> weights;
  double sum = 0;
  for (const auto& [techniques, pilot] : pilots.all()) {
    double weight = 1;
    if (is_aimed) {
      double variance = 0;
      for (const PilotReplicates& pixel : pilot.means) variance += SampleVarianceOf(pixel, samples);
      const bool is_whole = merges ? MergesLightPaths(techniques) : HasLightPaths(techniques);
      weight = is_whole && variance > 0 ? 1 / variance : 0;
    }
    weights.push_back(weight);
    sum += weight;
  }
  for (double& weight : weights)
    weight = sum > 0 ? weight / sum : 1 / static_cast<double>(weights.size());
  return weights;
}

// The squares that squared errors are relative to, by pixel; empty for a black image.
std::vector<double> CommonSquares(const TechniquePilots& pilots, uint64_t samples) {
  const std::vector<double> weights = CommonWeights(pilots, samples);
  std::vector<double> squares(pilots.Find(TechniqueSet::kCamera)->means.size());
  double total = 0;
  for (size_t pixel = 0; pixel < squares.size(); ++pixel) {
    double mean = 0;
    for (size_t i = 0; i < weights.size(); ++i) {
      mean += weights[i] * MeanOf(pilots.all()[i].second.means[pixel]);
    }
    squares[pixel] = mean * mean;
    total += mean;
  }
  const double dark = kDarkFraction * total / static_cast<double>(squares.size());
  if (!(dark > 0)) return {};
  for (double& square : squares) square += dark * dark;
  return squares;
}

// error_of(pixel) over its square, by pixel.
template <typename ErrorOf>
std::vector<double> RelativeErrors(const std::vector<double>& squares, const ErrorOf& error_of) {
  std::vector<double> errors(squares.size());
  for (size_t pixel = 0; pixel < squares.size(); ++pixel) {
    errors[pixel] = error_of(pixel) / squares[pixel];
  }
  return errors;
}

double MeanOf(const std::vector<double>& values) {
  double sum = 0;
  for (const double value : values) sum += value;
  return values.empty() ? 0 : sum / static_cast<double>(values.size());
}

// The mean of squares, relative to those of the image; at least 0.
double RelativeSquare(const std::vector<double>& squares, const std::vector<double>& errors) {
  return std::max(0.0,
                  MeanOf(RelativeErrors(squares, [&](size_t pixel) { return errors[pixel]; })));
}

}  // namespace

TechniqueJudge::TechniqueJudge(const TechniquePilots& pilots, const FrameSettings& settings,
                               const FrameSettings& frame, std::optional<TechniqueSet> plain)
    : pilots_(pilots),
      settings_(settings),
      frame_(frame),
      plain_(plain),
      squares_(CommonSquares(pilots, settings.samples)),
      finder_(pilots.Find(TechniqueSet::kCameraAndLight)) {
  for (const auto& [techniques, pilot] : pilots.all()) {
    if (!MergesLightPaths(techniques) || GuidesEmission(techniques)) continue;
    finder_ = merger_ = &pilot;
  }
}

TechniqueMeasurement TechniqueJudge::Measure() const {
  TechniqueMeasurement result;
  result.plain = plain_;
  result.width_px = settings_.width_px;
  result.height_px = settings_.height_px;
  result.samples = settings_.samples;
  result.camera = *CostOf(TechniqueSet::kCamera);
  result.both = *CostOf(TechniqueSet::kCameraAndLight);
  if (auto cost = CostOf(TechniqueSet::kCameraGuided)) result.guided = *std::move(cost);
  result.guided_both = CostOf(TechniqueSet::kCameraAndLightGuided);
  const TechniqueSet base = result.BaseOfLight();
  result.merged = CostOf(base.With(Technique::kMerging));
  result.split = CostOf(result.BestOfPlain().With(Technique::kSplitting));
  result.learned_lights = CostOf(result.BestOfPlain().With(Technique::kLearnedLights));
  result.product = CostOf(result.BestOfPlain().With(Technique::kProduct));
  result.chained = CostOf(kChainsChoice);
  result.emission_guided = CostOf(base.With(Technique::kEmissionGuiding));
  result.emission_guided_merged =
      CostOf(base.With(Technique::kMerging).With(Technique::kEmissionGuiding));
  if (merger_ != nullptr) {
    result.unmerged_missing_mse = RelativeSquare(squares_, merger_->merged_missing_squares);
    result.bias_mse = RelativeSquare(squares_, merger_->bias_squares);
  }
  double light = 0;
  for (const PilotReplicates& replicates : finder_->means) {
    light += kReplicateCount * MeanOf(replicates);
  }
  if (light > 0) {
    result.light_share = finder_->light / light;
    result.only_light_share = finder_->only_light / light;
  }
  result.frame_samples = std::max<uint64_t>(frame_.samples, 1);
  result.missing_mse = RelativeSquare(squares_, finder_->missing_squares);
  return result;
}

double TechniqueJudge::VarianceOf(const Pilot& pilot, size_t pixel) const {
  return SampleVarianceOf(pilot.means[pixel], settings_.samples);
}

std::optional<TechniqueCost> TechniqueJudge::CostOf(TechniqueSet techniques) const {
  const Pilot* const pilot = pilots_.Find(techniques);
  if (pilot == nullptr) return std::nullopt;
  // Light that the techniques may have missed, and that others found: the one of the same camera
  // paths beside light paths, the one with merging, and the one with chains.
  const Pilot* beside = nullptr;
  if (!HasLightPaths(techniques)) {
    const TechniqueSet guided = TechniqueSet::kCameraAndLightGuided;
    beside = IsGuided(techniques) ? pilots_.Find(guided) : finder_;
    if (beside == nullptr) beside = pilots_.Find(TechniqueSet::kCameraAndLight);
  }
  const Pilot* const merger = MergesLightPaths(techniques) ? nullptr : merger_;
  const bool has_chains = HasChains(techniques);
  const Pilot* const chains =
      has_chains || MergesLightPaths(techniques) ? nullptr : pilots_.Find(kChainsChoice);
  const auto variance_of = [&](size_t pixel) {
    double variance = VarianceOf(*pilot, pixel);
    const auto consider = [&](const Pilot& finder, const std::vector<double>& moments) {
      const double mean = MeanOf(finder.means[pixel]);
      variance = std::max(variance, moments[pixel] - mean * mean);
    };
    if (beside != nullptr) {
      consider(*beside, has_chains ? beside->unchained_moments : beside->moments);
    }
    if (merger != nullptr) {
      consider(*merger, has_chains ? merger->unchained_merged_moments : merger->merged_moments);
    }
    if (chains != nullptr) {
      consider(*chains, HasLightPaths(techniques) ? chains->unconnected_chain_moments
                                                  : chains->chain_moments);
    }
    return variance;
  };
  std::vector<double> errors = RelativeErrors(squares_, variance_of);
  const double mean = MeanOf(errors);
  return TechniqueCost{mean, pilot->cost_rays, std::move(errors)};
}

}  // namespace sheaf::render
