// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "worker/render/plan/film_notes.h"

#include "absl/strings/str_cat.h"
#include "common/scene/settings/sample_bound.h"

namespace sheaf::render {

void AddFilmNotes(const FrameSettings& settings, bool is_spectral,
                  std::vector<std::string>* notes) {
  if (!settings.sensor.empty() && !is_spectral) {
    notes->push_back(
        absl::StrCat("sensor: rgb transport has no wavelengths for ", settings.sensor,
                     "; colors are those of the CIE observer, with the sensor's white balance"));
  }
  if (settings.max_component_value == 0) return;
  notes->push_back(absl::StrCat("biased: samples are clamped to ", settings.max_component_value,
                                "; errors are those of the clamped image"));
  const SampleBound bound = SampleBoundOf(settings);
  notes->push_back(absl::StrCat("certificate: ", bound.most ? "" : "none, because ", bound.reason,
                                bound.most ? "; the error has a certified bound" : ""));
}

}  // namespace sheaf::render
