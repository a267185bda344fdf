// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "coordinator/core/frame_merge.h"

#include <span>
#include <utility>

#include "absl/strings/str_cat.h"
#include "common/base/check.h"
#include "common/film/error/mean_interval.h"
#include "common/scene/spectrum/primaries.h"

namespace sheaf::coordinator {
namespace {

bool HasSignedWeights(const FilmTile& sums) {
  const float* weight = sums.channel(FilmChannel::kWeight);
  const float* weight_low = sums.channel(FilmChannel::kWeightLo);
  const float* count = sums.channel(FilmChannel::kSampleCount);
  for (size_t p = 0; p < sums.plane_size(); ++p) {
    if (weight[p] != count[p] || weight_low[p] != 0) return true;
  }
  return false;
}

}  // namespace

FrameMerge::FrameMerge(const FrameSpec& spec, CellGrid grid, std::vector<uint64_t> samples,
                       MergeBudget* budget)
    : grows_(spec.stop.IsActive()),
      grid_(std::move(grid)),
      samples_(std::move(samples)),
      tiles_(grid_.tiles().size()),
      budget_(budget),
      image_(MakeFrameImage(spec.settings.window, spec.settings.width_px, spec.settings.height_px,
                            spec.settings.outputs,
                            ImageColorOf(spec.settings.primaries, spec.settings.white_balance_k,
                                         spec.settings.sensor))) {
  SHEAF_CHECK(samples_.size() == grid_.cells().size());
  if (!spec.settings.one_sequence && spec.settings.lattice.All()) {
    error_sample_.emplace(spec.settings.window);
  }
}

FrameMerge::~FrameMerge() {
  for (Tile& tile : tiles_) SetSize(&tile, 0);
}

void FrameMerge::SetSize(Tile* tile, uint64_t size_bytes) {
  budget_->Change(tile->size_bytes, size_bytes);
  tile->size_bytes = size_bytes;
}

std::unique_ptr<CellTrees> FrameMerge::MakeTrees(uint32_t index) const {
  const std::span<const PixelRect> cells(grid_.cells());
  return std::make_unique<CellTrees>(
      grid_.tiles()[index], cells.subspan(grid_.first_cell(index), grid_.cell_count(index)));
}

bool FrameMerge::Complete(uint32_t index, const CellTrees& trees) const {
  const uint32_t first = grid_.first_cell(index);
  for (uint32_t i = 0; i < grid_.cell_count(index); ++i) {
    if (trees.SampleCount(i) != samples_[first + i]) return false;
  }
  return true;
}

void FrameMerge::Develop(uint32_t index, std::unique_ptr<CellTrees> trees) {
  Tile& tile = tiles_[index];
  const FilmTile root = trees->Root();
  DevelopTile(root, &image_);
  if (error_sample_) error_sample_->DevelopTile(root, image_.color);
  signed_weights_ = signed_weights_ || HasSignedWeights(root);
  NoteNames(root, &image_);
  unreliable_count_ -= tile.unreliable ? 1 : 0;
  tile.unreliable = root.replicate_count() == kReplicateCount &&
                    !MeanIntervalOf(root, root.rect(), kLuminanceOfSrgb).is_reliable;
  unreliable_count_ += tile.unreliable ? 1 : 0;
  tile.state = State::kDeveloped;
  if (!grows_ || budget_->Exhausted()) trees.reset();
  tile.trees = std::move(trees);
  SetSize(&tile, tile.trees == nullptr ? 0 : tile.trees->size_bytes());
  changed_.erase(index);
  developed_since_refresh_.insert(index);
  has_samples_ = true;
  ++developed_count_;
}

std::vector<PixelRect> FrameMerge::UnreliableTiles() const {
  std::vector<PixelRect> tiles;
  for (size_t i = 0; i < tiles_.size(); ++i) {
    if (tiles_[i].unreliable) tiles.push_back(grid_.tiles()[i]);
  }
  return tiles;
}

std::vector<uint64_t> FrameMerge::SamplesOfCells() const {
  std::vector<uint64_t> samples = samples_;
  for (uint32_t index = 0; index < tiles_.size(); ++index) {
    const Tile& tile = tiles_[index];
    if (tile.state == State::kDeveloped) continue;
    for (uint32_t i = 0; i < grid_.cell_count(index); ++i) {
      samples[grid_.first_cell(index) + i] = tile.trees == nullptr ? 0 : tile.trees->SampleCount(i);
    }
  }
  return samples;
}

void FrameMerge::Insert(uint32_t index, CellPart part) {
  Tile& tile = tiles_[index];
  if (tile.state == State::kDeveloped) return;  // Built from disk meanwhile, this part included.
  if (tile.state == State::kEmpty) {
    std::unique_ptr<CellTrees> trees = MakeTrees(index);
    SHEAF_CHECK(trees->Insert(std::move(part.sums), part.cells).ok());
    if (!budget_->Exhausted() || Complete(index, *trees)) {
      tile.trees = std::move(trees);
      tile.state = State::kInMemory;
    } else {
      tile.state = State::kOnDisk;
    }
  } else if (tile.state == State::kInMemory) {
    SHEAF_CHECK(tile.trees->Insert(std::move(part.sums), part.cells).ok());
  }
  if (tile.state == State::kOnDisk) return;
  has_samples_ = true;
  if (Complete(index, *tile.trees)) {
    Develop(index, std::move(tile.trees));
    return;
  }
  SetSize(&tile, tile.trees->size_bytes());
  changed_.insert(index);
}

void FrameMerge::Grow(uint32_t cell, uint64_t samples) {
  SHEAF_CHECK(samples >= samples_[cell]);
  if (samples == samples_[cell]) return;
  samples_[cell] = samples;
  Tile& tile = tiles_[grid_.TileOf(cell)];
  if (tile.state != State::kDeveloped) return;
  --developed_count_;
  tile.state = tile.trees == nullptr ? State::kOnDisk : State::kInMemory;
}

void FrameMerge::MarkOnDisk(uint32_t index) {
  Tile& tile = tiles_[index];
  if (tile.state == State::kDeveloped) --developed_count_;
  tile.trees.reset();
  SetSize(&tile, 0);
  changed_.erase(index);
  tile.state = State::kOnDisk;
}

absl::Status FrameMerge::Rebuild(uint32_t index, std::vector<CellPart> parts) {
  Tile& tile = tiles_[index];
  std::unique_ptr<CellTrees> trees = MakeTrees(index);
  for (CellPart& part : parts) {
    absl::Status status = trees->Insert(std::move(part.sums), part.cells);
    if (!status.ok()) return status;
  }
  if (!Complete(index, *trees)) {
    return absl::InvalidArgumentError(
        absl::StrCat("tile ", index, " does not have all of its samples on disk"));
  }
  if (tile.state == State::kDeveloped) --developed_count_;
  Develop(index, std::move(trees));
  return absl::OkStatus();
}

std::vector<uint32_t> FrameMerge::Refresh() {
  for (const uint32_t index : changed_) DevelopTile(tiles_[index].trees->PreviewSum(), &image_);
  changed_.merge(std::exchange(developed_since_refresh_, {}));
  const std::set<uint32_t> refreshed = std::exchange(changed_, {});
  return {refreshed.begin(), refreshed.end()};
}

}  // namespace sheaf::coordinator
