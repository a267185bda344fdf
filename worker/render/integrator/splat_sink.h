// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// SplatSink: takes what light paths carry to the film.
#pragma once

#include <cstdint>

#include "common/film/light_path_kind.h"
#include "common/math/vec.h"

namespace sheaf::render {

class SplatSink {
 public:
  // wants_moments: AddMoment is called.
  explicit SplatSink(bool wants_moments = false) : wants_moments_(wants_moments) {}
  virtual ~SplatSink() = default;
  // Whether the light at this raster position (pixels, y down; may lie outside of the frame) counts
  // for any pixel. May be true where it does not.
  virtual bool Covers(Vec2d raster) const = 0;
  // A light path meets the film at `raster`. radiance: linear sRGB; its sum over the light paths of
  // a pass, weighted by a pixel's filter, is the pixel's value in that pass. kind and group say
  // which layer of a kind of path and which light group it belongs to; they are ignored unless the
  // frame's outputs have these.
  virtual void Add(Vec2d raster, const Rgb& radiance, LightPathKind kind, uint32_t group) = 0;
  // The light path is merged with a camera path of the pixel (x, y), and adds the radiance to its
  // value in the pass. bias: what it adds to the estimate of the bias of that. kind, group: as of
  // Add.
  virtual void AddMerged(int32_t x, int32_t y, const Rgb& radiance, const Rgb& bias,
                         LightPathKind kind, uint32_t group) = 0;
  // The same splat's radiance before the weight, and the density with which the camera's paths find
  // it while each pixel sends one, over that of a pass of light paths. interfaces:
  // InterfacesOfChain.
  virtual void AddMoment(Vec2d /*raster*/, const Rgb& /*unweighted*/, double /*weight*/,
                         double /*camera_density*/, uint32_t /*interfaces*/) {}

  bool wants_moments() const { return wants_moments_; }

 private:
  const bool wants_moments_;
};

}  // namespace sheaf::render
