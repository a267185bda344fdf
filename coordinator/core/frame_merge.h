// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// FrameMerge: the parts of one frame as they become its image. A pure function of the set of
// parts: each tile's parts go into CellTrees, and a tile whose samples are all there is developed
// from their roots; for good, or until it gets more (sample_rounds.h).
//
// Memory is bounded by a budget that all frames share. A tile that finds the budget used up is not
// kept: its parts are on disk, and it is built from them when the last one has come. Tiles are
// never pushed out in favour of others, for tiles are visited in turn, and then the oldest is
// needed next.
#pragma once

#include <atomic>
#include <cstdint>
#include <memory>
#include <optional>
#include <set>
#include <vector>

#include "absl/status/status.h"
#include "common/film/cell_trees.h"
#include "common/film/error/flip_estimate.h"
#include "common/film/film.h"
#include "coordinator/core/cell_grid.h"
#include "coordinator/core/job.h"

namespace sheaf::coordinator {

// Bytes of unfinished tiles in memory, over all frames.
class MergeBudget {
 public:
  explicit MergeBudget(uint64_t bytes_max) : bytes_max_(bytes_max) {}
  bool Exhausted() const { return bytes_ >= bytes_max_; }
  void Change(uint64_t before, uint64_t after) { bytes_ += after - before; }
  uint64_t bytes() const { return bytes_; }

 private:
  const uint64_t bytes_max_;
  std::atomic<uint64_t> bytes_{0};
};

// Sums of a tile that have samples in some of its cells: of the tile, or of the one cell.
struct CellPart {
  FilmTile sums;
  uint64_t cells = 1;  // As Task::cells.
};

// Thread safety: none; one lock a frame. The budget may be shared.
class FrameMerge {
 public:
  // samples: of each cell's pixels.
  FrameMerge(const FrameSpec& spec, CellGrid grid, std::vector<uint64_t> samples,
             MergeBudget* budget);
  ~FrameMerge();
  FrameMerge(const FrameMerge&) = delete;
  FrameMerge& operator=(const FrameMerge&) = delete;

  // Adds a part that is on disk. Nothing happens where the tile was built from disk meanwhile.
  // Requires: no part that overlaps it was added before (SHEAF_CHECKed).
  void Insert(uint32_t tile, CellPart part);
  // Gives the cell this many samples in all. Nothing happens where it has them. Requires: no less
  // than it has.
  void Grow(uint32_t cell, uint64_t samples);
  // The tile has parts that are only on disk: after a start, or when one of them was lost.
  void MarkOnDisk(uint32_t tile);
  // Whether the tile must be built from its parts on disk before it can be developed.
  bool OnDisk(uint32_t tile) const { return tiles_[tile].state == State::kOnDisk; }
  // Builds a tile anew from all of its parts and develops it. The parts cover all samples.
  // Errors: kInvalidArgument, kAlreadyExists where they overlap or leave gaps.
  absl::Status Rebuild(uint32_t tile, std::vector<CellPart> parts);

  bool Developed(uint32_t tile) const { return tiles_[tile].state == State::kDeveloped; }
  bool AllDeveloped() const { return developed_count_ == tiles_.size(); }
  uint32_t tile_count() const { return static_cast<uint32_t>(tiles_.size()); }
  const CellGrid& grid() const { return grid_; }
  // The samples per pixel of each cell, as far as they are in memory or developed: those that the
  // image shows once it is refreshed.
  std::vector<uint64_t> SamplesOfCells() const;

  // Develops what has changed since the last call into the image, for looking at. Returns the
  // tiles that had.
  std::vector<uint32_t> Refresh();
  // The developed tiles whose error is not reliable (mean_interval.h).
  uint32_t unreliable_count() const { return unreliable_count_; }
  std::vector<PixelRect> UnreliableTiles() const;
  bool HasSamples() const { return has_samples_; }
  // Whether the filter weighs samples otherwise than by 1, in developed tiles.
  bool signed_weights() const { return signed_weights_; }
  // Covers the developed tiles; null where the frame's replicates are not independent, or not all
  // of its pixels are rendered.
  const ErrorSample* error_sample() const { return error_sample_ ? &*error_sample_ : nullptr; }
  const FrameImage& image() const { return image_; }
  FrameImage* mutable_image() { return &image_; }

 private:
  enum class State : uint8_t { kEmpty, kInMemory, kOnDisk, kDeveloped };
  struct Tile {
    State state = State::kEmpty;
    bool unreliable = false;
    // While in memory; once developed, where the tile may grow and the budget allows.
    std::unique_ptr<CellTrees> trees;
    uint64_t size_bytes = 0;  // The trees' size, as counted in the budget.
  };

  std::unique_ptr<CellTrees> MakeTrees(uint32_t tile) const;
  // Whether all of the tile's cells have their samples in the trees.
  bool Complete(uint32_t tile, const CellTrees& trees) const;
  void SetSize(Tile* tile, uint64_t size_bytes);
  void Develop(uint32_t tile, std::unique_ptr<CellTrees> trees);

  const bool grows_;
  const CellGrid grid_;
  std::vector<uint64_t> samples_;  // By cell.
  std::vector<Tile> tiles_;
  MergeBudget* budget_;
  FrameImage image_;
  std::optional<ErrorSample> error_sample_;
  std::set<uint32_t> changed_;  // In memory, not yet developed as they are.
  std::set<uint32_t> developed_since_refresh_;
  bool has_samples_ = false;
  bool signed_weights_ = false;
  size_t developed_count_ = 0;
  uint32_t unreliable_count_ = 0;
};

}  // namespace sheaf::coordinator
