// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "coordinator/core/frame/frame_tasks.h"

#include <algorithm>
#include <bit>
#include <tuple>

#include "common/base/check.h"

namespace sheaf::coordinator {

bool FrameTasks::ByTileAndSample::operator()(const Task& a, const Task& b) const {
  return std::tie(a.tile, a.block.first, a.block.count, a.cells) <
         std::tie(b.tile, b.block.first, b.block.count, b.cells);
}

template <typename Visit>
bool FrameTasks::ForCells(uint32_t tile, uint64_t mask, const Visit& visit) const {
  const uint32_t first = grid_.first_cell(tile);
  for (; mask != 0; mask &= mask - 1) {
    if (!visit(first + static_cast<uint32_t>(std::countr_zero(mask)))) return false;
  }
  return true;
}

void FrameTasks::Touch(uint32_t tile) {
  for (; untouched_ <= tile && untouched_ < untouched_end_; ++untouched_) {
    fresh_queue_.emplace(0, untouched_);
  }
}

template <typename Change>
void FrameTasks::ChangeFresh(uint32_t tile, uint64_t mask, const Change& change) {
  Touch(tile);
  if (const std::optional<uint64_t> first = FirstFresh(tile)) fresh_queue_.erase({*first, tile});
  ForCells(tile, mask, [&](uint32_t index) {
    Cell& cell = cells_[index];
    ready_count_ -= cell.PixelSamples(cell.fresh.SampleCount());
    change(cell.fresh);
    ready_count_ += cell.PixelSamples(cell.fresh.SampleCount());
    return true;
  });
  if (const std::optional<uint64_t> first = FirstFresh(tile)) fresh_queue_.insert({*first, tile});
}

std::optional<uint64_t> FrameTasks::FirstFresh(uint32_t tile) const {
  std::optional<uint64_t> first;
  ForCells(tile, grid_.AllOf(tile), [&](uint32_t index) {
    const SampleRanges& fresh = cells_[index].fresh;
    if (fresh.empty()) return true;
    first = std::min(first.value_or(kSampleIndexEnd), fresh.ranges().front().first);
    return true;
  });
  return first;
}

FrameTasks::FrameTasks(CellGrid grid, uint64_t samples, const PixelLattice& lattice,
                       int64_t paths_per_pass)
    : grid_(std::move(grid)),
      cells_(grid_.first_cell(grid_.all_tile_count())),
      cpu_of_tiles_(grid_.all_tile_count(), absl::ZeroDuration()) {
  SHEAF_CHECK(samples > 0);
  // Runs under the farm's lock, so avoids a search per tile.
  for (uint32_t index = 0; index < cells_.size(); ++index) {
    Cell& cell = cells_[index];
    cell.samples = samples;
    if (index < grid_.cells().size()) {
      cell.pixel_count = std::max<int64_t>(1, lattice.CountIn(grid_.cells()[index]));
    } else if (index < grid_.total_cell_count()) {
      cell.pixel_count = paths_per_pass;
    } else {
      cell.samples = 1;
    }
    cell.fresh.Add({0, cell.samples});
    total_count_ += cell.PixelSamples(cell.samples);
  }
  ready_count_ = total_count_;
  untouched_end_ = grid_.tile_count();
  if (const auto training = grid_.training_tile()) fresh_queue_.emplace(0, *training);
}

void FrameTasks::Grow(uint32_t index, uint64_t samples) {
  GrowCell(index, samples);
  if (!grid_.light_tile()) return;
  const uint32_t light = grid_.first_cell(*grid_.light_tile());
  GrowCell(light, std::max(samples, cells_[light].samples));
}

uint64_t FrameTasks::light_path_count_done() const {
  if (!grid_.light_tile()) return 0;
  const Cell& cell = cells_[grid_.first_cell(*grid_.light_tile())];
  return cell.PixelSamples(cell.done.SampleCount());
}

void FrameTasks::GrowCell(uint32_t index, uint64_t samples) {
  Cell& cell = cells_[index];
  const uint64_t before = cell.samples;
  SHEAF_CHECK(samples >= before);
  if (samples == before) return;
  cell.samples = samples;
  total_count_ += cell.PixelSamples(samples - before);
  const uint32_t tile = grid_.TileOf(index);
  ChangeFresh(tile, uint64_t{1} << (index - grid_.first_cell(tile)), [&](SampleRanges& fresh) {
    fresh.Add({before, samples});
  });
}

std::optional<Task> FrameTasks::Find(const PixelRect& tile, SampleBlock block,
                                     const TileCells& cells, TaskKind kind) const {
  const std::optional<uint32_t> index = grid_.FindTile(tile, kind);
  if (!index) return std::nullopt;
  const std::optional<uint64_t> mask = grid_.MaskOf(*index, cells);
  if (!mask) return std::nullopt;
  return Task{*index, block, *mask};
}

std::vector<uint64_t> FrameTasks::SamplesOfCells() const {
  std::vector<uint64_t> samples;
  samples.reserve(grid_.cells().size());
  for (size_t i = 0; i < grid_.cells().size(); ++i) samples.push_back(cells_[i].samples);
  return samples;
}

uint64_t FrameTasks::PixelSamples(const Task& task) const {
  uint64_t sum = 0;
  ForCells(task.tile, task.cells, [&](uint32_t index) {
    sum += cells_[index].PixelSamples(task.block.count);
    return true;
  });
  return sum;
}

bool FrameTasks::TileComplete(uint32_t tile) const {
  return ForCells(tile, grid_.AllOf(tile), [&](uint32_t index) {
    return cells_[index].done.Contains({0, cells_[index].samples});
  });
}

bool FrameTasks::Trained() const {
  const std::optional<uint32_t> tile = grid_.training_tile();
  return !tile || TileComplete(*tile);
}

bool FrameTasks::HasReady() const {
  if (Trained()) {
    return untouched_ < untouched_end_ || !fresh_queue_.empty() || !returned_.empty();
  }
  const uint32_t tile = *grid_.training_tile();  // The last one.
  return fresh_queue_.contains({0, tile}) ||
         returned_.lower_bound({tile, {0, 0}, 0}) != returned_.end();
}

std::optional<Task> FrameTasks::TakeReturned(const std::function<bool(const Task&)>& allowed,
                                             int scan_max) {
  int scanned = 0;
  const auto first =
      Trained() ? returned_.begin() : returned_.lower_bound({*grid_.training_tile(), {0, 0}, 0});
  for (auto it = first; it != returned_.end() && scanned < scan_max; ++it, ++scanned) {
    const Task task = *it;
    if (!allowed(task)) continue;
    leased_.insert(task);
    returned_.erase(it);
    ready_count_ -= PixelSamples(task);
    return task;
  }
  return std::nullopt;
}

std::optional<Task> FrameTasks::TakeFresh(
    const std::function<uint64_t(const FreshBlock& block)>& block_samples_max) {
  // An untouched tile precedes all others except those whose first sample is also fresh.
  const bool has_first = !fresh_queue_.empty() && fresh_queue_.begin()->first == 0;
  if (Trained() && !has_first) Touch(untouched_);
  const auto next =
      Trained() ? fresh_queue_.begin() : fresh_queue_.find({0, *grid_.training_tile()});
  if (next == fresh_queue_.end()) return std::nullopt;
  const auto [first, tile] = *next;
  int64_t pixel_count = 0;
  ForCells(tile, grid_.AllOf(tile), [&, f = first](uint32_t index) {
    const Cell& cell = cells_[index];
    if (cell.fresh.Contains({f, f + 1})) pixel_count += cell.pixel_count;
    return true;
  });
  const uint64_t most = block_samples_max({grid_.KindOf(tile), first, pixel_count});
  const Task task = CutFresh(tile, first, most);
  leased_.insert(task);
  return task;
}

Task FrameTasks::CutFresh(uint32_t tile, uint64_t first, uint64_t samples_max) {
  const uint64_t all = grid_.AllOf(tile);
  Task task{tile, {first, 1}, 0};
  ForCells(tile, all, [&](uint32_t index) {
    const SampleRanges& fresh = cells_[index].fresh;
    if (!fresh.Contains({first, first + 1})) return true;
    task.block.count = std::max(task.block.count, fresh.FirstBlock(samples_max).count);
    return true;
  });
  ForCells(tile, all, [&](uint32_t index) {
    const bool wants = cells_[index].fresh.Contains(RangeOf(task.block));
    if (wants) task.cells |= uint64_t{1} << (index - grid_.first_cell(tile));
    return true;
  });
  ChangeFresh(tile, task.cells, [&](SampleRanges& fresh) { fresh.Remove(RangeOf(task.block)); });
  return task;
}

bool FrameTasks::RemoveFresh(const Task& task) {
  if (FitOf(task) != Fit::kWanted) return false;
  const SampleRanges::Range range = RangeOf(task.block);
  const bool is_fresh = ForCells(
      task.tile, task.cells, [&](uint32_t index) { return cells_[index].fresh.Contains(range); });
  if (!is_fresh) return false;
  ChangeFresh(task.tile, task.cells, [&](SampleRanges& fresh) { fresh.Remove(range); });
  return true;
}

bool FrameTasks::KeepWhole(const Task& task) {
  if (!RemoveFresh(task)) return false;
  returned_.insert(task);
  ready_count_ += PixelSamples(task);
  return true;
}

bool FrameTasks::SetAside(const Task& task) {
  if (returned_.erase(task) == 1) {
    ready_count_ -= PixelSamples(task);
  } else if (!RemoveFresh(task)) {
    return false;
  }
  aside_.insert(task);
  aside_count_ += PixelSamples(task);
  return true;
}

std::vector<Task> FrameTasks::SetTileAside(uint32_t tile) {
  std::vector<Task> tasks;
  for (auto it = returned_.lower_bound({tile, {0, 0}, 0}); it != returned_.end(); ++it) {
    if (it->tile != tile) break;
    tasks.push_back(*it);
  }
  for (const Task& task : tasks) SetAside(task);
  while (const std::optional<uint64_t> first = FirstFresh(tile)) {
    const Task task = CutFresh(tile, *first, kSampleIndexEnd);
    aside_.insert(task);
    aside_count_ += PixelSamples(task);
    tasks.push_back(task);
  }
  return tasks;
}

void FrameTasks::BringBack(const Task& task) {
  SHEAF_CHECK(aside_.erase(task) == 1);
  aside_count_ -= PixelSamples(task);
  returned_.insert(task);
  ready_count_ += PixelSamples(task);
}

void FrameTasks::PutBack(const Task& task) {
  SHEAF_CHECK(leased_.erase(task) == 1);
  returned_.insert(task);
  ready_count_ += PixelSamples(task);
}

std::vector<Task> FrameTasks::Overlapping(const Tasks& tasks, const Task& task) {
  std::vector<Task> overlapping;
  for (auto it = tasks.lower_bound({task.tile, {0, 0}, 0});
       it != tasks.end() && it->tile == task.tile && it->block.first < task.block.End(); ++it) {
    if (it->block.End() > task.block.first && (it->cells & task.cells) != 0) {
      overlapping.push_back(*it);
    }
  }
  return overlapping;
}

FrameTasks::Fit FrameTasks::FitOf(const Task& task) const {
  if (task.tile >= grid_.all_tile_count() || !IsAligned(task.block) || task.cells == 0 ||
      (task.cells & ~grid_.AllOf(task.tile)) != 0) {
    return Fit::kOutside;
  }
  const SampleRanges::Range range = RangeOf(task.block);
  const auto of_cells = [&](const auto& holds) {
    return ForCells(task.tile, task.cells, [&](uint32_t i) { return holds(cells_[i]); });
  };
  if (!of_cells([&](const Cell& cell) { return range.end <= cell.samples; })) return Fit::kOutside;
  if (of_cells([&](const Cell& cell) { return cell.done.Contains(range); })) return Fit::kCovered;
  if (!of_cells([&](const Cell& cell) { return !cell.done.Overlaps(range); })) {
    return Fit::kPartial;
  }
  for (const Task& leased : Overlapping(leased_, task)) {
    const bool covered = Contains(task.block, leased.block) && (leased.cells & ~task.cells) == 0;
    if (!covered) return Fit::kPartial;
  }
  return Fit::kWanted;
}

std::vector<Task> FrameTasks::Accept(const Task& task, absl::Duration cpu_duration) {
  SHEAF_CHECK(FitOf(task) == Fit::kWanted);
  const std::vector<Task> covered = Overlapping(leased_, task);
  for (const Task& leased : covered) leased_.erase(leased);
  // A returned block that is larger than the result is cut again from its remaining samples.
  for (const Task& returned : Overlapping(returned_, task)) {
    returned_.erase(returned);
    ready_count_ -= PixelSamples(returned);
    ChangeFresh(task.tile, returned.cells,
                [&](SampleRanges& fresh) { fresh.Add(RangeOf(returned.block)); });
  }
  for (const Task& aside : Overlapping(aside_, task)) {
    aside_.erase(aside);
    aside_count_ -= PixelSamples(aside);
    ChangeFresh(task.tile, aside.cells,
                [&](SampleRanges& fresh) { fresh.Add(RangeOf(aside.block)); });
  }
  ChangeFresh(task.tile, task.cells,
              [&](SampleRanges& fresh) { fresh.Remove(RangeOf(task.block)); });
  ForCells(task.tile, task.cells, [&](uint32_t index) {
    cells_[index].done.Add(RangeOf(task.block));
    return true;
  });
  cpu_of_tiles_[task.tile] += cpu_duration;
  done_count_ += PixelSamples(task);
  return covered;
}

void FrameTasks::Revoke(const Task& task) {
  SHEAF_CHECK(FitOf(task) == Fit::kCovered);
  ForCells(task.tile, task.cells, [&](uint32_t index) {
    cells_[index].done.Remove(RangeOf(task.block));
    return true;
  });
  done_count_ -= PixelSamples(task);
  ChangeFresh(task.tile, task.cells, [&](SampleRanges& fresh) { fresh.Add(RangeOf(task.block)); });
}

}  // namespace sheaf::coordinator
