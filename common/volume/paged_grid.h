// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// PagedGrid: a grid of a page file. Its index is in memory, its leaves are read page by page, and
// every byte is verified before it is used: the index when the grid is opened, a page by its digest
// when it is first read, and by a checksum of the same bytes whenever it is read again.
#pragma once

#include <atomic>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <unordered_map>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "common/math/transform.h"
#include "common/volume/file_bytes.h"
#include "common/volume/page_format.h"
#include "common/volume/volume_grid.h"
#include "common/volume/volume_pages.h"

namespace sheaf::volume {

struct Index3Hash {
  size_t operator()(const Index3& v) const {
    uint64_t h = 0;
    for (const int32_t x : v) h = (h ^ static_cast<uint32_t>(x)) * 0x9e3779b97f4a7c15u;
    return static_cast<size_t>(h ^ (h >> 32));
  }
};

// The part of the index that describes one grid.
struct PageIndex {
  PageGridHead head;
  std::vector<PageRootTile> root_tiles;
  std::vector<PageRegion> regions;
  std::vector<PageEntry> entries;
};

// The beginning of a page in memory: where the leaf of each block begins; 0: the block is no leaf.
struct PageHead {
  std::array<uint32_t, kBlocks> leaf_offset_bytes;
};
static_assert(sizeof(PageHead) == 32);

// Thread safety: const members may be called concurrently.
class PagedGrid : public PageReader {
 public:
  // where: messages begin with it. Errors: kInvalidArgument if the index is damaged: workers
  // compare files with their digests, so that the scene is at fault; kResourceExhausted beyond the
  // limits.
  static absl::StatusOr<std::shared_ptr<const PagedGrid>> Make(
      const std::string& where, std::shared_ptr<const PartedBytes> bytes, PageIndex index,
      const VolumeLimits& limits, std::shared_ptr<VolumePages> pages);
  ~PagedGrid() override;
  PagedGrid(const PagedGrid&) = delete;
  PagedGrid& operator=(const PagedGrid&) = delete;

  VolumeGridInfo Info() const;
  Matrix4 MediumFromIndex() const;
  VolumePages& pages() const { return *pages_; }
  float background() const { return index_.head.background; }
  // See VolumeGrid::MeanValue; 0: not known.
  double mean() const {
    return index_.regions.empty() ? 0
                                  : double{index_.head.mean} + double{index_.regions[0].mean_rest};
  }

  // The region at that position, by its number; kNoRegion if there is none.
  static constexpr uint32_t kNoRegion = UINT32_MAX;
  uint32_t RegionAt(Index3 region_key) const;
  // Null for kNoRegion.
  const PageRegion* Region(uint32_t number) const {
    return number == kNoRegion ? nullptr : &index_.regions[number];
  }
  // The page of a cell, pinned until VolumePages::Unpin; null if it has no leaf.
  PageSlot* Pin(const PageCell& cell) const;
  // The value of a voxel that lies in no leaf. cell: that of the voxel's page; null if there is no
  // region.
  float TileValue(Index3 voxel, const PageCell* cell) const;
  // See VolumeGrid::UniformValue.
  std::optional<float> UniformValue(Index3 lo, Index3 hi) const;
  // See VolumeGrid::BlockRange.
  std::optional<ValueRange> BlockRange(Index3 origin) const;

  absl::StatusOr<uint64_t> ReadPage(uint32_t place, std::span<std::byte> out) const override;

 private:
  PagedGrid(std::string where, std::shared_ptr<const PartedBytes> bytes, PageIndex index,
            std::shared_ptr<VolumePages> pages);
  // Voxels, both ends included; hi < lo on an axis: empty.
  struct Box {
    Index3 lo, hi;
    uint64_t VoxelCount() const;
    // The part in the cube of 2^log2 voxels a side at that position.
    Box Within(Index3 key, int log2) const;
  };
  // Include: false if a voxel is of a leaf, or has another value than *common, which it sets first.
  static bool Include(float value, std::optional<float>* common);
  // The voxels of the box, by parts of 2^log2 voxels a side.
  bool IncludeBox(const Box& box, int log2, std::optional<float>* common) const;
  bool IncludePart(Index3 key, const Box& box, int log2, std::optional<float>* common) const;

  absl::Status Check(const VolumeLimits& limits) const;
  absl::Status CheckEntry(const PageEntry& entry) const;
  absl::Status Damaged(const std::string& what) const;
  bool IsValue(float v) const;
  uint64_t MemoryBytes() const;
  const PageCell* CellOf(Index3 page_key) const;
  float RootValue(Index3 root_key) const;
  const PageEntry* EntryOf(Index3 page_key) const;

  const std::string where_;
  const std::shared_ptr<const PartedBytes> bytes_;
  const PageIndex index_;
  const std::shared_ptr<VolumePages> pages_;
  std::unordered_map<Index3, uint32_t, Index3Hash> region_of_;
  std::unordered_map<Index3, float, Index3Hash> root_value_of_;
  std::vector<Index3> roots_;  // Keys of the root's children that have regions, sorted.
  std::unique_ptr<PageSlot[]> slots_;
  // By page: the checksum of its packed bytes once they were verified; 0: they were not.
  std::unique_ptr<std::atomic<uint64_t>[]> checksum_of_;
};

}  // namespace sheaf::volume
