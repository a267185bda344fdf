// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// LearnedFields: all that a training learned about a scene.
#pragma once

#include <string>
#include <string_view>

#include "absl/status/statusor.h"
#include "worker/render/guiding/contribution_field.h"
#include "worker/render/guiding/emission_field.h"
#include "worker/render/guiding/guiding_field.h"
#include "worker/render/light/choice/light_visibility.h"

namespace sheaf::render {

struct LearnedFields {
  GuidingField directions;
  // By the regions of `directions`; these have no directions where lights are learned alone.
  LightVisibility lights;
  // By the same regions; empty where the frame's paths are not split.
  ContributionField contributions = {};
  // Empty where the frame's emission is not guided, and where no light path reached the picture.
  EmissionField emission = {};

  // As GuidingField::Encode and Decode. At most kLearnedFieldsBytesMax.
  std::string Encode() const;
  // choice: that of the scene's lights. emitting_count: LightEmission::choice_count(); 0 where no
  // paths begin at lights.
  static absl::StatusOr<LearnedFields> Decode(std::string_view bytes, const LightChoice& choice,
                                              uint32_t emitting_count);
};

inline constexpr size_t kLearnedFieldsBytesMax = kGuidingDirectionsBytesMax +
                                                 kLightVisibilityBytesMax + kContributionBytesMax +
                                                 kEmissionBytesMax + 4 * sizeof(uint64_t);
static_assert(kGuidingRegionsMax <= kLightVisibilityRegionsMax);

}  // namespace sheaf::render
