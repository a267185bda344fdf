// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// GraphicsState: the state that pbrt directives change and AttributeBegin saves.
#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <vector>

#include "common/math/transform.h"
#include "common/scene/pbrt/syntax/parameter_list.h"
#include "common/scene/scene_description.h"
#include "common/scene/spectrum/primaries.h"

namespace sheaf {

struct GraphicsState {
  // The current transformation at the start and the end of the shutter; ActiveTransform selects
  // which of the two the directives change.
  Matrix4 start, end;
  bool start_is_active = true, end_is_active = true;
  bool reverse_orientation = false;
  Primaries primaries = Primaries::kSrgb;  // For the rgb values that follow.
  int32_t material = kNone;                // kNone: the default material.
  int32_t area_light = kNone;
  MediumBoundary media;  // For the surfaces that follow; the camera is in the outside medium.
  // Parameters that Attribute gives to later directives, by target ("shape", "light" ...).
  std::map<std::string, std::vector<Parameter>> attributes;

  bool IsAnimated() const { return !(start == end); }
};

}  // namespace sheaf
