// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "coordinator/core/frame/frame_tasks.h"

#include <algorithm>
#include <set>
#include <utility>
#include <vector>

#include "gtest/gtest.h"

namespace sheaf::coordinator {
namespace {

using Fit = FrameTasks::Fit;

constexpr PixelRect kTwoTiles{0, 0, 32, 16};

auto AtMost(uint64_t block_samples_max) {
  return [=](const FrameTasks::FreshBlock& /*block*/) { return block_samples_max; };
}
bool Anything(const Task& /*task*/) { return true; }

TEST(FrameTasksTest, FirstBlocksOfAllTilesComeFirst) {
  FrameTasks tasks(CellGrid({0, 0, 40, 40}, 16, 16), 64);
  ASSERT_EQ(tasks.grid().tiles().size(), 9u);
  std::set<uint32_t> tiles;
  for (int i = 0; i < 9; ++i) {
    const Task task = *tasks.TakeFresh(AtMost(16));
    EXPECT_EQ(task.block, (SampleBlock{0, 16}));
    tiles.insert(task.tile);
  }
  EXPECT_EQ(tiles.size(), 9u);
  EXPECT_EQ(tasks.TakeFresh(AtMost(16))->block, (SampleBlock{16, 16}));
}

TEST(FrameTasksTest, ResultsOfLaterTilesLeaveTheOrder) {
  FrameTasks tasks(CellGrid({0, 0, 64, 16}, 16, 16), 32);
  EXPECT_EQ(tasks.Accept({2, {0, 16}, 1}).size(), 0u);
  EXPECT_EQ(*tasks.TakeFresh(AtMost(16)), (Task{0, {0, 16}, 1}));
  EXPECT_EQ(*tasks.TakeFresh(AtMost(32)), (Task{1, {0, 32}, 1}));
  EXPECT_EQ(*tasks.TakeFresh(AtMost(32)), (Task{3, {0, 32}, 1}));
  EXPECT_EQ(*tasks.TakeFresh(AtMost(32)), (Task{0, {16, 16}, 1}));
  EXPECT_TRUE(tasks.HasReady());
  EXPECT_EQ(*tasks.TakeFresh(AtMost(32)), (Task{2, {16, 16}, 1}));
  EXPECT_FALSE(tasks.HasReady());
}

TEST(FrameTasksTest, BlocksCoverAllSamplesOnce) {
  FrameTasks tasks(CellGrid(kTwoTiles, 16, 16), 100);
  std::set<std::pair<uint32_t, uint64_t>> seen;
  while (const std::optional<Task> task = tasks.TakeFresh(AtMost(32))) {
    EXPECT_TRUE(IsAligned(task->block));
    for (uint64_t i = task->block.first; i < task->block.End(); ++i) {
      EXPECT_TRUE(seen.insert({task->tile, i}).second);
    }
    EXPECT_EQ(tasks.Accept(*task).size(), 1u);
  }
  EXPECT_EQ(seen.size(), 200u);
  EXPECT_TRUE(tasks.Complete());
  EXPECT_FALSE(tasks.HasReady());
  EXPECT_EQ(tasks.sample_count_done(), 32u * 16u * 100u);
}

TEST(FrameTasksTest, ReturnedBlockKeepsItsShape) {
  FrameTasks tasks(CellGrid(kTwoTiles, 16, 16), 64);
  const Task task = *tasks.TakeFresh(AtMost(32));
  tasks.PutBack(task);
  EXPECT_EQ(tasks.TakeReturned(Anything, 1), task);
  tasks.PutBack(task);
  EXPECT_EQ(tasks.TakeReturned([](const Task&) { return false; }, 10), std::nullopt);
  EXPECT_EQ(tasks.sample_count_ready(), tasks.sample_count_total());
}

TEST(FrameTasksTest, LateResultsOfReturnedBlocksAreAccepted) {
  FrameTasks tasks(CellGrid(kTwoTiles, 16, 16), 64);
  const Task task = *tasks.TakeFresh(AtMost(32));
  tasks.PutBack(task);
  EXPECT_EQ(tasks.FitOf(task), Fit::kWanted);
  EXPECT_TRUE(tasks.Accept(task).empty());
  EXPECT_EQ(tasks.FitOf(task), Fit::kCovered);
  EXPECT_EQ(tasks.TakeReturned(Anything, 10), std::nullopt);
}

TEST(FrameTasksTest, LateLargeResultsSupersedeSmallerLeases) {
  FrameTasks tasks(CellGrid({0, 0, 16, 16}, 16, 16), 64);
  const Task first = *tasks.TakeFresh(AtMost(8)), second = *tasks.TakeFresh(AtMost(8));
  const Task late{0, {0, 32}};
  ASSERT_EQ(tasks.FitOf(late), Fit::kWanted);
  const std::vector<Task> covered = tasks.Accept(late);
  EXPECT_EQ(covered, (std::vector<Task>{first, second}));
  EXPECT_EQ(tasks.TakeFresh(AtMost(64))->block, (SampleBlock{32, 32}));
}

TEST(FrameTasksTest, LateResultsInsideALeasedBlockAreDropped) {
  FrameTasks tasks(CellGrid({0, 0, 16, 16}, 16, 16), 64);
  tasks.TakeFresh(AtMost(32));
  EXPECT_EQ(tasks.FitOf({0, {8, 8}}), Fit::kPartial);
}

TEST(FrameTasksTest, PartlyDoneLateResultsAreDropped) {
  FrameTasks tasks(CellGrid({0, 0, 16, 16}, 16, 16), 64);
  tasks.Accept(*tasks.TakeFresh(AtMost(8)));
  EXPECT_EQ(tasks.FitOf({0, {0, 32}}), Fit::kPartial);
  EXPECT_EQ(tasks.FitOf({0, {0, 4}}), Fit::kCovered);
}

TEST(FrameTasksTest, LateResultsInsideAReturnedBlockLeaveTheRest) {
  FrameTasks tasks(CellGrid({0, 0, 16, 16}, 16, 16), 64);
  const Task task = *tasks.TakeFresh(AtMost(32));
  tasks.PutBack(task);
  ASSERT_EQ(tasks.FitOf({0, {8, 8}}), Fit::kWanted);
  tasks.Accept({0, {8, 8}});
  EXPECT_EQ(tasks.TakeReturned(Anything, 10), std::nullopt);
  uint64_t rest = 0;
  while (const std::optional<Task> next = tasks.TakeFresh(AtMost(64))) rest += next->block.count;
  EXPECT_EQ(rest, 56u);
}

TEST(FrameTasksTest, InvalidBlocksAreOutside) {
  const FrameTasks tasks(CellGrid(kTwoTiles, 16, 16), 100);
  EXPECT_EQ(tasks.FitOf({7, {0, 16}}), Fit::kOutside);
  EXPECT_EQ(tasks.FitOf({0, {96, 32}}), Fit::kOutside);
  EXPECT_EQ(tasks.FitOf({0, {uint64_t{1} << 63, uint64_t{1} << 63}}), Fit::kOutside);
  EXPECT_EQ(tasks.FitOf({0, {0, 3}}), Fit::kOutside);
  EXPECT_FALSE(tasks.grid().FindTile({0, 0, 16, 15}));
  EXPECT_EQ(tasks.grid().FindTile({16, 0, 32, 16}), 1u);
}

// One tile of four cells of 64 pixels.
CellGrid FourCells() { return {{0, 0, 16, 16}, 16, 8}; }

TEST(FrameTasksTest, BlocksCoverAllCellsThatNeedThem) {
  FrameTasks tasks(FourCells(), 16);
  EXPECT_EQ(tasks.TakeFresh(AtMost(64)), (Task{0, {0, 16}, 0b1111}));
  tasks.Grow(0, 64);
  tasks.Grow(1, 32);
  tasks.Grow(3, 96);
  EXPECT_EQ(tasks.sample_count_ready(), 64u * (48 + 16 + 80));
  // The largest block first, and what it leaves for others.
  EXPECT_EQ(tasks.TakeFresh(AtMost(64)), (Task{0, {16, 16}, 0b1011}));
  EXPECT_EQ(tasks.TakeFresh(AtMost(64)), (Task{0, {32, 32}, 0b1001}));
  EXPECT_EQ(tasks.TakeFresh(AtMost(64)), (Task{0, {64, 32}, 0b1000}));
  EXPECT_EQ(tasks.TakeFresh(AtMost(64)), std::nullopt);
  EXPECT_EQ(tasks.SamplesOfCells(), (std::vector<uint64_t>{64, 32, 16, 96}));
}

TEST(FrameTasksTest, CellsProgressIndependently) {
  FrameTasks tasks(FourCells(), 16);
  tasks.Accept(*tasks.TakeFresh(AtMost(16)));
  tasks.Grow(0, 32);
  tasks.Accept(*tasks.TakeFresh(AtMost(64)));
  for (const uint32_t cell : {0u, 1u}) tasks.Grow(cell, 64);
  // Cell 1 is at 16 and cell 0 at 32: they meet again at the next block that both want.
  EXPECT_EQ(tasks.TakeFresh(AtMost(64)), (Task{0, {16, 16}, 0b10}));
  EXPECT_EQ(tasks.TakeFresh(AtMost(64)), (Task{0, {32, 32}, 0b11}));
}

TEST(FrameTasksTest, PixelSamplesCountCells) {
  FrameTasks tasks(CellGrid({0, 0, 12, 16}, 16, 8), 16);  // 64 and 32 pixels by turns.
  EXPECT_EQ(tasks.sample_count_total(), 12u * 16u * 16u);
  EXPECT_EQ(tasks.PixelSamples({0, {0, 8}, 0b0110}), 8u * (32u + 64u));
  ASSERT_EQ(tasks.FitOf({0, {0, 8}, 0b0110}), Fit::kWanted);
  tasks.Accept({0, {0, 8}, 0b0110});
  EXPECT_EQ(tasks.sample_count_done(), 8u * (32u + 64u));
  EXPECT_FALSE(tasks.TileComplete(0));
}

TEST(FrameTasksTest, LateCellResultsAreAcceptedOnce) {
  FrameTasks tasks(FourCells(), 16);
  const Task all = *tasks.TakeFresh(AtMost(16));
  EXPECT_EQ(tasks.FitOf({0, {0, 16}, 0b0011}), Fit::kPartial) << "inside of a lease";
  tasks.PutBack(all);
  ASSERT_EQ(tasks.FitOf({0, {0, 16}, 0b0011}), Fit::kWanted);
  EXPECT_TRUE(tasks.Accept({0, {0, 16}, 0b0011}).empty());
  EXPECT_EQ(tasks.FitOf({0, {0, 16}, 0b0001}), Fit::kCovered);
  EXPECT_EQ(tasks.FitOf(all), Fit::kPartial);
  // Returned blocks are cut again.
  EXPECT_EQ(tasks.TakeReturned(Anything, 10), std::nullopt);
  const Task rest = *tasks.TakeFresh(AtMost(16));
  EXPECT_EQ(rest, (Task{0, {0, 16}, 0b1100}));
  EXPECT_EQ(tasks.Accept({0, {0, 16}, 0b1100}), std::vector<Task>{rest});
  EXPECT_TRUE(tasks.Complete());
  tasks.Revoke({0, {0, 16}, 0b0011});
  EXPECT_EQ(tasks.TakeFresh(AtMost(16)), (Task{0, {0, 16}, 0b0011}));
}

TEST(FrameTasksTest, CellsOutsideTheGridAreOutside) {
  FrameTasks tasks(FourCells(), 16);
  EXPECT_EQ(tasks.FitOf({0, {0, 16}, 0b10000}), Fit::kOutside);
  EXPECT_EQ(tasks.FitOf({0, {0, 16}, 0}), Fit::kOutside);
  tasks.Grow(2, 32);
  EXPECT_EQ(tasks.FitOf({0, {16, 16}, 0b0100}), Fit::kWanted);
  EXPECT_EQ(tasks.FitOf({0, {16, 16}, 0b0110}), Fit::kOutside);
  EXPECT_EQ(tasks.Find({0, 0, 16, 16}, {0, 16}, {8, 0b0101}), (Task{0, {0, 16}, 0b0101}));
  EXPECT_EQ(tasks.Find({0, 0, 16, 16}, {0, 16}, {}), (Task{0, {0, 16}, 0b1111}));
  EXPECT_EQ(tasks.Find({0, 0, 16, 16}, {0, 16}, {4, 1}), std::nullopt);
}

TEST(FrameTasksTest, RevokedBlockIsRenderedAgain) {
  FrameTasks tasks(CellGrid({0, 0, 16, 16}, 16, 16), 16);
  const Task task = *tasks.TakeFresh(AtMost(16));
  tasks.Accept(task);
  ASSERT_TRUE(tasks.Complete());
  tasks.Revoke(task);
  EXPECT_FALSE(tasks.Complete());
  EXPECT_EQ(tasks.TakeFresh(AtMost(16)), task);
}

// Four tiles, and light passes of 1000 paths.
FrameTasks WithLight(uint64_t samples, int32_t cell_size_px = 16) {
  return FrameTasks(CellGrid({0, 0, 32, 32}, 16, cell_size_px, /*has_light_tile=*/true), samples,
                    {}, 1000);
}

TEST(FrameTasksTest, LightPassesAreTasksOfTheLightTile) {
  FrameTasks tasks = WithLight(48);
  EXPECT_EQ(tasks.sample_count_total(), 48u * (32 * 32 + 1000));
  std::vector<SampleBlock> passes;
  uint64_t paths = 0;
  while (const std::optional<Task> task =
             tasks.TakeFresh([&](const FrameTasks::FreshBlock& block) -> uint64_t {
               if (block.kind == TaskKind::kCamera) return 64;
               paths = static_cast<uint64_t>(block.pixel_count);
               return 16;
             })) {
    if (tasks.grid().KindOf(task->tile) == TaskKind::kLight) passes.push_back(task->block);
    tasks.Accept(*task);
  }
  EXPECT_EQ(paths, 1000u);
  EXPECT_EQ(passes, (std::vector<SampleBlock>{{0, 16}, {16, 16}, {32, 16}}));
  EXPECT_TRUE(tasks.Complete());
  EXPECT_EQ(tasks.light_path_count_done(), 48'000u);
  EXPECT_EQ(tasks.SamplesOfCells(), std::vector<uint64_t>(4, 48));
}

TEST(FrameTasksTest, LightTasksAreFoundByTheirKind) {
  FrameTasks tasks(CellGrid({0, 0, 16, 16}, 16, 16, /*has_light_tile=*/true), 16);
  const PixelRect whole{0, 0, 16, 16};  // Also the only tile.
  EXPECT_EQ(tasks.Find(whole, {0, 4}, {}), (Task{0, {0, 4}, 1}));
  EXPECT_EQ(tasks.Find(whole, {0, 4}, {}, TaskKind::kLight), (Task{1, {0, 4}, 1}));
  EXPECT_EQ(tasks.Find(whole, {0, 4}, {4, 3}, TaskKind::kLight), std::nullopt);
  EXPECT_EQ(tasks.Find({0, 0, 16, 8}, {0, 4}, {}, TaskKind::kLight), std::nullopt);
  FrameTasks without(CellGrid(whole, 16, 16), 16);
  EXPECT_EQ(without.Find(whole, {0, 4}, {}, TaskKind::kLight), std::nullopt);
  EXPECT_EQ(without.light_path_count_done(), 0u);
}

// As many passes as the cell with most samples has.
TEST(FrameTasksTest, LightPassesFollowTheLargestCell) {
  FrameTasks tasks = WithLight(16, 4);
  const uint32_t light = *tasks.grid().light_tile();
  while (const std::optional<Task> task = tasks.TakeFresh(AtMost(16))) tasks.Accept(*task);
  EXPECT_TRUE(tasks.Complete());
  tasks.Grow(3, 64);
  tasks.Grow(7, 32);
  EXPECT_FALSE(tasks.TileComplete(light));
  EXPECT_EQ(tasks.FitOf({light, {32, 32}, 1}), Fit::kWanted);
  EXPECT_EQ(tasks.FitOf({light, {64, 16}, 1}), Fit::kOutside);
  EXPECT_EQ(tasks.SamplesOfCells().size(), 64u);
}

// Two tiles that need a training.
FrameTasks WithTraining() {
  return FrameTasks(CellGrid(kTwoTiles, 16, 16, /*has_light_tile=*/false,
                             /*has_training_tile=*/true),
                    16);
}

TEST(FrameTasksTest, NothingIsTakenBeforeTheTraining) {
  FrameTasks tasks = WithTraining();
  const Task training{2, {0, 1}, 1};
  EXPECT_EQ(tasks.sample_count_total(), 2u * 16 * 16 * 16);
  EXPECT_FALSE(tasks.Trained());
  ASSERT_EQ(tasks.TakeFresh(AtMost(1)), training);
  EXPECT_EQ(tasks.TakeFresh(AtMost(16)), std::nullopt);
  EXPECT_FALSE(tasks.HasReady());
  tasks.PutBack(training);
  EXPECT_TRUE(tasks.HasReady());
  EXPECT_EQ(tasks.TakeFresh(AtMost(16)), std::nullopt);
  const auto any = [](const Task&) { return true; };
  ASSERT_EQ(tasks.TakeReturned(any, 1), training);
  EXPECT_EQ(tasks.Accept(training), std::vector<Task>{training});
  EXPECT_TRUE(tasks.Trained());
  EXPECT_EQ(tasks.sample_count_done(), 0u);
  EXPECT_EQ(tasks.TakeFresh(AtMost(16)), (Task{0, {0, 16}, 1}));
}

TEST(FrameTasksTest, ALostFieldKeepsWhatIsDone) {
  FrameTasks tasks = WithTraining();
  const Task training = *tasks.TakeFresh(AtMost(1));
  tasks.Accept(training);
  const Task done = *tasks.TakeFresh(AtMost(16)), returned = *tasks.TakeFresh(AtMost(16));
  tasks.Accept(done);
  tasks.PutBack(returned);
  tasks.Revoke(training);
  EXPECT_EQ(tasks.FitOf(done), Fit::kCovered);
  const auto any = [](const Task&) { return true; };
  EXPECT_EQ(tasks.TakeReturned(any, 16), std::nullopt);
  ASSERT_EQ(tasks.TakeFresh(AtMost(16)), training);
  tasks.Accept(training);
  ASSERT_EQ(tasks.TakeReturned(any, 16), returned);
  tasks.Accept(returned);
  EXPECT_TRUE(tasks.Complete());
  tasks.Revoke(training);
  EXPECT_TRUE(tasks.Complete()) << "nothing more needs the field";
}

TEST(FrameTasksTest, WhatIsSetAsideIsTakenByNobody) {
  FrameTasks tasks(CellGrid(kTwoTiles, 16, 16), 32);
  const Task task = *tasks.TakeFresh(AtMost(16));
  EXPECT_FALSE(tasks.SetAside(task)) << "it is leased";
  tasks.PutBack(task);
  EXPECT_TRUE(tasks.SetAside(task));
  EXPECT_EQ(tasks.sample_count_aside(), 16u * 16 * 16);
  EXPECT_EQ(tasks.TakeReturned(Anything, 10), std::nullopt);
  EXPECT_FALSE(tasks.Stuck());
  while (const std::optional<Task> other = tasks.TakeFresh(AtMost(16))) tasks.Accept(*other);
  EXPECT_TRUE(tasks.Stuck());
  EXPECT_FALSE(tasks.Complete());
  EXPECT_EQ(tasks.AsideOverlapping(task), std::vector<Task>{task});
  tasks.BringBack(task);
  EXPECT_FALSE(tasks.Stuck());
  EXPECT_EQ(tasks.TakeReturned(Anything, 10), task);
  tasks.Accept(task);
  EXPECT_TRUE(tasks.Complete());
}

TEST(FrameTasksTest, TilesAreSetAsideAsAWhole) {
  FrameTasks tasks(CellGrid(kTwoTiles, 16, 16), 48);
  const Task leased = *tasks.TakeFresh(AtMost(16));
  const Task returned = *tasks.TakeFresh(AtMost(16));
  ASSERT_EQ(returned.tile, 1u);
  tasks.PutBack(returned);
  EXPECT_EQ(tasks.SetTileAside(1), (std::vector<Task>{returned, {1, {16, 16}}, {1, {32, 16}}}));
  EXPECT_EQ(tasks.sample_count_ready(), 16u * 16 * 32) << "of the other tile";
  EXPECT_EQ(tasks.FitOf({1, {0, 16}}), Fit::kWanted) << "a late result is welcome";
  tasks.Accept({1, {0, 16}});
  EXPECT_EQ(tasks.sample_count_aside(), 16u * 16 * 32);
  EXPECT_FALSE(tasks.SetAside(leased));
}

// After a restart, tasks that failed keep their shape.
TEST(FrameTasksTest, FreshBlocksCanBeKeptWhole) {
  FrameTasks tasks(CellGrid(kTwoTiles, 16, 16), 64);
  const Task kept{0, {16, 16}};
  EXPECT_TRUE(tasks.KeepWhole(kept));
  EXPECT_FALSE(tasks.KeepWhole(kept));
  EXPECT_TRUE(tasks.SetAside({1, {0, 32}}));
  EXPECT_EQ(tasks.TakeFresh(AtMost(64)), (Task{0, {0, 16}}));
  EXPECT_EQ(tasks.TakeFresh(AtMost(64)), (Task{0, {32, 32}}));
  EXPECT_EQ(tasks.TakeReturned(Anything, 10), kept);
  EXPECT_EQ(tasks.TakeFresh(AtMost(64)), (Task{1, {32, 32}}));
  EXPECT_EQ(tasks.sample_count_ready(), 0u);
}

}  // namespace
}  // namespace sheaf::coordinator
