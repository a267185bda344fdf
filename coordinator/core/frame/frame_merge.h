// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// FrameMerge: merges the parts of one frame into its image. A pure function of the set of parts:
// each tile's parts go into CellTrees, and a tile with all its samples is developed from their
// roots, once per round (sample_rounds.h).
//
// Memory is bounded by a budget that all frames share. If the budget is used up, a new tile is not
// kept in memory: its parts are on disk, and it is built from them once all have arrived. Tiles are
// never evicted for others: tiles are visited in turn, so the oldest is needed next.
//
// A frame with light paths (task_kind.h) has three images: the camera's, that of its light paths,
// and their sum, which is the frame's.
#pragma once

#include <atomic>
#include <cstdint>
#include <memory>
#include <optional>
#include <set>
#include <vector>

#include "absl/status/status.h"
#include "common/film/cell_trees.h"
#include "common/film/error/certificate.h"
#include "common/film/error/flip_estimate.h"
#include "common/film/error/mean_interval.h"
#include "common/film/film.h"
#include "common/film/light/light_image.h"
#include "coordinator/core/job/cell_grid.h"
#include "coordinator/core/job/job.h"

namespace sheaf::coordinator {

// Bytes of unfinished tiles and of certificates in memory, over all frames.
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

// Sums with samples in some of a tile's cells: those of the whole tile, or of the one cell.
struct CellPart {
  FilmTile sums;
  uint64_t cells = 1;  // As Task::cells.
};

// Thread safety: none; one lock a frame. The budget may be shared.
class FrameMerge {
 public:
  // samples: for each of the camera's cells. The light tile has as many passes as their maximum.
  FrameMerge(const FrameSpec& spec, CellGrid grid, std::vector<uint64_t> samples,
             MergeBudget* budget);
  ~FrameMerge();
  FrameMerge(const FrameMerge&) = delete;
  FrameMerge& operator=(const FrameMerge&) = delete;

  // Adds a part that is on disk. A no-op if the tile was built from disk meanwhile.
  // Requires: no part that overlaps it was added before (SHEAF_CHECKed).
  void Insert(uint32_t tile, CellPart part);
  // Raises a cell of the camera to this many samples in total. A no-op if it has them. Requires: no
  // fewer than it has.
  void Grow(uint32_t cell, uint64_t samples);
  // The tile has parts that are only on disk: after a start, or when one of them was lost.
  void MarkOnDisk(uint32_t tile);
  // Whether the tile must be built from its parts on disk before it can be developed.
  bool OnDisk(uint32_t tile) const { return tiles_[tile].state == State::kOnDisk; }
  // Empty trees for the parts of a tile that is rebuilt.
  std::unique_ptr<CellTrees> MakeTrees(uint32_t tile) const;
  // Replaces a tile by these trees and develops it. Errors: kInvalidArgument if samples are
  // missing.
  absl::Status Rebuild(uint32_t tile, std::unique_ptr<CellTrees> trees);

  bool Developed(uint32_t tile) const { return tiles_[tile].state == State::kDeveloped; }
  bool AllDeveloped() const { return developed_count_ == tiles_.size(); }
  uint32_t tile_count() const { return static_cast<uint32_t>(tiles_.size()); }
  const CellGrid& grid() const { return grid_; }
  // The samples per pixel of each of the camera's cells that are in memory or developed: those that
  // a refreshed image shows.
  std::vector<uint64_t> SamplesOfCells() const;
  // Their minimum; in a frame with light passes, at most the number of passes.
  uint64_t FewestSamples() const;

  // Develops changed tiles into the image for a preview. Returns the camera's changed tiles; none
  // until the first of the wanted light passes, because the image would be too dark.
  std::vector<uint32_t> Refresh();
  // The camera's developed tiles whose error is not reliable (mean_interval.h).
  std::vector<PixelRect> UnreliableTiles() const;
  // Whether the filter gives samples weights other than 1, in developed tiles.
  bool signed_weights() const { return signed_weights_; }
  // The image's FLIP (flip_estimate.h); none if the frame's replicates are not independent, or if
  // some of its pixels are not rendered. Requires: all tiles are developed.
  std::optional<double> Flip() const;
  // The certified bound of the image's error (certificate.h); 0 if there is none. Requires: all
  // tiles are developed.
  double CertifiedError() const;
  const FrameImage& image() const { return image_; }
  FrameImage* mutable_image() { return &image_; }
  // Adds the light layer (light_image.h) to the image of a frame with light passes.
  void AddLightLayer() {
    if (has_light_) SetLightLayer(light_.image, &image_);
  }

 private:
  enum class State : uint8_t { kEmpty, kInMemory, kOnDisk, kDeveloped };
  struct Tile {
    State state = State::kEmpty;
    // The interval of the camera paths; those of light paths are in light_intervals_.
    MeanInterval interval;
    // Present while in memory; after development, only if the tile may grow and the budget allows.
    std::unique_ptr<CellTrees> trees;
    uint64_t size_bytes = 0;  // The trees' size, as counted in the budget.
  };

  // The images and error samples of one kind of path.
  struct Layer {
    FrameImage image;
    std::optional<ErrorSample> error_sample;
  };
  Layer& LayerOf(uint32_t tile) {
    return grid_.KindOf(tile) == TaskKind::kLight ? light_ : camera_;
  }
  // Where the tile's sums are developed; image_ itself in frames without light paths.
  FrameImage& TargetOf(uint32_t tile) { return has_light_ ? LayerOf(tile).image : image_; }
  // Updates the tile in image_ after a change in its layer.
  void Combine(uint32_t tile);
  void SetIntervals(uint32_t tile, const FilmTile& root);
  uint64_t SamplesOf(uint32_t tile, uint32_t cell_of_tile) const;
  bool AwaitsLight() const;
  void GrowCell(uint32_t cell, uint64_t samples);
  // Whether all of the tile's cells have their samples in the trees.
  bool Complete(uint32_t tile, const CellTrees& trees) const;
  void SetSize(Tile* tile, uint64_t size_bytes);
  void Develop(uint32_t tile, std::unique_ptr<CellTrees> trees);
  void TakeCertificate(const FilmTile& root);

  const bool grows_;
  const CellGrid grid_;
  const bool has_light_;
  std::vector<uint64_t> samples_;  // By cell, including the light tile's.
  std::vector<Tile> tiles_;
  MergeBudget* budget_;
  FrameImage image_;
  Layer camera_, light_;  // Their images are empty in frames without light paths.
  std::vector<MeanInterval> light_intervals_;  // By tile of the camera; empty without light passes.
  std::set<uint32_t> changed_;                 // In memory, not yet developed as they are.
  std::set<uint32_t> developed_since_refresh_;
  std::optional<CertificatePlanes> certificate_;  // None if samples have no proven bound.
  uint64_t certificate_bytes_ = 0;                // As counted in the budget.
  bool signed_weights_ = false;
  size_t developed_count_ = 0;
};

}  // namespace sheaf::coordinator
