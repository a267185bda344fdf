// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// The image of a frame that has two kinds of path: the light of its camera paths and that of its
// light paths are estimated apart, each over its own samples, and added.
#pragma once

#include "common/film/frame_image.h"
#include "common/film/tile_geometry.h"

namespace sheaf {

// Sets the pixels of `rect` in *image to the camera's with the light of the light paths added: the
// means of light (R, G, B, light groups or layers) are sums, standard errors add in quadrature, as
// the two are independent, and counts of what is not finite add. All else is the camera's. Pixels
// without light passes are the camera's.
// Requires: three images from MakeFrameImage with the same arguments, developed by DevelopTile;
// rect lies in their window. *image may have the light layer.
void AddLight(const FrameImage& camera, const FrameImage& light, const PixelRect& rect,
              FrameImage* image);

// The light layer of an image: the light of its light paths alone, light.{R,G,B}, and its standard
// errors, light.stderr.{R,G,B}. Adds the layer as the image's last channels; sets it where the
// image has it. Requires: images as for AddLight.
inline constexpr char kLightLayerPrefix[] = "light.";
void SetLightLayer(const FrameImage& light, FrameImage* image);

}  // namespace sheaf
