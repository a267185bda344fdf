// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// FrameTasks: which samples of which tile of one frame are done, leased, returned or fresh. These
// four always cut a tile's samples [0, N) without overlap; N may grow (sample_rounds.h):
//
//     fresh     never leased in this life of the coordinator; cut into blocks when it is leased
//     leased    one block, held by one lease or two (a hedge)
//     returned  a block whose lease came to nothing; it is leased again as it was, never cut anew
//     done      accepted and durable
//
// Because returned blocks keep their shape, a late result of this life meets exactly its own block.
// A result from before a restart may meet blocks that were cut otherwise; Fit says which of those
// fit. Pure: no clock, no lock. Every operation is O(log tiles) but the constructor.
#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <optional>
#include <set>
#include <utility>
#include <vector>

#include "coordinator/core/job.h"
#include "coordinator/core/sample_ranges.h"

namespace sheaf::coordinator {

class FrameTasks {
 public:
  // Requires: window not empty, samples at least 1, tile_size_px positive.
  FrameTasks(PixelRect window, uint64_t samples, int32_t tile_size_px,
             const PixelLattice& lattice = {});
  // Gives the tile this many samples in all. Requires: no less than it has.
  void Grow(uint32_t tile, uint64_t samples);

  const std::vector<PixelRect>& tiles() const { return tiles_; }
  std::optional<uint32_t> FindTile(const PixelRect& rect) const;
  std::vector<uint64_t> SamplesOfTiles() const;
  // Of workers, on what is done of the tile.
  absl::Duration CpuOfTile(uint32_t tile) const { return states_[tile].cpu_duration; }
  uint64_t PixelSamples(const Task& task) const {
    return PixelSamples(task.tile, task.block.count);
  }

  // Pixel samples.
  uint64_t sample_count_done() const { return done_count_; }
  uint64_t sample_count_total() const { return total_count_; }
  uint64_t sample_count_ready() const { return ready_count_; }  // Fresh or returned.
  bool HasReady() const { return !fresh_queue_.empty() || !returned_.empty(); }
  bool Complete() const { return done_count_ == total_count_; }
  bool TileComplete(uint32_t tile) const;

  // Takes a returned block for which `allowed` holds, looking at scan_max of them at most.
  std::optional<Task> TakeReturned(const std::function<bool(const Task&)>& allowed, int scan_max);
  // Takes a fresh block: of the tile with the fewest samples taken, so that every tile's first
  // block comes before any second one. block_samples_max is asked with the block's first sample and
  // the tile's pixel count.
  std::optional<Task> TakeFresh(
      const std::function<uint64_t(uint64_t first, int64_t pixel_count)>& block_samples_max);
  // Gives a taken block back. Requires: it is leased.
  void PutBack(const Task& task);

  // How a result's block meets what is there.
  enum class Fit {
    kWanted,   // Accept gives each of its samples a first value.
    kCovered,  // All of it is done.
    kPartial,  // Some of it is done, or it lies inside a larger block that is leased now: dropped,
               // and what is missing of it is rendered by the lease or leased later.
    kOutside,  // No block of this frame.
  };
  Fit FitOf(const Task& task) const;
  // Marks a block as done. Returns the leased blocks it covers, whose leases are now pointless (its
  // own among them). cpu_duration: what it took. Requires: FitOf(task) is kWanted.
  std::vector<Task> Accept(const Task& task, absl::Duration cpu_duration = {});
  // Takes back an Accept: the part was lost. Requires: done.
  void Revoke(const Task& task);

 private:
  struct Tile {
    int64_t pixel_count = 0;  // That are rendered; at least 1, so that every tile counts.
    uint64_t samples = 0;
    absl::Duration cpu_duration;
    SampleRanges fresh, done;
  };
  using Key = std::pair<uint32_t, uint64_t>;  // Tile and first sample.
  using Blocks = std::map<Key, SampleBlock>;

  static std::vector<SampleBlock> Overlapping(const Blocks& blocks, const Task& task);
  void SetFresh(uint32_t tile, const std::function<void(SampleRanges&)>& change);
  uint64_t PixelSamples(uint32_t tile, uint64_t samples) const;

  std::vector<PixelRect> tiles_;
  std::map<std::pair<int32_t, int32_t>, uint32_t> tile_at_;  // By y0 and x0.
  std::vector<Tile> states_;
  std::set<std::pair<uint64_t, uint32_t>> fresh_queue_;  // First fresh sample and tile.
  Blocks returned_, leased_;
  uint64_t done_count_ = 0, total_count_ = 0, ready_count_ = 0;
};

}  // namespace sheaf::coordinator
