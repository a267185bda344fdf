// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "cli/commands/stereo_option.h"

#include <string>
#include <vector>

#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_split.h"

namespace sheaf::cli {
namespace {

constexpr char kStereoOption[] = "--stereo";
constexpr float kEyeNumberMax = 1e6f;

// Parses "0.065" or "0.065,2.5".
void ParseStereo(const std::string& text, RenderSettings* settings) {
  const std::vector<std::string> items = absl::StrSplit(text, ',');
  const auto parse = [](const std::string& item, float* distance) {
    return absl::SimpleAtof(item, distance) && *distance > 0 && *distance <= kEyeNumberMax;
  };
  if (items.size() <= 2 && parse(items[0], &settings->eye_distance) &&
      (items.size() == 1 || parse(items[1], &settings->eye_convergence))) {
    return;
  }
  throw CLI::ValidationError(
      kStereoOption, absl::StrCat(text,
                                  ": expected EYE_DISTANCE or EYE_DISTANCE,CONVERGENCE, both "
                                  "above 0, as in 0.065,2.5"));
}

}  // namespace

void AddStereoOption(CLI::App* command, RenderSettings* settings) {
  const OptionGroup group(command, "Scene and samples");
  command
      ->add_option_function<std::string>(
          kStereoOption, [settings](const std::string& text) { ParseStereo(text, settings); },
          "Render two eyes, this far apart, in units of the camera's space; with CONVERGENCE, both "
          "see "
          "a point that far away in the middle of their images. They share paths, so that both "
          "cost "
          "little more than one. The EXR has the views left and right; PNGs show them side by side "
          "(see docs/stereo.md)")
      ->type_name("EYE_DISTANCE[,CONVERGENCE]");
}

}  // namespace sheaf::cli
