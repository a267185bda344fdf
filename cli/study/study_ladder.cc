// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "cli/study/study_ladder.h"

#include <algorithm>
#include <limits>
#include <set>
#include <utility>

#include "absl/strings/str_cat.h"
#include "worker/render/light/choice/light_choice.h"
#include "worker/render/traits/trait_set.h"

namespace sheaf::cli {
namespace {

constexpr int32_t kSimilarityStudied = 8;
constexpr uint32_t kLateRoulette = 8;
constexpr double kClampsStudied[] = {10, 100};

class Ladder {
 public:
  Ladder(const FrameSettings& settings, const render::RenderPlan& plan)
      : given_(settings), plan_(plan) {
    StudySetting& base = Add("as given", "", "");
    base.is_base = true;
    base.how =
        absl::StrCat("depth ", plan.max_depth, ", ",
                     render::Has(plan.traits, render::Trait::kSpectral) ? "spectral" : "RGB", ", ",
                     settings.one_sequence ? "one sequence per pixel" : "16 sequences per pixel");
  }

  std::vector<StudySetting> Take() { return std::move(settings_); }

  void AddSampling() {
    const bool one = given_.one_sequence;
    StudySetting& other =
        Add(one ? "16 sequences" : "one sequence",
            one ? "a pixel's samples from 16 independent sequences, whose spread gives the "
                  "displayed error"
                : "a pixel's samples from one sequence; displayed errors are upper estimates",
            one ? "" : "--one-sequence");
    other.settings.one_sequence = !one;
    other.keeps_error_bars = one;
    StudySetting& stop = Add("adaptive sampling", "adaptive sampling in rounds", "--target-error");
    stop.stops_tiles = true;
    StudySetting& never = Add("no roulette", "no Russian roulette", "");
    never.techniques.roulette_depth_min = std::numeric_limits<uint32_t>::max();
    StudySetting& late =
        Add("late roulette",
            absl::StrCat("no Russian roulette before ", kLateRoulette, " scatterings"), "");
    late.techniques.roulette_depth_min = kLateRoulette;
    if (plan_.max_depth <= static_cast<int32_t>(kLateRoulette)) settings_.pop_back();
    if (plan_.light_count > render::kLightsWeighedMax) {
      Add("uniform light choice", "no light hierarchy: all lights are equally probable", "")
          .techniques.choose_lights_evenly = true;
    }
  }

  // A frame with light paths is compared with the same without them.
  void AddTechniques() {
    const TechniqueSet given = given_.techniques;
    if (!HasLightPaths(given)) return;
    StudySetting& camera = Add("no light paths", "paths from the camera alone",
                               FlagOf(given.Without(Technique::kLightPaths)));
    camera.settings.techniques = given.Without(Technique::kLightPaths);
    camera.is_without_light_paths = true;
    if (!given.Has(Technique::kLightPathsAlone)) return;
    Add("both kinds of path", "paths from the camera find light that paths from lights find too",
        FlagOf(TechniqueSet::kCameraAndLight))
        .settings.techniques = TechniqueSet::kCameraAndLight;
  }

  void AddDepths() {
    std::set<int32_t> depths = {1, 2, plan_.max_depth / 2};
    // If the plan found a smaller depth to be sufficient, a larger one changes nothing.
    if (plan_.depth_cause.empty()) depths.insert(2 * plan_.max_depth);
    for (const int32_t depth : depths) {
      if (depth < 1 || depth == plan_.max_depth) continue;
      StudySetting& setting =
          Add(absl::StrCat("depth ", depth),
              absl::StrCat("light scatters at most ", depth, depth == 1 ? " time" : " times"),
              absl::StrCat("--max-depth ", depth));
      setting.settings.max_depth = depth;
      setting.is_truer = depth > plan_.max_depth;
      setting.is_unbiased = false;
    }
  }

  void AddColor() {
    const bool spectral = render::Has(plan_.traits, render::Trait::kSpectral);
    StudySetting& setting =
        Add(spectral ? "RGB" : "spectral",
            spectral ? "paths carry red, green and blue" : "paths carry four wavelengths",
            spectral ? "--color rgb" : "--color spectral");
    setting.settings.color = spectral ? ColorTransport::kRgb : ColorTransport::kSpectral;
    setting.is_unbiased = false;
  }

  void AddMedia() {
    if (!render::Has(plan_.traits, render::Trait::kMedia)) return;
    const bool has_light = HasLightPaths(given_.techniques);
    if (render::Has(plan_.traits, render::Trait::kHeterogeneousMedia)) {
      if (!has_light) {
        Add("distance samples only", "no equiangular sampling in heterogeneous media", "")
            .techniques.equiangular_mode = render::EquiangularMode::kNever;
        Add("always equiangular", "equiangular sampling in all heterogeneous media", "")
            .techniques.equiangular_mode = render::EquiangularMode::kAlways;
      }
      Add("one majorant", "one density bound for a whole medium", "").techniques.bound_media_once =
          true;
    }
    if (has_light || given_.similarity_after != 0) return;
    StudySetting& similar =
        Add("similarity",
            absl::StrCat("media are isotropic after ", kSimilarityStudied, " scatterings"),
            absl::StrCat("--similarity ", kSimilarityStudied));
    similar.settings.similarity_after = kSimilarityStudied;
    similar.is_unbiased = false;
  }

  void AddClamps() {
    for (const double clamp : kClampsStudied) {
      StudySetting& setting =
          Add(absl::StrCat("clamped at ", clamp),
              absl::StrCat("samples clamped at ", clamp, " times the image's mean",
                           HasLightPaths(given_.techniques) ? "; light paths are not clamped" : ""),
              "");
      setting.clamp_means = clamp;
      setting.is_unbiased = false;
    }
  }

  void AddGeneric() {
    if (plan_.variant_name == "generic" || given_.force_generic_variant) return;
    Add("generic variant", "the variant for all effects, of which this scene uses few", "")
        .settings.force_generic_variant = true;
  }

 private:
  static std::string FlagOf(TechniqueSet techniques) {
    return absl::StrCat("--techniques ", techniques.Name());
  }

  StudySetting& Add(std::string name, std::string how, std::string flag) {
    StudySetting& setting = settings_.emplace_back();
    setting.name = std::move(name);
    setting.how = std::move(how);
    setting.flag = std::move(flag);
    setting.settings = given_;
    return setting;
  }

  const FrameSettings& given_;
  const render::RenderPlan& plan_;
  std::vector<StudySetting> settings_;
};

}  // namespace

std::vector<StudySetting> MakeLadder(const FrameSettings& settings,
                                     const render::RenderPlan& plan) {
  Ladder ladder(settings, plan);
  ladder.AddTechniques();
  ladder.AddSampling();
  ladder.AddDepths();
  ladder.AddColor();
  ladder.AddMedia();
  ladder.AddClamps();
  ladder.AddGeneric();
  return ladder.Take();
}

std::vector<std::string> MissingLadders(const FrameSettings& settings,
                                        const render::RenderPlan& plan) {
  const bool has_light = HasLightPaths(settings.techniques);
  const bool has_media = render::Has(plan.traits, render::Trait::kMedia);
  std::vector<std::string> lines = {
      has_light ? "path guiding: \"sheaf plan --measure --techniques camera\" compares techniques"
                : "techniques (light paths, path guiding): \"sheaf plan --measure\" compares them",
      "clamping is shown for comparison only; Sheaf does not clamp, "
      "because clamping darkens images"};
  if (has_light) {
    lines.emplace_back(
        "effects with light paths: their times, variances and errors are those of paths from the "
        "camera alone");
  }
  if (plan.light_count <= render::kLightsWeighedMax) {
    lines.push_back(absl::StrCat("light hierarchy: with ", plan.light_count,
                                 " lights, each is weighted individually"));
  }
  if (!has_media) {
    lines.emplace_back("techniques for media: the scene has no media");
  } else if (has_light) {
    lines.emplace_back("similarity and equiangular sampling: neither is combined with light paths");
  }
  return lines;
}

}  // namespace sheaf::cli
