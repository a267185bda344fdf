// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// RayVisibility: which kinds of rays do not see a scene's shapes and lights, as the integrator asks
// for it.
#pragma once

#include <cstdint>
#include <vector>

#include "absl/status/statusor.h"
#include "common/scene/ray_kinds.h"
#include "common/scene/scene_description.h"
#include "common/scene/settings/render_settings.h"
#include "worker/render/geometry/scene_geometry.h"
#include "worker/render/light/light_table.h"

namespace sheaf::render {

struct RayVisibility {
  // A shape hides lights from shadow rays, but not from the rays of some event, or the reverse. The
  // lights that a scattered ray hits are then those that a shadow ray would reach (SearchLights).
  bool splits_shadow = false;
  // Diffuse and glossy rays of one surface may see different things.
  bool splits_lobes = false;
  RayKinds sky = 0;              // The kinds of rays that see no infinite light,
  bool skies_differ = false;     // unless each light has its own: then in `lights`, and `sky` is 0.
  std::vector<RayKinds> lights;  // The same by light of the table; empty: all see all.

  RayKinds OfLight(uint32_t light) const { return lights.empty() ? RayKinds{0} : lights[light]; }
};

// Errors: kInvalidArgument where infinite lights are invisible to different kinds of rays, and the
// frame has groups of lights.
absl::StatusOr<RayVisibility> MakeRayVisibility(const SceneDescription& scene,
                                                const FrameSettings& settings,
                                                const SceneGeometry& geometry,
                                                const LightTable& lights);

}  // namespace sheaf::render
