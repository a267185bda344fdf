// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "worker/render/ablation/technique_measurement.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <initializer_list>
#include <iterator>
#include <optional>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "common/base/check.h"
#include "worker/render/ablation/technique_choices.h"
#include "worker/render/ablation/technique_judge.h"
#include "worker/render/ablation/technique_pilot.h"

namespace sheaf::render {
namespace {

// Paths of the first iteration of a training, over the samples of the image; in the first look,
// where guiding that is learned from less must look promising alone.
constexpr double kTrainingFraction = 1.0 / 8, kLookTrainingFraction = 1.0 / 16;
// Standard errors of a gain's logarithm that its lower end is below it: 95 % in all.
constexpr double kGainDeviations = 1.96;

bool IsPromising(const TechniqueMeasurement& look, TechniqueEffort effort) {
  if (look.only_light_share >= kMissingShareMin) return true;
  const bool asked = effort == TechniqueEffort::kAsked;
  const auto promises = [&](TechniqueSet techniques) {
    return asked ? look.Gain(techniques) >= kPromisingGainMin
                 : look.Gain(techniques) >= kTechniqueGainMin && look.LeastGain(techniques) > 1;
  };
  return promises(TechniqueSet::kCameraAndLight) || promises(TechniqueSet::kCameraGuided) ||
         (look.chained && promises(kChainsChoice)) ||
         (look.merged && promises(TechniqueSet::kCameraAndLight.With(Technique::kMerging))) ||
         (look.learned_lights && promises(look.BestOfPlain().With(Technique::kLearnedLights))) ||
         (look.product && promises(look.BestOfPlain().With(Technique::kProduct)));
}

// The fraction of the frame's samples, rounded down to a power of two.
uint64_t SamplesFor(const FrameSettings& frame, uint64_t per_sample, uint64_t min, uint64_t max) {
  const double asked = FrameSamples(frame) / static_cast<double>(per_sample);
  return std::bit_floor(
      static_cast<uint64_t>(std::clamp(asked, static_cast<double>(min), static_cast<double>(max))));
}

absl::Status Render(std::initializer_list<TechniqueSet> all, PilotRenderer* renderer,
                    TechniquePilots* pilots) {
  for (const TechniqueSet techniques : all) {
    SHEAF_CHECK(IsTechniqueChoice(techniques));
    absl::StatusOr<Pilot> pilot = renderer->Render(techniques);
    if (!pilot.ok()) return pilot.status();
    pilots->Add(techniques, *std::move(pilot));
  }
  return absl::OkStatus();
}

// The techniques that depend on what the plain ones gain.
absl::Status RenderAdditions(const TechniqueMeasurement& found, PilotRenderer* renderer,
                             TechniquePilots* pilots) {
  const TechniqueSet plain = found.BestOfPlain();
  if (renderer->ChoosesLights()) {
    absl::Status status = Render({plain.With(Technique::kLearnedLights)}, renderer, pilots);
    if (!status.ok()) return status;
  }
  if (renderer->MayChooseByProduct() && !HasLightPaths(plain)) {
    absl::Status status = Render({plain.With(Technique::kProduct)}, renderer, pilots);
    if (!status.ok()) return status;
  }
  if (IsGuided(plain)) {
    absl::Status status = Render({plain.With(Technique::kSplitting)}, renderer, pilots);
    if (!status.ok()) return status;
  }
  const bool light_pays = HasLightPaths(found.Best());
  if (!light_pays && found.only_light_share < kMissingShareMin) return absl::OkStatus();
  const TechniqueSet aimed = found.BaseOfLight().With(Technique::kEmissionGuiding);
  absl::Status status = Render({aimed}, renderer, pilots);
  if (!status.ok() || !found.merged) return status;
  return Render({aimed.With(Technique::kMerging)}, renderer, pilots);
}

// thorough: light paths and guiding together, too, splitting where guiding pays, and guided
// emission where light paths pay or find much that camera paths cannot.
// Merging is biased, and chains are expensive to measure: unasked, they are no
// choices, or not always.
absl::StatusOr<TechniqueMeasurement> MeasurePilots(const FrameSettings& frame,
                                                   TechniqueEffort effort, bool thorough,
                                                   PilotRenderer* renderer) {
  const bool may_merge = effort == TechniqueEffort::kAsked,
             may_have_chains = may_merge || FrameSamples(frame) >= kUnaskedChainSamplesMin;
  TechniquePilots pilots;
  absl::Status status = absl::OkStatus();
  for (const TechniqueSet choice : kPlainChoices) {
    const bool is_later = choice == TechniqueSet::kCameraAndLightGuided && !thorough;
    if (status.ok() && !is_later) status = Render({choice}, renderer, &pilots);
  }
  if (status.ok() && !thorough && renderer->ChoosesLights()) {
    status = Render({TechniqueSet{Technique::kLearnedLights}}, renderer, &pilots);
  }
  if (status.ok() && !thorough && renderer->MayChooseByProduct()) {
    status = Render({TechniqueSet{Technique::kProduct}}, renderer, &pilots);
  }
  if (status.ok() && may_have_chains && renderer->MayHaveChains()) {
    status = Render({kChainsChoice}, renderer, &pilots);
  }
  if (!status.ok()) return status;
  const absl::StatusOr<bool> merges =
      may_merge ? renderer->SeesThroughSpecular() : absl::StatusOr<bool>(false);
  if (!merges.ok()) return merges.status();
  const auto judge = [&](std::optional<TechniqueSet> plain) {
    return TechniqueJudge(pilots, renderer->settings(), frame, plain).Measure();
  };
  std::optional<TechniqueSet> plain;
  if (*merges) {
    const TechniqueMeasurement unmerged = judge({});
    plain = unmerged.BestOfPlain();
    status = Render({unmerged.BaseOfLight().With(Technique::kMerging)}, renderer, &pilots);
    if (!status.ok()) return status;
  }
  const TechniqueMeasurement found = judge(plain);
  if (!thorough) return found;
  status = RenderAdditions(found, renderer, &pilots);
  if (!status.ok()) return status;
  return judge(found.BestOfPlain());
}

}  // namespace

const TechniqueCost* TechniqueMeasurement::Find(TechniqueSet techniques) const {
  const auto of = [](const std::optional<TechniqueCost>& cost) { return cost ? &*cost : nullptr; };
  if (techniques.Has(Technique::kProduct)) return of(product);
  if (HasChains(techniques)) return of(chained);
  if (LearnsLights(techniques)) return of(learned_lights);
  const bool merges = MergesLightPaths(techniques);
  if (GuidesEmission(techniques)) return of(merges ? emission_guided_merged : emission_guided);
  if (merges) return of(merged);
  if (SplitsPaths(techniques)) return of(split);
  if (techniques == TechniqueSet::kCamera) return &camera;
  if (techniques == TechniqueSet::kCameraGuided) return &guided;
  return IsGuided(techniques) ? of(guided_both) : &both;
}

std::vector<TechniqueSet> TechniqueMeasurement::Measured() const {
  std::vector<TechniqueSet> all(std::begin(kPlainChoices), std::end(kPlainChoices));
  const TechniqueSet plain_best = BestOfPlain(), merging = BaseOfLight().With(Technique::kMerging);
  for (const Technique added :
       {Technique::kSplitting, Technique::kLearnedLights, Technique::kProduct}) {
    all.push_back(plain_best.With(added));
  }
  all.insert(all.end(), {merging, BaseOfLight().With(Technique::kEmissionGuiding),
                         merging.With(Technique::kEmissionGuiding), kChainsChoice});
  std::erase_if(all, [this](TechniqueSet techniques) { return Find(techniques) == nullptr; });
  return all;
}

double TechniqueMeasurement::RatioOf(TechniqueSet over, TechniqueSet under) const {
  const double error = ErrorTimesCost(under);
  return error > 0 ? ErrorTimesCost(over) / error : 1;
}

double TechniqueMeasurement::GainOfGuidedEmission() const {
  return RatioOf(BaseOfLight(), BaseOfLight().With(Technique::kEmissionGuiding));
}

double TechniqueMeasurement::GainOfMerging() const {
  return RatioOf(BaseOfLight(), BaseOfLight().With(Technique::kMerging));
}

double TechniqueMeasurement::GainOfLearnedLights() const {
  return RatioOf(BestOfPlain(), BestOfPlain().With(Technique::kLearnedLights));
}

double TechniqueMeasurement::GainOfProduct() const {
  return RatioOf(BestOfPlain(), BestOfPlain().With(Technique::kProduct));
}

double TechniqueMeasurement::Gain(TechniqueSet techniques) const {
  const TechniqueSet unlearned = techniques.Without(Technique::kLearnedLights);
  if (unlearned != techniques && unlearned != BestOfPlain()) {
    return Gain(unlearned) * GainOfLearnedLights();
  }
  const TechniqueSet unsplit = techniques.Without(Technique::kSplitting);
  if (MergesLightPaths(techniques) || GuidesEmission(techniques)) {
    const double gain = RatioOf(TechniqueSet::kCamera, unsplit);
    return unsplit == techniques
               ? gain
               : gain * RatioOf(BestOfPlain(), BestOfPlain().With(Technique::kSplitting));
  }
  return RatioOf(TechniqueSet::kCamera, techniques);
}

double TechniqueMeasurement::LeastGain(TechniqueSet techniques) const {
  const TechniqueSet unlearned = techniques.Without(Technique::kLearnedLights);
  if (unlearned != techniques && unlearned != BestOfPlain()) {
    return LeastGain(unlearned) * GainOfLearnedLights();
  }
  const std::vector<double>& over = camera.pixel_errors;
  const TechniqueCost& cost = *Find(techniques);
  const std::vector<double>& under = cost.pixel_errors;
  const double gain = Gain(techniques);
  if (over.empty() || over.size() != under.size()) return gain;
  const auto pixels = static_cast<double>(over.size());
  const double lost = LastingError(TechniqueSet::kCamera), lasting = LastingError(techniques);
  const double over_sum = pixels * (camera.relative_mse + lost),
               under_sum = pixels * (cost.relative_mse + lasting);
  if (!(over_sum > 0 && under_sum > 0)) return gain;
  double squares = 0, most = 0, without_most = 1;
  for (size_t pixel = 0; pixel < over.size(); ++pixel) {
    const double a = over[pixel] + lost, b = under[pixel] + lasting;
    const double speaks_for = a / over_sum - b / under_sum;
    squares += speaks_for * speaks_for;
    if (speaks_for <= most) continue;
    most = speaks_for;
    without_most = (1 - a / over_sum) / (1 - b / under_sum);
  }
  return gain * std::min(without_most, std::exp(-kGainDeviations * std::sqrt(squares)));
}

double TechniqueMeasurement::LastingError(TechniqueSet techniques) const {
  const auto of_frame = static_cast<double>(frame_samples);
  if (MergesLightPaths(techniques)) return of_frame * bias_mse;
  return kMissingLightFactor * of_frame *
         (HasLightPaths(techniques) ? unmerged_missing_mse : missing_mse);
}

double TechniqueMeasurement::ErrorTimesCost(TechniqueSet techniques) const {
  const TechniqueCost& cost = *Find(techniques);
  return (cost.relative_mse + LastingError(techniques)) * cost.cost_rays;
}

bool TechniqueMeasurement::Pays(TechniqueSet techniques) const {
  const TechniqueCost* const cost = Find(techniques);
  return cost != nullptr && cost->ErrorTimesCost() > 0 && Gain(techniques) >= kTechniqueGainMin &&
         LeastGain(techniques) > 1;
}

TechniqueSet TechniqueMeasurement::BestOfPlain() const {
  if (plain) return *plain;
  TechniqueSet best = TechniqueSet::kCamera;
  if (Pays(TechniqueSet::kCameraAndLight)) best = TechniqueSet::kCameraAndLight;
  if (Pays(TechniqueSet::kCameraGuided) &&
      Gain(TechniqueSet::kCameraGuided) >= Gain(TechniqueSet::kCameraAndLight)) {
    best = TechniqueSet::kCameraGuided;
  }
  const TechniqueSet all = TechniqueSet::kCameraAndLightGuided;
  if (!Pays(all)) return best;
  const bool combines =
      best == TechniqueSet::kCamera || Gain(all) >= kCombinationGainMin * Gain(best);
  return combines ? all : best;
}

TechniqueSet TechniqueMeasurement::BaseOfLight() const {
  const TechniqueSet best = BestOfPlain();
  return HasLightPaths(best) ? best : TechniqueSet::kCameraAndLight;
}

TechniqueSet TechniqueMeasurement::Best() const {
  TechniqueSet best = BestOfPlain();
  double best_gain = best == TechniqueSet::kCamera ? 1 : Gain(best);
  const TechniqueSet base = BaseOfLight();
  const auto consider = [&](TechniqueSet techniques) {
    if (!Pays(techniques) || Gain(techniques) < kCombinationGainMin * best_gain) return;
    best = techniques;
    best_gain = Gain(techniques);
  };
  consider(base.With(Technique::kMerging));
  consider(base.With(Technique::kEmissionGuiding));
  consider(base.With(Technique::kMerging).With(Technique::kEmissionGuiding));
  consider(kChainsChoice);
  if (HasChains(best)) return best;
  // Splitting was measured beside the best of the plain ones.
  const TechniqueSet unsplit = BestOfPlain(), splitting = unsplit.With(Technique::kSplitting);
  if (split && best.HasAll(unsplit) && split->ErrorTimesCost() > 0 &&
      RatioOf(unsplit, splitting) >= kCombinationGainMin) {
    best = best.With(Technique::kSplitting);
  }
  const TechniqueSet learned = unsplit.With(Technique::kLearnedLights);
  if (learned_lights && best.HasAll(unsplit) && learned_lights->ErrorTimesCost() > 0) {
    const bool pays = best == TechniqueSet::kCamera ? Pays(learned)
                                                    : GainOfLearnedLights() >= kCombinationGainMin;
    if (pays) best = best.With(Technique::kLearnedLights);
  }
  // Products were measured beside the plain ones alone, and take the place of learned lights where
  // they gain more.
  const TechniqueSet by_product = unsplit.With(Technique::kProduct);
  if (product && (best == unsplit || best == learned) && product->ErrorTimesCost() > 0 &&
      (best == unsplit || GainOfProduct() > GainOfLearnedLights())) {
    const bool pays = unsplit == TechniqueSet::kCamera ? Pays(by_product)
                                                       : GainOfProduct() >= kCombinationGainMin;
    if (pays) best = by_product;
  }
  return best;
}

bool MayMeasureUnasked(const FrameSettings& settings, uint64_t scene_bytes) {
  const double samples = FrameSamples(settings);
  return settings.techniques == TechniqueSet::kCamera && settings.similarity_after == 0 &&
         samples >= kUnaskedSamplesMin &&
         static_cast<double>(scene_bytes) <= kSceneBytesPerSampleMax * samples;
}

absl::StatusOr<TechniqueMeasurement> MeasureTechniques(const SceneDescription& scene,
                                                       const FrameSettings& settings,
                                                       FileSource& files, TechniqueEffort effort) {
  const auto measure = [&](uint64_t samples, double training_fraction,
                           bool thorough) -> absl::StatusOr<TechniqueMeasurement> {
    absl::StatusOr<PilotRenderer> renderer =
        PilotRenderer::Make(scene, settings, PilotSizeOf(settings, samples, training_fraction),
                            PilotFilter::kBox, files);
    if (!renderer.ok()) return renderer.status();
    return MeasurePilots(settings, effort, thorough, &*renderer);
  };
  const uint64_t look_samples =
      SamplesFor(settings, kFrameSamplesPerLookSample, kPilotSamplesMin, kLookSamplesMax);
  const absl::StatusOr<TechniqueMeasurement> look =
      measure(look_samples, kLookTrainingFraction, false);
  if (!look.ok() || !IsPromising(*look, effort)) return look;
  const uint64_t per_sample = effort == TechniqueEffort::kAsked
                                  ? kFrameSamplesPerPilotSample
                                  : kFrameSamplesPerUnaskedPilotSample;
  return measure(SamplesFor(settings, per_sample, kThoroughSamplesMin, kPilotSamplesMax),
                 kTrainingFraction, true);
}

std::string FormatTechniqueMeasurement(const TechniqueMeasurement& m) {
  const TechniqueSet best = m.Best();
  std::string text = absl::StrCat("techniques: ", best.Name(), "; ");
  if (m.only_light_share > 0) {
    absl::StrAppendFormat(&text, "light paths alone find %.2g %% of the light; ",
                          100 * m.only_light_share);
  }
  absl::StrAppendFormat(&text,
                        "times as efficient as camera paths: light paths %.2g, which find %.2g "
                        "%% of the light; guiding %.2g",
                        m.Gain(TechniqueSet::kCameraAndLight), 100 * m.light_share,
                        m.Gain(TechniqueSet::kCameraGuided));
  if (m.guided_both) {
    absl::StrAppendFormat(&text, "; both %.2g", m.Gain(TechniqueSet::kCameraAndLightGuided));
  }
  if (m.merged) {
    const TechniqueSet merging = m.BaseOfLight().With(Technique::kMerging);
    absl::StrAppendFormat(&text, "; %s %.2g", merging.Name(), m.Gain(merging));
  }
  if (m.split) {
    const TechniqueSet split = m.BestOfPlain().With(Technique::kSplitting);
    absl::StrAppendFormat(&text, "; %s %.2g", split.Name(), m.Gain(split));
  }
  if (m.chained) {
    absl::StrAppendFormat(&text, "; %s %.2g", kChainsChoice.Name(), m.Gain(kChainsChoice));
  }
  if (m.emission_guided) {
    absl::StrAppendFormat(&text, "; guided emission is %.2g times as efficient as unguided",
                          m.GainOfGuidedEmission());
  }
  if (m.emission_guided_merged) {
    const TechniqueSet all =
        m.BaseOfLight().With(Technique::kMerging).With(Technique::kEmissionGuiding);
    absl::StrAppendFormat(&text, "; %s %.2g", all.Name(), m.Gain(all));
  }
  if (m.learned_lights) {
    absl::StrAppendFormat(&text, "; learned lights are %.2g times as efficient as estimated ones",
                          m.GainOfLearnedLights());
  }
  if (m.product) {
    absl::StrAppendFormat(&text, "; lights by product are %.2g times as efficient",
                          m.GainOfProduct());
  }
  if (best != TechniqueSet::kCamera) {
    absl::StrAppendFormat(&text, "; at least %.2g with 95 %% confidence",
                          m.LeastGain(best.Without(Technique::kSplitting)));
  }
  absl::StrAppendFormat(&text, " (%d x %d pixels, %d samples, which cost as much as %.1f, %.1f",
                        m.width_px, m.height_px, m.samples, m.camera.cost_rays, m.both.cost_rays);
  if (m.guided_both) {
    absl::StrAppendFormat(&text, ", %.1f and %.1f rays of camera paths)", m.guided.cost_rays,
                          m.guided_both->cost_rays);
  } else {
    absl::StrAppendFormat(&text, " and %.1f rays of camera paths)", m.guided.cost_rays);
  }
  return text;
}

}  // namespace sheaf::render
