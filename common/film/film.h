// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Film: the set of parts of one frame, merged along the canonical tree, and what is developed from
// it. This header gathers the pieces: TileTree (merging), FramePicture (the result), and
// DevelopTile, the arrow from the first to the second.
#pragma once

#include "common/film/film_tile.h"
#include "common/film/frame_picture.h"
#include "common/film/tile_geometry.h"
#include "common/film/tile_tree.h"

namespace sheaf {

// Writes one tile's means and standard errors into the picture: sums divided by the weight, depth
// by the sum of alpha, outputs as their channels say, light and albedo in the picture's colours. A
// pixel with weight 0 becomes 0. Standard errors are 0 where fewer than 2 replicates are there.
// Requires: the picture is from MakeFramePicture with the tile's outputs and its window contains
// the tile. Thread safety: distinct tiles may be developed into one picture concurrently.
void DevelopTile(const FilmTile& sums, FramePicture* picture);

// Notes the names of what the tile shows, for the picture's manifests. Thread safety: one call at a
// time for each picture.
void NoteNames(const FilmTile& sums, FramePicture* picture);

}  // namespace sheaf
