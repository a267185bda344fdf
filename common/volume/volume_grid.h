// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// VolumeGrid: an immutable sparse grid of densities, temperatures or velocities, for look-up. What
// is held is one NanoVDB image that has been verified: every offset a look-up may follow lies
// inside it. A grid comes from a file (volume_file.h) or from an array (VolumeGridFromArray).
//
// Spaces: *index* space has one voxel to the unit, voxel (i, j, k) sits at that very point;
// *medium* space is what the file calls world. Values between voxels are trilinear.
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
  uint64_t grid_bytes_max = uint64_t{16} << 30;   // Of one grid's image in memory.
  uint64_t total_bytes_max = uint64_t{32} << 30;  // Of all grids of a file.
  int32_t grid_count_max = 4096;                  // To a file.
  int32_t index_abs_max = 1 << 24;                // Of the coordinates of values.
  uint32_t root_tile_count_max = 1 << 16;         // Look-ups search the root's table.
};

using Index3 = std::array<int32_t, 3>;

// What a grid is for, by its name.
enum class VolumeRole { kDensity, kTemperature, kVelocity, kEmission, kOther };
VolumeRole VolumeRoleOf(const std::string& grid_name);

enum class VolumeValueType { kFloat, kFp4, kFp8, kFp16, kFpN, kVec3f };
const char* VolumeValueTypeName(VolumeValueType type);

// Of values and of all that look-ups may meet; both ends belong to it.
struct ValueRange {
  float min = 0, max = 0;
  friend bool operator==(const ValueRange&, const ValueRange&) = default;
};

struct VolumeGridInfo {
  std::string name;
  VolumeRole role = VolumeRole::kOther;
  VolumeValueType type = VolumeValueType::kFloat;
  // Of active voxels; index_min > index_max where there are none.
  Index3 index_min{0, 0, 0}, index_max{-1, -1, -1};
  uint64_t active_voxel_count = 0;
  float background = 0;  // Of a vector grid: the length.
  // Of every value a look-up can meet, inactive voxels, tiles and background among them. Of a
  // vector grid: of the lengths.
  ValueRange values;
  uint64_t memory_bytes = 0;
};

// A box of index space; lo > hi on an axis: empty.
struct IndexBox {
  Vec3d lo{1, 1, 1}, hi{0, 0, 0};
};

// Bytes aligned as NanoVDB wants them.
class VolumeBytes {
 public:
  static constexpr size_t kAlignment = 32;
  VolumeBytes() = default;
  // The bytes are not set. Null data() where memory is short.
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

class VolumeGrid {
 public:
  // What one call site remembers between look-ups: the nodes it met last. A value; cheap to make.
  class Cursor {
   public:
    explicit Cursor(const VolumeGrid& grid);

   private:
    friend class VolumeGrid;
    alignas(8) std::array<std::byte, 80> accessor_;
  };

  // Takes the image after looking at every node and value of it, by `thread_count` threads.
  // Errors: kInvalidArgument, kDataLoss where the image is no sound NanoVDB grid of these types or
  // holds NaN or infinity; kResourceExhausted beyond the limits. Messages begin with `where`.
  static absl::StatusOr<VolumeGrid> FromImage(VolumeBytes image, const std::string& where,
                                              const VolumeLimits& limits, int thread_count = 1);

  const VolumeGridInfo& info() const { return info_; }
  bool is_vector() const { return info_.type == VolumeValueType::kVec3f; }
  const Matrix4& medium_from_index() const { return medium_from_index_; }
  const Matrix4& index_from_medium() const { return index_from_medium_; }
  // Where the medium is: from the first active voxel to one past the last, as pbrt-v4 takes the
  // world bounds of a NanoVDB grid; of an array, from half a voxel before the first to half a
  // voxel after the last.
  const IndexBox& box() const { return box_; }
  void set_box(const IndexBox& box) { box_ = box; }

  // The value at a point of index space, between the least and the greatest of the eight voxels
  // around it, to the bit. Outside all nodes, and where p is not finite: the background.
  // Requires: !is_vector(); the cursor is of this grid. Thread safety: one cursor, one thread.
  float At(Vec3d p_index, Cursor* cursor) const;
  // Requires: is_vector().
  Vec3f VectorAt(Vec3d p_index, Cursor* cursor) const;

  // OK where the grid can be a density: kInvalidArgument, naming the least value, where one is
  // negative or the grid is a grid of vectors.
  absl::Status CheckDensity(const std::string& where) const;

  // The values of lo..hi, both included, x slowest. Requires: !is_vector(); out has their number.
  void ReadBox(Index3 lo, Index3 hi, std::span<float> out, Cursor* cursor) const;
  // The one value of all voxels of lo..hi, where they lie in tiles (or outside all nodes) of one
  // value.
  std::optional<float> UniformValue(Index3 lo, Index3 hi) const;
  // The same two of one component, and of all, of a grid of vectors. Requires: is_vector().
  void ReadComponentBox(size_t component, Index3 lo, Index3 hi, std::span<float> out,
                        Cursor* cursor) const;
  std::optional<Vec3f> UniformVector(Index3 lo, Index3 hi) const;

 private:
  VolumeGrid() = default;

  VolumeBytes image_;
  VolumeGridInfo info_;
  Matrix4 medium_from_index_, index_from_medium_;
  IndexBox box_;
};

}  // namespace sheaf
