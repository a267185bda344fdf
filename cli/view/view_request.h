// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// ViewRequest: what another program wants to see, as a line of JSON.
#pragma once

#include <cstdint>
#include <string>

#include "absl/status/statusor.h"
#include "common/scene/settings/render_settings.h"
#include "worker/render/scene/scene_view.h"

namespace sheaf::cli {

struct ViewRequest {
  int64_t id = 0;      // Chosen by the program; its images have it.
  std::string scene;   // A scene file to load; empty: the one that is loaded.
  std::string camera;  // Directives before WorldBegin, as in a scene file; empty: the last view's.
};

// Errors: kInvalidArgument for a line that is no such object, or lacks both scene and camera.
absl::StatusOr<ViewRequest> ParseViewRequest(const std::string& line);

// A view with its number of samples per pixel.
struct SampledView {
  render::SceneView view;
  uint64_t samples = 0;
};
// Reads the directives of a request. Errors: kInvalidArgument, with the line of the text.
absl::StatusOr<SampledView> ReadView(const std::string& camera, const RenderSettings& settings);
// The view of a whole scene. Errors: those of ResolveSettings.
absl::StatusOr<SampledView> ViewOf(const SceneDescription& scene, const RenderSettings& settings);

// The view in an image with a divisor-th of the pixels in each direction, of at least 1: its window
// covers that of the view.
render::SceneView Coarse(const render::SceneView& view, int32_t divisor);

}  // namespace sheaf::cli
