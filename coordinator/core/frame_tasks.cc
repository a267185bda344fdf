// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "coordinator/core/frame_tasks.h"

#include <algorithm>

#include "common/base/check.h"

namespace sheaf::coordinator {

FrameTasks::FrameTasks(PixelRect window, uint64_t samples, int32_t tile_size_px,
                       const PixelLattice& lattice)
    : tiles_(CutTiles(window, tile_size_px)) {
  SHEAF_CHECK(!tiles_.empty() && samples > 0);
  states_.resize(tiles_.size());
  for (uint32_t tile = 0; tile < tiles_.size(); ++tile) {
    states_[tile].pixel_count = std::max<int64_t>(1, lattice.CountIn(tiles_[tile]));
    tile_at_[{tiles_[tile].y0, tiles_[tile].x0}] = tile;
    Grow(tile, samples);
  }
}

void FrameTasks::Grow(uint32_t tile, uint64_t samples) {
  const uint64_t before = states_[tile].samples;
  SHEAF_CHECK(samples >= before);
  if (samples == before) return;
  states_[tile].samples = samples;
  total_count_ += PixelSamples(tile, samples - before);
  SetFresh(tile, [&](SampleRanges& fresh) { fresh.Add({before, samples}); });
}

std::vector<uint64_t> FrameTasks::SamplesOfTiles() const {
  std::vector<uint64_t> samples;
  samples.reserve(states_.size());
  for (const Tile& tile : states_) samples.push_back(tile.samples);
  return samples;
}

uint64_t FrameTasks::PixelSamples(uint32_t tile, uint64_t samples) const {
  return static_cast<uint64_t>(states_[tile].pixel_count) * samples;
}

std::optional<uint32_t> FrameTasks::FindTile(const PixelRect& rect) const {
  const auto found = tile_at_.find({rect.y0, rect.x0});
  if (found == tile_at_.end() || !(tiles_[found->second] == rect)) return std::nullopt;
  return found->second;
}

bool FrameTasks::TileComplete(uint32_t tile) const {
  return states_[tile].done.Contains({0, states_[tile].samples});
}

void FrameTasks::SetFresh(uint32_t tile, const std::function<void(SampleRanges&)>& change) {
  SampleRanges& fresh = states_[tile].fresh;
  if (!fresh.empty()) fresh_queue_.erase({fresh.ranges().front().first, tile});
  ready_count_ -= PixelSamples(tile, fresh.SampleCount());
  change(fresh);
  ready_count_ += PixelSamples(tile, fresh.SampleCount());
  if (!fresh.empty()) fresh_queue_.insert({fresh.ranges().front().first, tile});
}

std::optional<Task> FrameTasks::TakeReturned(const std::function<bool(const Task&)>& allowed,
                                             int scan_max) {
  int scanned = 0;
  for (auto it = returned_.begin(); it != returned_.end() && scanned < scan_max; ++it, ++scanned) {
    const Task task{it->first.first, it->second};
    if (!allowed(task)) continue;
    leased_.insert(*it);
    returned_.erase(it);
    ready_count_ -= PixelSamples(task.tile, task.block.count);
    return task;
  }
  return std::nullopt;
}

std::optional<Task> FrameTasks::TakeFresh(
    const std::function<uint64_t(uint64_t first, int64_t pixel_count)>& block_samples_max) {
  if (fresh_queue_.empty()) return std::nullopt;
  const auto [first, tile] = *fresh_queue_.begin();
  Task task{tile, {}};
  SetFresh(tile, [&, t = tile, f = first](SampleRanges& fresh) {
    task.block = fresh.FirstBlock(block_samples_max(f, states_[t].pixel_count));
    fresh.Remove(RangeOf(task.block));
  });
  leased_[{tile, task.block.first}] = task.block;
  return task;
}

void FrameTasks::PutBack(const Task& task) {
  const auto found = leased_.find({task.tile, task.block.first});
  SHEAF_CHECK(found != leased_.end() && found->second == task.block);
  returned_.insert(*found);
  leased_.erase(found);
  ready_count_ += PixelSamples(task.tile, task.block.count);
}

std::vector<SampleBlock> FrameTasks::Overlapping(const Blocks& blocks, const Task& task) {
  std::vector<SampleBlock> overlapping;
  auto it = blocks.upper_bound({task.tile, task.block.first});
  // The block before may reach into this one.
  if (it != blocks.begin()) --it;
  for (; it != blocks.end() && it->first.first <= task.tile; ++it) {
    if (it->first.first < task.tile || it->second.End() <= task.block.first) continue;
    if (it->second.first >= task.block.End()) break;
    overlapping.push_back(it->second);
  }
  return overlapping;
}

FrameTasks::Fit FrameTasks::FitOf(const Task& task) const {
  if (task.tile >= tiles_.size() || !IsAligned(task.block)) return Fit::kOutside;
  const uint64_t samples = states_[task.tile].samples;
  if (task.block.first >= samples || task.block.count > samples - task.block.first) {
    return Fit::kOutside;
  }
  const SampleRanges& done = states_[task.tile].done;
  if (done.Contains(RangeOf(task.block))) return Fit::kCovered;
  if (done.Overlaps(RangeOf(task.block))) return Fit::kPartial;
  for (const SampleBlock& leased : Overlapping(leased_, task)) {
    if (!Contains(task.block, leased)) return Fit::kPartial;
  }
  return Fit::kWanted;
}

std::vector<Task> FrameTasks::Accept(const Task& task, absl::Duration cpu_duration) {
  SHEAF_CHECK(FitOf(task) == Fit::kWanted);
  std::vector<Task> covered;
  for (const SampleBlock& leased : Overlapping(leased_, task)) {
    covered.push_back({task.tile, leased});
    leased_.erase({task.tile, leased.first});
  }
  // A returned block that is larger than the result is cut anew from what is left of it.
  SampleRanges rest;
  for (const SampleBlock& returned : Overlapping(returned_, task)) {
    returned_.erase({task.tile, returned.first});
    ready_count_ -= PixelSamples(task.tile, returned.count);
    rest.Add(RangeOf(returned));
  }
  rest.Remove(RangeOf(task.block));
  SetFresh(task.tile, [&](SampleRanges& fresh) {
    fresh.Remove(RangeOf(task.block));
    for (const SampleRanges::Range& range : rest.ranges()) fresh.Add(range);
  });
  states_[task.tile].done.Add(RangeOf(task.block));
  states_[task.tile].cpu_duration += cpu_duration;
  done_count_ += PixelSamples(task.tile, task.block.count);
  return covered;
}

void FrameTasks::Revoke(const Task& task) {
  SHEAF_CHECK(FitOf(task) == Fit::kCovered);
  states_[task.tile].done.Remove(RangeOf(task.block));
  done_count_ -= PixelSamples(task.tile, task.block.count);
  SetFresh(task.tile, [&](SampleRanges& fresh) { fresh.Add(RangeOf(task.block)); });
}

}  // namespace sheaf::coordinator
