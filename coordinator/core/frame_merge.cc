// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "coordinator/core/frame_merge.h"

#include <utility>

#include "absl/strings/str_cat.h"
#include "common/base/check.h"
#include "common/film/mean_interval.h"
#include "common/scene/primaries.h"

namespace sheaf::coordinator {
namespace {

uint64_t TreeBytes(const TileTree& tree) {
  uint64_t size_bytes = 0;
  for (const auto& [first, node] : tree.nodes()) size_bytes += node.size_bytes();
  return size_bytes;
}

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

FrameMerge::FrameMerge(const FrameSpec& spec, std::vector<PixelRect> tiles,
                       std::span<const uint64_t> samples, MergeBudget* budget)
    : grows_(spec.stop.IsActive()),
      budget_(budget),
      picture_(MakeFramePicture(
          spec.settings.window, spec.settings.width_px, spec.settings.height_px,
          spec.settings.outputs,
          PictureColorOf(spec.settings.primaries, spec.settings.white_balance_k))) {
  SHEAF_CHECK(samples.size() == tiles.size());
  if (!spec.settings.one_sequence && spec.settings.lattice.All()) {
    error_sample_.emplace(spec.settings.window);
  }
  tiles_.resize(tiles.size());
  for (size_t i = 0; i < tiles.size(); ++i) {
    tiles_[i].rect = tiles[i];
    tiles_[i].samples = samples[i];
  }
}

FrameMerge::~FrameMerge() {
  for (Tile& tile : tiles_) SetSize(&tile, 0);
}

void FrameMerge::SetSize(Tile* tile, uint64_t size_bytes) {
  budget_->Change(tile->size_bytes, size_bytes);
  tile->size_bytes = size_bytes;
}

void FrameMerge::Develop(uint32_t index, std::unique_ptr<TileTree> tree) {
  Tile& tile = tiles_[index];
  const FilmTile root = tree->Root();
  DevelopTile(root, &picture_);
  if (error_sample_) error_sample_->DevelopTile(root, picture_.color);
  signed_weights_ = signed_weights_ || HasSignedWeights(root);
  NoteNames(root, &picture_);
  unreliable_count_ -= tile.unreliable ? 1 : 0;
  tile.unreliable = root.replicate_count() == kReplicateCount &&
                    !MeanIntervalOf(root, root.rect(), kLuminanceOfSrgb).is_reliable;
  unreliable_count_ += tile.unreliable ? 1 : 0;
  tile.state = State::kDeveloped;
  if (!grows_ || budget_->Exhausted()) tree.reset();
  tile.tree = std::move(tree);
  SetSize(&tile, tile.tree == nullptr ? 0 : TreeBytes(*tile.tree));
  changed_.erase(index);
  developed_since_refresh_.insert(index);
  has_samples_ = true;
  ++developed_count_;
}

std::vector<PixelRect> FrameMerge::UnreliableTiles() const {
  std::vector<PixelRect> tiles;
  for (const Tile& tile : tiles_) {
    if (tile.unreliable) tiles.push_back(tile.rect);
  }
  return tiles;
}

uint64_t FrameMerge::SamplesOf(uint32_t index) const {
  const Tile& tile = tiles_[index];
  if (tile.state == State::kDeveloped) return tile.samples;
  return tile.tree == nullptr ? 0 : tile.tree->SampleCount();
}

void FrameMerge::Insert(uint32_t index, FilmTile part) {
  Tile& tile = tiles_[index];
  if (tile.state == State::kDeveloped) return;  // Built from disk meanwhile, this part included.
  if (tile.state == State::kEmpty) {
    const bool whole = part.block().first == 0 && part.block().count == tile.samples;
    if (budget_->Exhausted() && !whole) {
      tile.state = State::kOnDisk;
    } else {
      tile.state = State::kInMemory;
      tile.tree = std::make_unique<TileTree>(tile.rect);
    }
  }
  if (tile.state == State::kOnDisk) return;
  SHEAF_CHECK(tile.tree->Insert(std::move(part)).ok());
  has_samples_ = true;
  if (tile.tree->SampleCount() == tile.samples) {
    Develop(index, std::move(tile.tree));
    return;
  }
  SetSize(&tile, TreeBytes(*tile.tree));
  changed_.insert(index);
}

void FrameMerge::Grow(uint32_t index, uint64_t samples) {
  Tile& tile = tiles_[index];
  SHEAF_CHECK(samples >= tile.samples);
  if (samples == tile.samples) return;
  tile.samples = samples;
  if (tile.state != State::kDeveloped) return;
  --developed_count_;
  tile.state = tile.tree == nullptr ? State::kOnDisk : State::kInMemory;
}

void FrameMerge::MarkOnDisk(uint32_t index) {
  Tile& tile = tiles_[index];
  if (tile.state == State::kDeveloped) --developed_count_;
  tile.tree.reset();
  SetSize(&tile, 0);
  changed_.erase(index);
  tile.state = State::kOnDisk;
}

absl::Status FrameMerge::Rebuild(uint32_t index, std::vector<FilmTile> parts) {
  Tile& tile = tiles_[index];
  auto tree = std::make_unique<TileTree>(tile.rect);
  for (FilmTile& part : parts) {
    absl::Status status = tree->Insert(std::move(part));
    if (!status.ok()) return status;
  }
  if (tree->SampleCount() != tile.samples) {
    return absl::InvalidArgumentError(absl::StrCat("tile ", index, " has ", tree->SampleCount(),
                                                   " of ", tile.samples, " samples on disk"));
  }
  if (tile.state == State::kDeveloped) --developed_count_;
  Develop(index, std::move(tree));
  return absl::OkStatus();
}

std::vector<uint32_t> FrameMerge::Refresh() {
  for (const uint32_t index : changed_) DevelopTile(tiles_[index].tree->PreviewSum(), &picture_);
  changed_.merge(std::exchange(developed_since_refresh_, {}));
  const std::set<uint32_t> refreshed = std::exchange(changed_, {});
  return {refreshed.begin(), refreshed.end()};
}

}  // namespace sheaf::coordinator
