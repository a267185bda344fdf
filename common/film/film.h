// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Film: the parts of one frame, merged along the canonical tree, and the image developed from them.
// This header combines TileTree (merging), FrameImage (the result), FrameError (its remaining
// error), and DevelopTile, which converts the first to the second.
#pragma once

#include "common/film/film_tile.h"
#include "common/film/frame_image.h"
#include "common/film/tile_geometry.h"
#include "common/film/tile_tree.h"

namespace sheaf {

// Writes one tile's means and standard errors into the image: sums divided by the weight, depth by
// the sum of alpha, outputs as their channels define, light and albedo in the image's primaries. A
// pixel with weight 0 becomes 0. Standard errors are 0 if there are fewer than 2 replicates. If the
// image has kEyeDifferenceLayer, the tile is its whole window, of which each eye has a half.
// Requires: the image is from MakeFrameImage with the tile's outputs and its window contains the
// tile.
// Thread safety: distinct tiles may be developed into one image concurrently.
void DevelopTile(const FilmTile& sums, FrameImage* image);

// Records the names of the ids in the tile, for the image's manifests.
// Thread safety: one call at a time per image.
void NoteNames(const FilmTile& sums, FrameImage* image);

}  // namespace sheaf
