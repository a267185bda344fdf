// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Film: the set of parts of one frame, merged along the canonical tree, and what is developed from it.
#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "common/film/film_tile.h"
#include "common/film/tile_geometry.h"

namespace sheaf {

// The parts of one tile. Siblings are merged as soon as both are there, so memory does not grow with
// the number of parts. A pure function of the set: any order of Insert gives the same bits.
class TileTree {
 public:
  explicit TileTree(PixelRect rect) : rect_(rect) {}
  // Errors: kAlreadyExists when the block, or a block that contains it, is already there;
  // kInvalidArgument when the rect differs or the block only partly overlaps what is there.
  absl::Status Insert(FilmTile part);
  bool Covers(SampleBlock block) const;
  uint64_t SampleCount() const;
  // Nodes in ascending order; no two are siblings.
  const std::map<uint64_t, FilmTile>& nodes() const { return nodes_; }
  // The tree's value over everything there, as the canonical tree with absent right halves.
  // Requires: at least one node; the nodes cover a prefix [0, n). Use Covers to know.
  FilmTile Root() const;
  // Sum of all nodes in ascending order, gaps allowed: for previews, never for delivery.
  FilmTile PreviewSum() const;
  const PixelRect& rect() const { return rect_; }

 private:
  PixelRect rect_;
  std::map<uint64_t, FilmTile> nodes_;  // Keyed by block.first.
};

// A developed picture: float32 planes, row-major over `window`.
struct FramePicture {
  PixelRect window;         // The rendered pixels (crop) in the full frame.
  int32_t frame_width_px = 0, frame_height_px = 0;
  // Means: R G B A albedo.{R,G,B} normal.{X,Y,Z} depth.Z, then samples, stderr.{R,G,B}, nonfinite.
  std::vector<std::string> channel_names;
  std::vector<std::vector<float>> planes;
  std::map<std::string, std::string> metadata;  // Written as "sheaf:KEY" attributes.
  const std::vector<float>* Find(const std::string& channel) const;
};

struct FrameError {
  double relative_mse = 0;          // Estimated relMSE of the frame, see error_estimate.h.
  double standard_error = 0;        // Of the frame's mean luminance.
  uint64_t nonfinite_count = 0;
  uint64_t sample_count = 0;        // Over all pixels.
};

// An empty picture of all channels for the window.
FramePicture MakeFramePicture(PixelRect window, int32_t frame_width_px, int32_t frame_height_px);
// Writes one tile's means and standard errors into the picture. A pixel with weight 0 becomes 0.
// Standard errors are 0 where fewer than 2 replicates are there.
void DevelopTile(const FilmTile& sums, FramePicture* picture);
// Error over the picture as developed so far (pixels without samples are left out).
FrameError EstimateError(const FramePicture& picture);
// SHA-256 (hex) over channel names and the bits of all planes, in order: the picture's identity.
std::string PictureDigest(const FramePicture& picture);

}  // namespace sheaf
