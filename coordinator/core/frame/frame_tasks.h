// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// FrameTasks: the state of each tile's samples. Five states always partition a cell's samples [0,
// N); N may grow (sample_rounds.h):
//
//     fresh     never leased since the coordinator started; cut into blocks when leased
//     leased    one block of some cells of a tile, held by one lease or two (a hedge)
//     returned  a block whose lease gave no result; leased again with the same shape
//     aside     a block that is not leased: it used up its failures, or a user set it aside
//     done      accepted and durable
//
// The light tile (CellGrid) has light passes, as many as the cell with most of them has samples. A
// light path counts as a sample.
//
// The training tile has one task, whose samples count as none. Until it is done, no other task of
// the frame is taken. If its result is lost, it is done again, and tasks already taken stay taken.
//
// Because returned blocks keep their shape, a late result matches exactly its own block. A result
// from before a restart may meet blocks that were cut differently; Fit tells which of them fit.
// Pure: no clock, no lock. Every operation is O(log tiles), amortized, and linear in the leased and
// returned blocks of one tile. The constructor is linear in the tiles but allocates nothing per
// tile, because a frame is opened under the farm's lock.
#pragma once

#include <compare>
#include <cstdint>
#include <functional>
#include <optional>
#include <set>
#include <utility>
#include <vector>

#include "coordinator/core/frame/sample_ranges.h"
#include "coordinator/core/job/cell_grid.h"
#include "coordinator/core/job/job.h"

namespace sheaf::coordinator {

class FrameTasks {
 public:
  // paths_per_pass: light paths of a pass. Requires: samples at least 1.
  FrameTasks(CellGrid grid, uint64_t samples, const PixelLattice& lattice = {},
             int64_t paths_per_pass = 1);
  // Raises the cell to this many samples in total. Requires: no fewer than it has; a cell of the
  // camera.
  void Grow(uint32_t cell, uint64_t samples);

  const CellGrid& grid() const { return grid_; }
  // Finds the task by its rectangle; none if the frame has no such tile or cells.
  std::optional<Task> Find(const PixelRect& tile, SampleBlock block, const TileCells& cells,
                           TaskKind kind = TaskKind::kCamera) const;
  // By cell of the camera.
  std::vector<uint64_t> SamplesOfCells() const;
  // CPU time of workers on the finished tasks of the tile.
  absl::Duration CpuOfTile(uint32_t tile) const { return cpu_of_tiles_[tile]; }
  uint64_t PixelSamples(const Task& task) const;

  // Pixel samples.
  uint64_t sample_count_done() const { return done_count_; }
  uint64_t sample_count_total() const { return total_count_; }
  uint64_t light_path_count_done() const;  // Those of sample_count_done() that are light paths.
  uint64_t sample_count_ready() const { return ready_count_; }  // Fresh or returned.
  // Whether there is something to take.
  bool HasReady() const;
  bool Complete() const { return done_count_ == total_count_; }
  bool TileComplete(uint32_t tile) const;
  // Whether the frame needs no training, or it is done.
  bool Trained() const;
  // The guiding field that the frame's results are made with. Has no size if it is known only from
  // them; empty if it is unknown, or if the frame has none.
  const BlobDigest& field() const { return field_; }
  void SetField(BlobDigest field) { field_ = std::move(field); }

  // Takes a returned block for which `allowed` holds, scanning at most scan_max of them.
  std::optional<Task> TakeReturned(const std::function<bool(const Task&)>& allowed, int scan_max);
  // Takes a fresh block: of the tile with the fewest samples taken, so that every tile's first
  // block precedes any second one. It is the largest block allowed, for all cells that want it.
  // block_samples_max is called with the block available.
  struct FreshBlock {
    TaskKind kind = TaskKind::kCamera;
    uint64_t first = 0;       // Its first sample.
    int64_t pixel_count = 0;  // Pixels that have it fresh; or paths of a light pass.
  };
  std::optional<Task> TakeFresh(
      const std::function<uint64_t(const FreshBlock& block)>& block_samples_max);
  // Gives a taken block back. Requires: it is leased.
  void PutBack(const Task& task);

  // Sets a block aside: it is not taken until it is brought back or a result covers it. Returns
  // false unless it is entirely returned or entirely fresh.
  bool SetAside(const Task& task);
  // Sets all of a tile aside except leased blocks; returns the blocks set aside.
  std::vector<Task> SetTileAside(uint32_t tile);
  // Requires: it is set aside.
  void BringBack(const Task& task);
  // Turns a fresh block into a returned one, so that it stays a task of its own. Returns false
  // unless it is entirely fresh.
  bool KeepWhole(const Task& task);
  // The blocks set aside that share samples of a cell with the task.
  std::vector<Task> AsideOverlapping(const Task& task) const { return Overlapping(aside_, task); }
  uint64_t sample_count_aside() const { return aside_count_; }
  // Whether the rest can be neither taken nor expected: it is set aside, or waits for a training
  // that is set aside.
  bool Stuck() const { return !Complete() && !aside_.empty() && leased_.empty() && !HasReady(); }

  // How a result's block relates to the current state.
  enum class Fit {
    kWanted,   // Accept gives each of its samples a first value.
    kCovered,  // All of it is done.
    kPartial,  // Some of it is done, or it lies inside a larger block that is leased now: dropped,
               // and what is missing of it is rendered by the lease or leased later.
    kOutside,  // No block of this frame.
  };
  Fit FitOf(const Task& task) const;
  // Marks a block as done. Returns the leased blocks it covers, including its own; their leases are
  // now useless. cpu_duration: CPU time spent. Requires: FitOf(task) is kWanted.
  std::vector<Task> Accept(const Task& task, absl::Duration cpu_duration = {});
  // Undoes an Accept: the part was lost. Requires: done.
  void Revoke(const Task& task);

 private:
  struct Cell {
    // Rendered pixels; at least 1, so that every cell counts, but 0 for the training tile.
    int64_t pixel_count = 0;
    uint64_t samples = 0;
    SampleRanges fresh, done;
    uint64_t PixelSamples(uint64_t count) const {
      return static_cast<uint64_t>(pixel_count) * count;
    }
  };
  struct ByTileAndSample {
    bool operator()(const Task& a, const Task& b) const;
  };
  using Tasks = std::set<Task, ByTileAndSample>;

  // Those that share samples of a cell with the task.
  static std::vector<Task> Overlapping(const Tasks& tasks, const Task& task);
  // Calls visit with each cell of the mask; stops where it returns false, and returns that.
  template <typename Visit>
  bool ForCells(uint32_t tile, uint64_t mask, const Visit& visit) const;
  // Queues the untouched tiles up to this one.
  void Touch(uint32_t tile);
  // Calls change with the fresh samples of each cell of the mask.
  template <typename Change>
  void ChangeFresh(uint32_t tile, uint64_t mask, const Change& change);
  void GrowCell(uint32_t cell, uint64_t samples);
  // Cuts the block that begins with the tile's first fresh sample, for all cells that want it.
  Task CutFresh(uint32_t tile, uint64_t first, uint64_t samples_max);
  // Removes the task from the fresh samples; returns false unless it is entirely fresh.
  bool RemoveFresh(const Task& task);
  // The lowest fresh sample of the tile's cells; none if there is none.
  std::optional<uint64_t> FirstFresh(uint32_t tile) const;

  CellGrid grid_;
  std::vector<Cell> cells_;
  std::vector<absl::Duration> cpu_of_tiles_;
  std::set<std::pair<uint64_t, uint32_t>> fresh_queue_;  // First fresh sample and tile.
  // The tiles [untouched_, untouched_end_) are entirely fresh and not yet in the queue.
  uint32_t untouched_ = 0, untouched_end_ = 0;
  Tasks returned_, leased_, aside_;
  uint64_t done_count_ = 0, total_count_ = 0, ready_count_ = 0, aside_count_ = 0;
  BlobDigest field_;
};

}  // namespace sheaf::coordinator
