// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// VolumeGrid: an immutable sparse grid of densities, temperatures or velocities, for lookup. It
// holds one verified NanoVDB image: every offset that a lookup may follow lies inside it. A grid
// comes from a file (volume_file.h) or from an array (VolumeGridFromArray). Copies share the image.
//
// Spaces: *index* space has one voxel per unit, with voxel (i, j, k) at exactly that point;
// *medium* space is the file's world space. Values between voxels are trilinear.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <memory>
#include <optional>
#include <span>
#include <string>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "common/math/transform.h"
#include "common/math/vec.h"

namespace sheaf {

struct VolumeLimits {
  uint64_t grid_bytes_max = uint64_t{16} << 30;   // One grid's image in memory.
  uint64_t total_bytes_max = uint64_t{32} << 30;  // All grids of a file.
  int32_t grid_count_max = 4096;                  // Per file.
  int32_t index_abs_max = 1 << 24;                // Coordinates of values.
  uint32_t root_tile_count_max = 1 << 16;         // Lookups search the root's table.
};

using Index3 = std::array<int32_t, 3>;

// The purpose of a grid, by its name.
enum class VolumeRole { kDensity, kTemperature, kVelocity, kEmission, kOther };
VolumeRole VolumeRoleOf(const std::string& grid_name);

enum class VolumeValueType { kFloat, kFp4, kFp8, kFp16, kFpN, kVec3f };

// Range of all values that lookups may encounter, inclusive.
struct ValueRange {
  float min = 0, max = 0;
  friend bool operator==(const ValueRange&, const ValueRange&) = default;
};

struct VolumeGridInfo {
  std::string name;
  VolumeRole role = VolumeRole::kOther;
  VolumeValueType type = VolumeValueType::kFloat;
  // Bounds of the active voxels; index_min > index_max if there are none.
  Index3 index_min{0, 0, 0}, index_max{-1, -1, -1};
  uint64_t active_voxel_count = 0;
  float background = 0;  // For a vector grid: the length.
  // Range of every value that a lookup can encounter, including inactive voxels, tiles and
  // background. For a vector grid: of the lengths.
  ValueRange values;
  uint64_t memory_bytes = 0;
};

// A box of index space; lo > hi on an axis: empty.
struct IndexBox {
  Vec3d lo{1, 1, 1}, hi{0, 0, 0};
};

// Bytes with the alignment that NanoVDB requires.
class VolumeBytes {
 public:
  static constexpr size_t kAlignment = 32;
  VolumeBytes() = default;
  // The bytes are uninitialized. data() is null if memory is short.
  explicit VolumeBytes(uint64_t size_bytes);
  std::byte* data() const { return data_.get(); }
  uint64_t size() const { return size_; }

 private:
  struct Free {
    void operator()(std::byte* p) const { std::free(p); }
  };
  std::unique_ptr<std::byte[], Free> data_;
  uint64_t size_ = 0;
};

namespace volume {
class PagedGrid;
class PagedPins;
}  // namespace volume

class VolumeGrid {
 public:
  // Caches the nodes that the last lookup visited, for one call site; of a page file, it keeps up
  // to eight pages in memory. Cheap to create. Requires: the grid outlives it.
  class Cursor {
   public:
    explicit Cursor(const VolumeGrid& grid);
    ~Cursor() {
      if (is_paged_) Unpin();
    }
    Cursor(const Cursor&) = delete;
    Cursor& operator=(const Cursor&) = delete;

   private:
    friend class VolumeGrid;
    volume::PagedPins* pins();
    void Unpin();
    // NanoVDB's accessor, or the pins of pages.
    alignas(8) std::array<std::byte, 80> accessor_;
    bool is_paged_;
  };

  // Takes ownership of the image after verifying every node and value, with `thread_count` threads.
  // Errors: kInvalidArgument, kDataLoss if the image is not a valid NanoVDB grid of these types or
  // holds NaN or infinity; kResourceExhausted beyond the limits. Messages begin with `where`.
  static absl::StatusOr<VolumeGrid> FromImage(VolumeBytes image, const std::string& where,
                                              const VolumeLimits& limits, int thread_count = 1);

  // A grid of a page file, whose index is verified. Errors: kInvalidArgument if its transform is
  // singular.
  static absl::StatusOr<VolumeGrid> FromPages(std::shared_ptr<const volume::PagedGrid> pages,
                                              const std::string& where);

  const VolumeGridInfo& info() const { return info_; }
  // The bytes of this grid's share of the image: summed over the grids that hold it, the image. A
  // page file counts its index, and VolumePages its pages.
  uint64_t memory_bytes() const;
  // Whether leaves are read page by page.
  bool is_paged() const { return pages_ != nullptr; }
  // Tells a paged grid's VolumePages of memory that volumes take beside pages.
  void AddOtherBytes(uint64_t bytes) const;
  bool is_vector() const { return info_.type == VolumeValueType::kVec3f; }
  const Matrix4& medium_from_index() const { return medium_from_index_; }
  const Matrix4& index_from_medium() const { return index_from_medium_; }
  // The extent of the medium: from the first active voxel to one past the last, like pbrt-v4's
  // world bounds of a NanoVDB grid; for an array, from half a voxel before the first to half a
  // voxel after the last.
  const IndexBox& box() const { return box_; }
  void set_box(const IndexBox& box) { box_ = box; }

  // The value at a point of index space. It lies between the least and the greatest of the eight
  // surrounding voxels, exactly. Outside all nodes, and if p is not finite: the background.
  // Requires: !is_vector(); the cursor belongs to this grid.
  // Thread safety: one cursor per thread.
  float At(Vec3d p_index, Cursor* cursor) const;
  // Requires: is_vector().
  Vec3f VectorAt(Vec3d p_index, Cursor* cursor) const;

  // The mean of At over 16^3 places that fill the box evenly. Page files keep it, so that no page
  // is read. 0 if the box is empty. Requires: !is_vector().
  double MeanValue() const;

  // OK if the grid can be a density.
  // Errors: kInvalidArgument if a value is negative, naming the least one, or if the grid is a grid
  // of vectors.
  absl::Status CheckDensity(const std::string& where) const;

  // The values of lo..hi, inclusive, x slowest.
  // Requires: !is_vector(); out has the size of the box.
  void ReadBox(Index3 lo, Index3 hi, std::span<float> out, Cursor* cursor) const;
  // The common value of all voxels of lo..hi, if they lie in tiles (or outside all nodes) of the
  // same value.
  std::optional<float> UniformValue(Index3 lo, Index3 hi) const;
  // The exact range of the block of 8^3 voxels at `origin`, of one voxel below it and of three
  // above, along each axis, if it is known without reading voxels. Requires: !is_vector(); origin
  // is a multiple of 8.
  std::optional<ValueRange> BlockRange(Index3 origin) const;
  // The functions ReadBox and UniformValue for a grid of vectors: for one component, and for all.
  // Requires: is_vector().
  void ReadComponentBox(size_t component, Index3 lo, Index3 hi, std::span<float> out,
                        Cursor* cursor) const;
  std::optional<Vec3f> UniformVector(Index3 lo, Index3 hi) const;

 private:
  VolumeGrid() = default;
  float PagedAt(Vec3d p_index, Cursor* cursor) const;
  // Sets the inverse transform and the box.
  absl::Status Place(const std::string& where);

  // One of them is there.
  std::shared_ptr<const VolumeBytes> image_;
  std::shared_ptr<const volume::PagedGrid> pages_;
  VolumeGridInfo info_;
  Matrix4 medium_from_index_, index_from_medium_;
  IndexBox box_;
};

}  // namespace sheaf
