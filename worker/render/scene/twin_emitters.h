// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Emitters that a scene gives twice. The front one of two equal emitters at one place hides the
// other (contact.h), unless both let light through: then both are seen, and the pair is nearly
// twice as bright as one.
#pragma once

#include "common/scene/scene_description.h"

namespace sheaf::render {

// Takes from the world every emissive shape that equals an earlier one in shape, place, material,
// media and emission, and notes them. Equal materials are those of one index, or written alike.
void RemoveTwinEmitters(SceneDescription* scene);

}  // namespace sheaf::render
