// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// PathKind: where the integrator's paths begin.
#pragma once

#include <cstdint>

namespace sheaf::render {

enum class PathKind : uint8_t {
  kCamera,             // At the camera; they alone make the image.
  kCameraBesideLight,  // At the camera; light paths find part of the light.
  kLight,              // At a light.
  kEye,                // At one of two eyes, which share their paths: worker/render/eyes.
  kMutated,            // At the camera, by numbers that a chain moves: worker/render/mutations.
  kCameraWithChains,   // At the camera; chains find part of the light: chains.h.
};

}  // namespace sheaf::render
