// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// The only file that uses OpenEXR: encodes film parts and developed images to bytes and back,
// without loss.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>

#include "absl/status/statusor.h"
#include "common/film/film.h"
#include "common/film/film_tile.h"
#include "common/film/pixel_lattice.h"
#include "common/film/task_kind.h"
#include "common/film/tile_cells.h"

namespace sheaf {

// Identity of a part, stored in the EXR header and checked on decoding.
struct PartHeader {
  std::string frame_digest;  // Hex SHA-256: scene, settings, frame, numeric profile.
  std::string numeric_profile;
  // The pixels outside of these are empty.
  PixelLattice lattice = {};
  TileCells cells = {};
  TaskKind kind = TaskKind::kCamera;
};

// A part as a float32 EXR that any viewer opens. Equal parts give equal bytes (of one build). The
// display window is the tile, and so is the data window; a part of some cells has one line per
// cell, holding its pixels row by row. Only lattices and light passes are compressed.
// Channels: R, G, B, weight (heads of the double-float sums), lo.R, lo.G, lo.B, lo.weight (their
// tails), A, albedo.{R,G,B}, normal.{X,Y,Z}, depth.Z, samples, nonfinite, and for each replicate NN
// that is present rNN.{R,G,B,W}; with outputs, NAME and lo.NAME of each mean channel, and for each
// requested kind of id ids.KIND.NNN.{id,W,lo}: a pixel's list of ids (plus one; 0 is none) with
// their weights, from NNN = 000. All are sums over the block.
// Attributes: sheaf:format "film-part 1", sheaf:frameDigest, sheaf:numericProfile,
// sheaf:blockFirst, sheaf:blockCount (decimal strings); sheaf:kind "light" in a part of light
// passes; if not all pixels are rendered,
// sheaf:pixelStridePx and sheaf:pixelSeed (PixelLattice), or sheaf:cellSizePx and sheaf:cells
// (TileCells; decimal strings); with outputs, sheaf:outputs; sheaf:ids.KIND: the ids' names,
// "NUMBER NAME" per line with C escapes.
// Requires: the tile has the header's cells (WhyNoCells); not both a lattice and cells, and none of
// them with light passes.
std::string EncodePart(const FilmTile& tile, const PartHeader& header);
struct DecodedPart {
  FilmTile tile;
  PartHeader header;
};
// The bytes are untrusted: the header is checked against part_pixels_max before memory is
// allocated, and a part is rejected if its sums are not finite or its sample counts do not add up
// to its block.
// Errors: kInvalidArgument (not a part, wrong channels, absurd size), kDataLoss (truncated or
// corrupt).
absl::StatusOr<DecodedPart> DecodePart(std::string_view bytes, int64_t part_pixels_max = 1 << 22);

// The largest readable image, in bytes of all its channels as float32.
inline constexpr int64_t kImageBytesMax = int64_t{1} << 35;
// The most that a file may have beyond its pixels: metadata.
inline constexpr int64_t kImageHeaderBytesMax = int64_t{1} << 26;

// Writes atomically (temporary file, fsync, rename), in the default format of exr_format.h. Errors
// carry the path and the reason.
absl::Status WriteFrameImage(const FrameImage& image, const std::string& path);
std::string EncodeFrameImage(const FrameImage& image);
// Reads any flat EXR, scan lines or tiles, of one part or several (those with the first one's data
// window): its half, float and uint channels as float32, without subsampled ones. R, G and B must
// be present, bare or under a layer ("beauty.R"; the first layer that has all three is then
// renamed); their primaries are those of the file, or sRGB's if it names none. Channels have the
// names of exr_channels.h, attributes the texts of exr_attributes.h.
// image_bytes_max bounds the memory of the image and of its file: a small file may declare a large
// image.
// Errors: kInvalidArgument, kDataLoss as above; kResourceExhausted beyond image_bytes_max; those of
// reading the file.
absl::StatusOr<FrameImage> ReadFrameImage(const std::string& path,
                                          int64_t image_bytes_max = kImageBytesMax);
absl::StatusOr<FrameImage> DecodeFrameImage(std::string_view bytes,
                                            int64_t image_bytes_max = kImageBytesMax);

}  // namespace sheaf
