// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Notes of a plan on its film.
#pragma once

#include <string>
#include <vector>

#include "common/scene/settings/render_settings.h"

namespace sheaf::render {

// Notes settings with which the film shows something other than the light of the scene, and whether
// the frame's error can be certified if its samples are clamped. is_spectral: whether paths carry
// wavelengths.
void AddFilmNotes(const FrameSettings& settings, bool is_spectral, std::vector<std::string>* notes);

}  // namespace sheaf::render
