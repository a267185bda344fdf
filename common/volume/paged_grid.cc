// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "common/volume/paged_grid.h"

#include <algorithm>
#include <array>
#include <atomic>
#include <bit>
#include <cmath>
#include <cstring>
#include <memory>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "common/base/check.h"
#include "common/base/digest.h"
#include "common/base/status.h"
#include "common/base/vector_bytes.h"
#include "common/volume/codecs.h"
#include "common/volume/nanovdb_door.h"

namespace sheaf::volume {
namespace {

// Leaves of FpN have codes of at most 16 bits.
constexpr uint32_t kWidthCodeMax = 4;

// A number that changes if any one word of the bytes does, and that other changes leave with a
// chance of 2^-64: for damage, not against forgery. Never 0.
uint64_t ChecksumOf(std::span<const std::byte> bytes) {
  constexpr size_t kLanes = 4, kStep = kLanes * sizeof(uint64_t);
  constexpr uint64_t kFactor = 0x9e3779b97f4a7c15u;
  std::array<uint64_t, kLanes> lanes{1, 2, 3, 4};
  const auto add = [&](const std::byte* from, size_t count) {
    std::array<uint64_t, kLanes> words{};
    std::memcpy(words.data(), from, count);
    for (size_t i = 0; i < kLanes; ++i) lanes[i] = std::rotl((lanes[i] ^ words[i]) * kFactor, 29);
  };
  size_t at = 0;
  for (; at + kStep <= bytes.size(); at += kStep) add(bytes.data() + at, kStep);
  add(bytes.data() + at, bytes.size() - at);
  uint64_t sum = bytes.size();
  for (const uint64_t lane : lanes) sum = std::rotl((sum ^ lane) * kFactor, 29);
  return sum == 0 ? 1 : sum;
}

// Sets the offsets of a page's leaves, and checks that their values are in the range, unless that
// is known. False if the leaves do not fill the page.
template <typename BuildT>
bool CheckLeaves(uint32_t mask, ValueRange values, bool is_known, std::span<std::byte> page) {
  using Leaf = nanovdb::NanoLeaf<BuildT>;
  auto& head = *reinterpret_cast<PageHead*>(page.data());
  head.leaf_offset_bytes.fill(0);
  size_t at = sizeof(PageHead);
  for (; mask != 0; mask &= mask - 1) {
    if (page.size() - at < sizeof(Leaf)) return false;
    const auto& leaf = *reinterpret_cast<const Leaf*>(page.data() + at);
    if constexpr (std::is_same_v<BuildT, nanovdb::FpN>) {
      if ((leaf.data()->mFlags >> 5) > kWidthCodeMax) return false;
    }
    const uint64_t bytes = LeafBytes<BuildT>(leaf);
    if (page.size() - at < bytes) return false;
    head.leaf_offset_bytes[static_cast<size_t>(std::countr_zero(mask))] = static_cast<uint32_t>(at);
    bool inside = true;  // False for NaN.
    for (uint32_t n = 0; !is_known && n < Leaf::SIZE; ++n) {
      const float v = leaf.data()->getValue(n);
      inside &= (v >= values.min) & (v <= values.max);
    }
    if (!inside) return false;
    at += (bytes + NANOVDB_DATA_ALIGNMENT - 1) / NANOVDB_DATA_ALIGNMENT * NANOVDB_DATA_ALIGNMENT;
  }
  return at == page.size();
}

}  // namespace

PagedGrid::Box PagedGrid::Box::Within(Index3 key, int log2) const {
  Box part;
  for (size_t a = 0; a < 3; ++a) {
    const int64_t first = int64_t{key[a]} << log2;
    part.lo[a] = static_cast<int32_t>(std::max<int64_t>(lo[a], first));
    part.hi[a] = static_cast<int32_t>(std::min<int64_t>(hi[a], first + (int64_t{1} << log2) - 1));
  }
  return part;
}

uint64_t PagedGrid::Box::VoxelCount() const {
  uint64_t count = 1;
  for (size_t a = 0; a < 3; ++a) {
    count *= static_cast<uint64_t>(std::max<int64_t>(0, int64_t{hi[a]} - lo[a] + 1));
  }
  return count;
}

absl::StatusOr<std::shared_ptr<const PagedGrid>> PagedGrid::Make(
    const std::string& where, std::shared_ptr<const PartedBytes> bytes, PageIndex index,
    const VolumeLimits& limits, std::shared_ptr<VolumePages> pages) {
  std::shared_ptr<PagedGrid> grid(
      new PagedGrid(where, std::move(bytes), std::move(index), std::move(pages)));
  const absl::Status status = grid->Check(limits);
  if (!status.ok()) return status;
  grid->pages_->AddOtherBytes(grid->MemoryBytes());
  return grid;
}

PagedGrid::PagedGrid(std::string where, std::shared_ptr<const PartedBytes> bytes, PageIndex index,
                     std::shared_ptr<VolumePages> pages)
    : where_(std::move(where)),
      bytes_(std::move(bytes)),
      index_(std::move(index)),
      pages_(std::move(pages)),
      slots_(std::make_unique<PageSlot[]>(index_.entries.size())),
      checksum_of_(std::make_unique<std::atomic<uint64_t>[]>(index_.entries.size())) {
  for (const PageRegion& region : index_.regions) {
    region_of_.emplace(region.key, static_cast<uint32_t>(region_of_.size()));
    roots_.push_back(Shifted(region.key, kRootLog2 - kRegionLog2));
  }
  std::sort(roots_.begin(), roots_.end());
  roots_.erase(std::unique(roots_.begin(), roots_.end()), roots_.end());
  for (const PageRootTile& tile : index_.root_tiles) root_value_of_.emplace(tile.key, tile.value);
  for (size_t i = 0; i < index_.entries.size(); ++i) {
    slots_[i].key = index_.entries[i].key;
    slots_[i].place = static_cast<uint32_t>(i);
    slots_[i].bytes = static_cast<uint32_t>(sizeof(PageHead)) + index_.entries[i].bytes;
  }
}

PagedGrid::~PagedGrid() { pages_->Forget({slots_.get(), index_.entries.size()}); }

absl::Status PagedGrid::Damaged(const std::string& what) const {
  return absl::InvalidArgumentError(
      absl::StrCat(where_, ": grid \"", index_.head.name.data(), "\": ", what,
                   ": the page file is altered or cut short; make it ", "again (sheaf pack)"));
}

bool PagedGrid::IsValue(float v) const {
  return v >= index_.head.values.min && v <= index_.head.values.max;
}

absl::Status PagedGrid::CheckEntry(const PageEntry& entry) const {
  const auto leaves = static_cast<uint64_t>(std::popcount(entry.mask));
  bool fits = entry.mask < 1u << kBlocks;
  WithScalarType(static_cast<VolumeValueType>(index_.head.type), [&]<typename BuildT>() {
    using Leaf = nanovdb::NanoLeaf<BuildT>;
    const uint64_t least = leaves * sizeof(Leaf);
    const bool varies = std::is_same_v<BuildT, nanovdb::FpN>;
    fits &= varies ? entry.bytes >= least && entry.bytes <= least + leaves * (64 << kWidthCodeMax)
                   : entry.bytes == least;
  });
  if (!fits || (entry.packed_bytes == 0) != (entry.mask == 0) ||
      entry.offset_bytes > bytes_->size() ||
      bytes_->size() - entry.offset_bytes < entry.packed_bytes) {
    return Damaged("a page does not fit");
  }
  bool good = true;
  for (const float v : entry.tiles) good &= v == 0 || IsValue(v);
  for (const ValueRange& r : entry.reach)
    good &= IsValue(r.min) && IsValue(r.max) && r.min <= r.max;
  return good ? absl::OkStatus() : Damaged("a value is out of range");
}

absl::Status PagedGrid::Check(const VolumeLimits& limits) const {
  const PageGridHead& head = index_.head;
  if (head.image_bytes > limits.total_bytes_max ||
      index_.root_tiles.size() > limits.root_tile_count_max) {
    return absl::ResourceExhaustedError(
        absl::StrCat(where_, ": grid \"", head.name.data(), "\" is larger than the limits of ",
                     limits.total_bytes_max, " bytes (total_bytes_max) and ",
                     limits.root_tile_count_max, " tiles (root_tile_count_max); resample it"));
  }
  if (head.type > static_cast<uint32_t>(VolumeValueType::kFpN)) {
    return Damaged("its values are of an unknown type");
  }
  if (!std::isfinite(head.values.min) || !std::isfinite(head.values.max) ||
      !IsValue(head.background) || !(head.mean == 0 || IsValue(head.mean))) {
    return Damaged("a value is out of range");
  }
  for (size_t a = 0; a < 3; ++a) {
    if (head.active_voxel_count > 0 &&
        (head.index_min[a] < -limits.index_abs_max || head.index_max[a] > limits.index_abs_max ||
         head.index_min[a] > head.index_max[a])) {
      return Damaged("its bounds are out of range");
    }
  }
  if (region_of_.size() != index_.regions.size() ||
      root_value_of_.size() != index_.root_tiles.size()) {
    return Damaged("two parts have the same place");
  }
  if (!index_.regions.empty() &&
      !(std::fabs(index_.regions[0].mean_rest) <= std::fabs(head.mean) * 0x1p-23f)) {
    return Damaged("its mean is not a number");
  }
  for (const PageRootTile& tile : index_.root_tiles) {
    if (!IsValue(tile.value)) return Damaged("a value is out of range");
  }
  size_t used = 0;
  // Beyond the limit of coordinates there is room for the blocks around the last one.
  const auto is_near = [&](Index3 key, int log2) {
    return std::all_of(key.begin(), key.end(), [&](int32_t k) {
      return std::abs(int64_t{k}) <= (int64_t{limits.index_abs_max} >> log2) + 2;
    });
  };
  for (const PageRegion& region : index_.regions) {
    if (!is_near(region.key, kRegionLog2)) return Damaged("a page is at another place");
    for (size_t n = 0; n < kCells; ++n) {
      const PageCell& cell = region.cells[n];
      if (!IsValue(cell.value)) return Damaged("a value is out of range");
      if (cell.page == 0) continue;
      if (cell.page > index_.entries.size()) return Damaged("a page is missing");
      const Index3 key = index_.entries[cell.page - 1].key;
      if (Shifted(key, kRegionLog2 - kPageLog2) != region.key || CellPlace(key) != n) {
        return Damaged("a page is at another place");
      }
      ++used;
    }
  }
  if (used != index_.entries.size()) return Damaged("two pages have the same place");
  for (const PageEntry& entry : index_.entries) {
    const absl::Status status = CheckEntry(entry);
    if (!status.ok()) return status;
  }
  return absl::OkStatus();
}

VolumeGridInfo PagedGrid::Info() const {
  const PageGridHead& head = index_.head;
  VolumeGridInfo info;
  info.name = head.name.data();
  info.role = VolumeRoleOf(info.name);
  info.type = static_cast<VolumeValueType>(head.type);
  info.index_min = head.index_min;
  info.index_max = head.index_max;
  info.active_voxel_count = head.active_voxel_count;
  info.background = head.background;
  info.values = head.values;
  info.memory_bytes = MemoryBytes();
  return info;
}

Matrix4 PagedGrid::MediumFromIndex() const {
  Matrix4 m;
  for (size_t row = 0; row < 3; ++row) {
    for (size_t column = 0; column < 3; ++column) {
      m.m[row][column] = index_.head.matrix[3 * row + column];
    }
    m.m[row][3] = index_.head.offset[row];
  }
  return m;
}

uint64_t PagedGrid::MemoryBytes() const {
  constexpr uint64_t kNodeBytes = 48;  // A table's entry takes about this.
  return VectorBytes(index_.root_tiles) + VectorBytes(index_.regions) +
         VectorBytes(index_.entries) +
         index_.entries.size() * (sizeof(PageSlot) + sizeof(checksum_of_[0])) +
         (region_of_.size() + root_value_of_.size()) * kNodeBytes;
}

uint32_t PagedGrid::RegionAt(Index3 region_key) const {
  const auto found = region_of_.find(region_key);
  return found == region_of_.end() ? kNoRegion : found->second;
}

const PageCell* PagedGrid::CellOf(Index3 page_key) const {
  const PageRegion* region = Region(RegionAt(Shifted(page_key, kRegionLog2 - kPageLog2)));
  return region == nullptr ? nullptr : &region->cells[CellPlace(page_key)];
}

float PagedGrid::RootValue(Index3 root_key) const {
  const auto found = root_value_of_.find(root_key);
  return found == root_value_of_.end() ? index_.head.background : found->second;
}

const PageEntry* PagedGrid::EntryOf(Index3 page_key) const {
  const PageCell* cell = CellOf(page_key);
  return cell == nullptr || cell->page == 0 ? nullptr : &index_.entries[cell->page - 1];
}

PageSlot* PagedGrid::Pin(const PageCell& cell) const {
  if (cell.page == 0) return nullptr;
  PageSlot* slot = &slots_[cell.page - 1];
  if (index_.entries[slot->place].mask == 0) return nullptr;
  pages_->Pin(*this, slot);
  return slot;
}

float PagedGrid::TileValue(Index3 voxel, const PageCell* cell) const {
  if (cell == nullptr) return RootValue(Shifted(voxel, kRootLog2));
  if (cell->page == 0) return cell->value;
  return index_.entries[cell->page - 1].tiles[BlockPlace(Shifted(voxel, kBlockLog2))];
}

std::optional<float> PagedGrid::UniformValue(Index3 lo, Index3 hi) const {
  std::optional<float> common;
  uint64_t covered = 0;
  const Box box{lo, hi};
  for (const auto& [key, value] : root_value_of_) {
    if (std::binary_search(roots_.begin(), roots_.end(), key)) continue;
    const Box part = box.Within(key, kRootLog2);
    covered += part.VoxelCount();
    if (part.VoxelCount() > 0 && !Include(value, &common)) return std::nullopt;
  }
  for (const Index3& key : roots_) {
    const Box part = box.Within(key, kRootLog2);
    covered += part.VoxelCount();
    if (!IncludeBox(part, kRegionLog2, &common)) return std::nullopt;
  }
  if (covered != box.VoxelCount() && !Include(index_.head.background, &common)) {
    return std::nullopt;
  }
  return common;
}

bool PagedGrid::Include(float value, std::optional<float>* common) {
  if (!*common) *common = value;
  return **common == value;
}

bool PagedGrid::IncludeBox(const Box& box, int log2, std::optional<float>* common) const {
  if (box.VoxelCount() == 0) return true;
  const Index3 first = Shifted(box.lo, log2), last = Shifted(box.hi, log2);
  for (int32_t x = first[0]; x <= last[0]; ++x) {
    for (int32_t y = first[1]; y <= last[1]; ++y) {
      for (int32_t z = first[2]; z <= last[2]; ++z) {
        if (!IncludePart({x, y, z}, box, log2, common)) return false;
      }
    }
  }
  return true;
}

bool PagedGrid::IncludePart(Index3 key, const Box& box, int log2,
                            std::optional<float>* common) const {
  if (log2 == kRegionLog2) {
    if (region_of_.contains(key)) {
      return IncludeBox(box.Within(key, kRegionLog2), kPageLog2, common);
    }
    return Include(RootValue(Shifted(key, kRootLog2 - kRegionLog2)), common);
  }
  if (log2 == kPageLog2) {
    const PageCell& cell = *CellOf(key);
    if (cell.page == 0) return Include(cell.value, common);
    return IncludeBox(box.Within(key, kPageLog2), kBlockLog2, common);
  }
  const PageEntry& entry = *EntryOf(Shifted(key, kPageLog2 - kBlockLog2));
  const size_t n = BlockPlace(key);
  return (entry.mask >> n & 1) == 0 && Include(entry.tiles[n], common);
}

std::optional<ValueRange> PagedGrid::BlockRange(Index3 origin) const {
  const PageEntry* entry = EntryOf(Shifted(origin, kPageLog2));
  if (entry == nullptr) return std::nullopt;
  return entry->reach[BlockPlace(Shifted(origin, kBlockLog2))];
}

absl::StatusOr<uint64_t> PagedGrid::ReadPage(uint32_t place, std::span<std::byte> out) const {
  const PageEntry& entry = index_.entries[place];
  thread_local std::vector<std::byte> packed;
  packed.resize(std::max<size_t>(packed.size(), entry.packed_bytes));
  const std::span<const std::byte> read{packed.data(), entry.packed_bytes};
  const auto damaged = [&](const char* what) {
    return Damaged(absl::StrCat("page ", place, " ", what));
  };
  if (absl::Status status = bytes_->Read(entry.offset_bytes, entry.packed_bytes, packed.data());
      !status.ok()) {
    return Annotate(status, absl::StrCat(where_, ": grid \"", index_.head.name.data(), "\": page ",
                                         place, " cannot be read"));
  }
  // The first reading proves something about these bytes; it holds as long as they are the same.
  const uint64_t checksum = ChecksumOf(read);
  const bool is_known = checksum_of_[place].load(std::memory_order_relaxed) == checksum;
  if (!is_known) {
    const std::string digest =
        BytesOfHex(Sha256Hex({reinterpret_cast<const char*>(read.data()), read.size()}));
    if (std::memcmp(digest.data(), entry.sha256.data(), entry.sha256.size()) != 0) {
      return damaged("does not match its digest");
    }
  }
  if (!UnpackBlosc(read, out.subspan(sizeof(PageHead)))) return damaged("does not unpack");
  const bool good =
      WithScalarType(static_cast<VolumeValueType>(index_.head.type), [&]<typename BuildT>() {
        return CheckLeaves<BuildT>(entry.mask, index_.head.values, is_known, out);
      });
  if (!good) return damaged("holds other leaves than the index says");
  checksum_of_[place].store(checksum, std::memory_order_relaxed);
  return entry.packed_bytes;
}

}  // namespace sheaf::volume
