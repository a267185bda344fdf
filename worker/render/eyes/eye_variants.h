// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// The compiled variants of the integrator for frames whose paths count in several pixels, and what
// they give to the film.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include "common/film/film_tile.h"
#include "worker/render/eyes/path_views.h"
#include "worker/render/integrator/ray_counts.h"

namespace sheaf::render {

// The contributions of one path. Radiances include their shares, the other members of samples do
// not.
struct SharedSample {
  FilmSample own;       // The sample of the path's own pixel.
  float own_share = 1;  // The part of a sample of the pixel that it stands for; 0 for none.
  // The same per pixel of the film of an eye, around a point of it; albedo and alpha are those of
  // `own`.
  struct Place {
    Eye eye;
    Vec2d film;
    Rgb radiance;
    Vec3f normal;
    float depth;
    float share;
  };
  int32_t place_count = 0;
  std::array<Place, kPathViewsMax> places;
};

class EyeSink {
 public:
  virtual ~EyeSink() = default;
  // x, y: the path's pixel of the eye's own film. Called once for each, for one eye after the
  // other.
  virtual void Add(Eye eye, int32_t x, int32_t y, const SharedSample& sample) = 0;
};

// Traces sample `pass` of each pixel of row y of the eye. sharing: SharingOf(scene).
using EyeRowFunction = void (*)(const CompiledScene& scene, const PathSharing& sharing, Eye eye,
                                int32_t y, uint64_t pass, EyeSink* sink, RayCounts* counts);
// variant: an index in AllEyeVariants().
EyeRowFunction EyeRowFunctionOf(size_t variant);

// Defined once for each variant, in generated files.
template <TraitBits kTraits>
void TraceEyeRow(const CompiledScene& scene, const PathSharing& sharing, Eye eye, int32_t y,
                 uint64_t pass, EyeSink* sink, RayCounts* counts);

}  // namespace sheaf::render
