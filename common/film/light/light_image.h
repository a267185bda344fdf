// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// The image of a frame that has two kinds of path: the light of its camera paths and that of its
// light paths are estimated apart, each over its own samples, and added.
#pragma once

#include <string>
#include <vector>

#include "common/film/film_outputs.h"
#include "common/film/frame_image.h"
#include "common/film/tile_geometry.h"

namespace sheaf {

// Sets the pixels of `rect` in *image to the camera's with the light of the light paths added: the
// means of light (R, G, B, light groups or layers) are sums, standard errors add in quadrature, as
// the two are independent, and counts of what is not finite add. All else is the camera's. Pixels
// without light passes are the camera's.
// Where the light has an estimate of the bias of merging, its size is added to standard errors in
// quadrature too: so intervals, stop rules and error estimates are those of noise and bias
// together. Requires: three images from MakeFrameImage with the same arguments, but for the outputs
// of the light, LightOutputsOf; developed by DevelopTile; rect lies in their window. *image may
// have the light layer.
void AddLight(const FrameImage& camera, const FrameImage& light, const PixelRect& rect,
              FrameImage* image);

// The light layer of an image holds what its light paths alone have found, from which the two kinds
// of path can be told apart again (resumed_image.h). Its channels are those of LightLayerChannels.
// No light group has such names, as those of groups have no dot.
inline constexpr char kLightLayerPrefix[] = "light.";
// A channel of the light paths' image, and its name in the light layer.
struct LightLayerChannel {
  std::string of_image, of_layer;
};
// R, G, B > light.mean.{R,G,B}; stderr.{R,G,B} > light.stderr.{R,G,B}; samples > light.samples, the
// number of light passes; nonfinite > light.nonfinite; then of each light group
// NAME.{R,G,B} > light.group.NAME.{R,G,B}, in the order of the groups; at last merge.bias.{R,G,B},
// under the same names. outputs: of the light.
std::vector<LightLayerChannel> LightLayerChannels(const FilmOutputs& outputs);
// The name in the light layer of R, G or B, and of their standard errors.
std::string LightMeanChannel(const std::string& component);
std::string LightErrorChannel(const std::string& component);
// Adds the layer as the image's last channels; sets it where the image has it. Requires: images as
// for AddLight.
void SetLightLayer(const FrameImage& light, FrameImage* image);

}  // namespace sheaf
