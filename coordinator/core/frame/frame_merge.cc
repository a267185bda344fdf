// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "coordinator/core/frame/frame_merge.h"

#include <algorithm>
#include <numeric>
#include <utility>

#include "absl/strings/str_cat.h"
#include "common/base/check.h"
#include "common/scene/settings/sample_bound.h"
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
      has_light_(grid_.light_tile().has_value()),
      samples_(std::move(samples)),
      tiles_(grid_.tile_count()),
      budget_(budget),
      image_(MakeFrameImage(spec.settings.window, spec.settings.width_px, spec.settings.height_px,
                            spec.settings.outputs,
                            ImageColorOf(spec.settings.primaries, spec.settings.white_balance_k,
                                         spec.settings.sensor))) {
  SHEAF_CHECK(samples_.size() == grid_.cells().size());
  if (spec.settings.IsStereo()) AddEyeDifference(&image_);
  if (has_light_) {
    samples_.push_back(std::ranges::max(samples_));
    camera_.image = image_;
    light_.image = MakeFrameImage(image_.window, image_.frame_width_px, image_.frame_height_px,
                                  LightOutputsOf(spec.settings), image_.color);
  }
  if (!spec.settings.one_sequence && spec.settings.lattice.All()) {
    camera_.error_sample.emplace(spec.settings.window);
    if (has_light_) light_.error_sample.emplace(spec.settings.window);
  }
  if (const SampleBound bound = SampleBoundOf(spec.settings); bound.most) {
    certificate_.emplace(spec.settings.window, *bound.most);
  }
}

FrameMerge::~FrameMerge() {
  for (Tile& tile : tiles_) SetSize(&tile, 0);
  budget_->Change(certificate_bytes_, 0);
}

void FrameMerge::SetSize(Tile* tile, uint64_t size_bytes) {
  budget_->Change(tile->size_bytes, size_bytes);
  tile->size_bytes = size_bytes;
}

std::unique_ptr<CellTrees> FrameMerge::MakeTrees(uint32_t index) const {
  return std::make_unique<CellTrees>(grid_.RectOf(index), grid_.CellRectsOf(index));
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
  // Only frames that grow need the sums later.
  const bool keeps_trees = grows_ && !budget_->Exhausted();
  const FilmTile root = keeps_trees ? trees->Root() : std::move(*trees).Root();
  DevelopTile(root, &TargetOf(index));
  Combine(index);
  std::optional<ErrorSample>& error_sample = LayerOf(index).error_sample;
  if (error_sample) error_sample->DevelopTile(root, image_.color);
  if (certificate_) TakeCertificate(root);
  signed_weights_ = signed_weights_ || HasSignedWeights(root);
  NoteNames(root, &image_);
  SetIntervals(index, root);
  tile.state = State::kDeveloped;
  if (!keeps_trees) trees.reset();
  tile.trees = std::move(trees);
  SetSize(&tile, tile.trees == nullptr ? 0 : tile.trees->size_bytes());
  changed_.erase(index);
  developed_since_refresh_.insert(index);
  ++developed_count_;
}

void FrameMerge::TakeCertificate(const FilmTile& root) {
  certificate_->TakeTile(root);
  const uint64_t bytes = certificate_->memory_bytes();
  budget_->Change(certificate_bytes_, bytes);
  certificate_bytes_ = bytes;
}

void FrameMerge::Combine(uint32_t index) {
  if (has_light_) AddLight(camera_.image, light_.image, grid_.RectOf(index), &image_);
}

void FrameMerge::SetIntervals(uint32_t index, const FilmTile& root) {
  const auto interval_of = [&root](const PixelRect& rect) {
    return root.replicate_count() == kReplicateCount ? MeanIntervalOf(root, rect, kLuminanceOfSrgb)
                                                     : MeanInterval();
  };
  if (grid_.KindOf(index) == TaskKind::kCamera) {
    tiles_[index].interval = interval_of(root.rect());
    return;
  }
  light_intervals_.clear();
  for (const PixelRect& rect : grid_.tiles()) light_intervals_.push_back(interval_of(rect));
}

std::vector<PixelRect> FrameMerge::UnreliableTiles() const {
  std::vector<PixelRect> tiles;
  for (size_t i = 0; i < grid_.tiles().size(); ++i) {
    const bool is_reliable = light_intervals_.empty()
                                 ? tiles_[i].interval.is_reliable
                                 : IsSumReliable(tiles_[i].interval, light_intervals_[i]);
    if (!is_reliable) tiles.push_back(grid_.tiles()[i]);
  }
  return tiles;
}

std::optional<double> FrameMerge::Flip() const {
  if (!camera_.error_sample) return std::nullopt;
  if (!has_light_) return EstimateFlip(image_, *camera_.error_sample);
  ErrorSample sum = *camera_.error_sample;
  sum.Add(*light_.error_sample);
  return EstimateFlip(image_, sum);
}

double FrameMerge::CertifiedError() const {
  if (!certificate_ || signed_weights_) return 0;
  return certificate_->CertifiedError(FewestSamples()).relative_mse_upper;
}

uint64_t FrameMerge::SamplesOf(uint32_t index, uint32_t cell_of_tile) const {
  const Tile& tile = tiles_[index];
  if (tile.state == State::kDeveloped) return samples_[grid_.first_cell(index) + cell_of_tile];
  return tile.trees == nullptr ? 0 : tile.trees->SampleCount(cell_of_tile);
}

std::vector<uint64_t> FrameMerge::SamplesOfCells() const {
  std::vector<uint64_t> samples;
  samples.reserve(grid_.cells().size());
  for (uint32_t index = 0; index < grid_.tiles().size(); ++index) {
    for (uint32_t i = 0; i < grid_.cell_count(index); ++i) samples.push_back(SamplesOf(index, i));
  }
  return samples;
}

uint64_t FrameMerge::FewestSamples() const {
  const uint64_t fewest = std::ranges::min(SamplesOfCells());
  return has_light_ ? std::min(fewest, SamplesOf(*grid_.light_tile(), 0)) : fewest;
}

bool FrameMerge::AwaitsLight() const {
  return has_light_ && SamplesOf(*grid_.light_tile(), 0) == 0;
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
  if (Complete(index, *tile.trees)) {
    Develop(index, std::move(tile.trees));
    return;
  }
  SetSize(&tile, tile.trees->size_bytes());
  changed_.insert(index);
}

void FrameMerge::Grow(uint32_t cell, uint64_t samples) {
  GrowCell(cell, samples);
  if (has_light_) GrowCell(grid_.total_cell_count() - 1, std::max(samples, samples_.back()));
}

void FrameMerge::GrowCell(uint32_t cell, uint64_t samples) {
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

absl::Status FrameMerge::Rebuild(uint32_t index, std::unique_ptr<CellTrees> trees) {
  if (!Complete(index, *trees)) {
    return absl::InvalidArgumentError(
        absl::StrCat("tile ", index, " does not have all of its samples on disk"));
  }
  if (tiles_[index].state == State::kDeveloped) --developed_count_;
  Develop(index, std::move(trees));
  return absl::OkStatus();
}

std::vector<uint32_t> FrameMerge::Refresh() {
  if (AwaitsLight()) return {};
  for (const uint32_t index : changed_) {
    DevelopTile(tiles_[index].trees->PreviewSum(), &TargetOf(index));
    Combine(index);
  }
  changed_.merge(std::exchange(developed_since_refresh_, {}));
  const std::set<uint32_t> refreshed = std::exchange(changed_, {});
  std::vector<uint32_t> tiles(refreshed.begin(), refreshed.end());
  // The light tile, which is the last, is the whole image.
  if (has_light_ && !tiles.empty() && tiles.back() == *grid_.light_tile()) {
    tiles.resize(grid_.tiles().size());
    std::iota(tiles.begin(), tiles.end(), 0);
  }
  return tiles;
}

}  // namespace sheaf::coordinator
