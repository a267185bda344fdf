// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// The layout of a page file, byte for byte: the compressed pages of all grids, an index, a trailer.
// A page holds the leaves of 2 x 2 x 2 blocks of 8^3 voxels, as NanoVDB stores them. All else of a
// grid is in the index: where pages are, values where there are no leaves, and ranges of blocks.
//
//     pages | index (PageGridHead, root tiles, regions, entries; for each grid) | PageTrailer
//
// For farms its pages are in parts, which are files of their own, cut between pages, and all else
// is in a file that says how large the parts are:
//
//     kPartsMagic | uint64 number of parts | uint64 bytes of each | index | PageTrailer
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include "common/volume/volume_grid.h"

namespace sheaf::volume {

// Sides as powers of two, in voxels. A region is a lower node of NanoVDB, a root tile an upper one.
inline constexpr int kBlockLog2 = 3, kPageLog2 = 4, kRegionLog2 = 7, kRootLog2 = 12;
inline constexpr size_t kBlocks = 8, kCells = 512;  // Blocks of a page, and pages of a region.

inline constexpr uint64_t kPageMagic =
    0x3150566661656853;  // "SheafVP1": the first bytes, and the last.
inline constexpr uint64_t kPartsMagic = 0x3151566661656853;  // "SheafVQ1".
// Parts of a file, each of which a program that renders keeps open. They are at least this large.
inline constexpr uint64_t kPagePartsMax = 256, kPartBytesMin = uint64_t{1} << 20;

// Places of a block in its page and of a page in its region, x slowest. key: its origin in units of
// its side.
constexpr size_t BlockPlace(Index3 key) {
  return static_cast<size_t>(((key[0] & 1) << 2) | ((key[1] & 1) << 1) | (key[2] & 1));
}
constexpr size_t CellPlace(Index3 key) {
  return static_cast<size_t>(((key[0] & 7) << 6) | ((key[1] & 7) << 3) | (key[2] & 7));
}
constexpr Index3 Shifted(Index3 at, int log2) {
  return {at[0] >> log2, at[1] >> log2, at[2] >> log2};
}

struct PageGridHead {
  std::array<char, 256> name;  // Ends with a zero.
  double matrix[9], offset[3];
  uint64_t image_bytes;  // The size of the NanoVDB image that the grid was made of.
  uint64_t active_voxel_count;
  Index3 index_min, index_max;
  float background;
  ValueRange values;
  uint32_t type;  // VolumeValueType.
  uint32_t root_tile_count, region_count, page_count;
  float mean;  // VolumeGrid::MeanValue, rounded; 0: not known, as in earlier files.
};
static_assert(sizeof(PageGridHead) == 424);

struct PageRootTile {
  Index3 key;  // Origin >> kRootLog2.
  float value;
};
static_assert(sizeof(PageRootTile) == 16);

// A page's place in the table of entries, plus one; 0: all its voxels have `value`, without leaves.
struct PageCell {
  float value;
  uint32_t page;
};
struct PageRegion {
  Index3 key;       // Origin >> kRegionLog2.
  float mean_rest;  // In the first region: VolumeGrid::MeanValue less the head's mean. Else 0.
  std::array<PageCell, kCells> cells;
};
static_assert(sizeof(PageRegion) == 4112);

struct PageEntry {
  Index3 key;  // Origin >> kPageLog2.
  uint32_t packed_bytes, bytes;
  uint32_t mask;                          // Bit n: block n is a leaf.
  uint64_t offset_bytes;                  // In the file.
  std::array<std::byte, 32> sha256;       // Digest of the packed bytes.
  std::array<float, kBlocks> tiles;       // Values of blocks that are no leaves; else 0.
  std::array<ValueRange, kBlocks> reach;  // Ranges of blocks, a voxel below and three above.
};
static_assert(sizeof(PageEntry) == 160);

struct PageTrailer {
  uint64_t index_offset_bytes, index_bytes;
  std::array<char, 64> index_sha256;  // Hexadecimal.
  uint32_t grid_count;
  uint32_t version;
  uint64_t magic;
};
static_assert(sizeof(PageTrailer) == 96);
inline constexpr uint32_t kPageVersion = 1;

}  // namespace sheaf::volume
