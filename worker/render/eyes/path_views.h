// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// The views that share a path: an eye, a point of the lens and a time of the shutter each. A path
// from one view is reconnected, at its first vertex, to the others of its set.
//
// The views of a set differ by steps of a lattice in (lens, time), modulo 1, and the lens point and
// time of a path are uniform. So the set is found with the same density from each of its views, and
// the balance heuristic needs the densities of the first vertex alone (shared_vertex.h). The number
// of views depends on the first vertex alone, too: on how far its image moves over the lens and the
// shutter. Source of the lattices: Niederreiter 1992, "Random Number Generation and Quasi-Monte
// Carlo Methods", ch. 5.
#pragma once

#include <cstdint>

#include "worker/render/camera/camera.h"
#include "worker/render/camera/eye_camera.h"

namespace sheaf::render {

class CompiledScene;

// The most points of lens and shutter in a set of views, and the most views: those of two eyes.
inline constexpr int32_t kPathSharesMax = 8;
inline constexpr int32_t kPathViewsMax = 2 * kPathSharesMax;
// The pixels over which the image of a point moves, for each view of the set that shares it: the
// diameter of its circle of confusion, and the length of its trace while the shutter is open. With
// fewer, views see the point in the same pixels, and sharing finds nothing new.
inline constexpr double kLensPixelsPerShare = 1.5, kShutterPixelsPerShare = 3;

// How the paths of a frame are shared; fixed for the frame.
struct PathSharing {
  int32_t shares_max = 1;     // The most points of lens and shutter that share a path.
  bool through_lens = false;  // Views differ by points of the lens.
  bool over_shutter = false;  // Views differ by times: only where nothing but the camera moves.
  // A path counts in all pixels whose filters cover its points on the film, not in one.
  bool by_filter = false;
};
PathSharing SharingOf(const CompiledScene& scene);

// The camera of an eye; the scene's where the frame is not a stereo one. And the width of its film.
const Camera& CameraOf(const CompiledScene& scene, Eye eye);
int32_t FilmWidthOf(const CompiledScene& scene);

// Where a path begins.
struct PathOrigin {
  Eye eye = Eye::kLeft;  // Also where the frame is not a stereo one.
  Vec2f lens{};          // In [0, 1)^2, as for Camera::SampleWi.
  float time_u = 0;      // In [0, 1), as for Camera::ShutterFraction.
};

struct PathView {
  Eye eye = Eye::kLeft;
  Vec2f lens{};
  float time = 0;  // A fraction of the shutter interval.
};

// The i-th of `count` views of the origin's set that are the given eye's; i = 0 of the origin's eye
// is the origin. Requires: count is a power of two up to kPathSharesMax.
PathView ViewOf(const CompiledScene& scene, const PathSharing& sharing, const PathOrigin& origin,
                Eye eye, int32_t count, int32_t i);

// How many points of lens and shutter share the paths whose first vertex is p: a power of two up to
// shares_max, by the pixels over which its image moves. time: that of the path.
int32_t SharesAt(const CompiledScene& scene, const PathSharing& sharing, Vec3f p, float time);

}  // namespace sheaf::render
