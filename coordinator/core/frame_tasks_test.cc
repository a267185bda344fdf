// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "coordinator/core/frame_tasks.h"

#include <algorithm>
#include <set>
#include <utility>

#include "gtest/gtest.h"

namespace sheaf::coordinator {
namespace {

using Fit = FrameTasks::Fit;

constexpr PixelRect kTwoTiles{0, 0, 32, 16};

auto AtMost(uint64_t block_samples_max) {
  return [=](uint64_t /*first*/, int64_t /*pixel_count*/) { return block_samples_max; };
}
bool Anything(const Task& /*task*/) { return true; }

TEST(FrameTasksTest, EveryTilesFirstBlockComesBeforeAnySecondOne) {
  FrameTasks tasks({0, 0, 40, 40}, 64, 16);
  ASSERT_EQ(tasks.tiles().size(), 9u);
  std::set<uint32_t> tiles;
  for (int i = 0; i < 9; ++i) {
    const Task task = *tasks.TakeFresh(AtMost(16));
    EXPECT_EQ(task.block, (SampleBlock{0, 16}));
    tiles.insert(task.tile);
  }
  EXPECT_EQ(tiles.size(), 9u);
  EXPECT_EQ(tasks.TakeFresh(AtMost(16))->block, (SampleBlock{16, 16}));
}

TEST(FrameTasksTest, BlocksCoverAllSamplesOnce) {
  FrameTasks tasks(kTwoTiles, 100, 16);
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
  FrameTasks tasks(kTwoTiles, 64, 16);
  const Task task = *tasks.TakeFresh(AtMost(32));
  tasks.PutBack(task);
  EXPECT_EQ(tasks.TakeReturned(Anything, 1), task);
  tasks.PutBack(task);
  EXPECT_EQ(tasks.TakeReturned([](const Task&) { return false; }, 10), std::nullopt);
  EXPECT_EQ(tasks.sample_count_ready(), tasks.sample_count_total());
}

TEST(FrameTasksTest, LateResultOfAReturnedBlockIsTaken) {
  FrameTasks tasks(kTwoTiles, 64, 16);
  const Task task = *tasks.TakeFresh(AtMost(32));
  tasks.PutBack(task);
  EXPECT_EQ(tasks.FitOf(task), Fit::kWanted);
  EXPECT_TRUE(tasks.Accept(task).empty());
  EXPECT_EQ(tasks.FitOf(task), Fit::kCovered);
  EXPECT_EQ(tasks.TakeReturned(Anything, 10), std::nullopt);
}

TEST(FrameTasksTest, LateLargeResultMakesSmallerLeasesPointless) {
  FrameTasks tasks({0, 0, 16, 16}, 64, 16);
  const Task first = *tasks.TakeFresh(AtMost(8)), second = *tasks.TakeFresh(AtMost(8));
  const Task late{0, {0, 32}};
  ASSERT_EQ(tasks.FitOf(late), Fit::kWanted);
  const std::vector<Task> covered = tasks.Accept(late);
  EXPECT_EQ(covered, (std::vector<Task>{first, second}));
  EXPECT_EQ(tasks.TakeFresh(AtMost(64))->block, (SampleBlock{32, 32}));
}

TEST(FrameTasksTest, LateResultInsideALeasedBlockIsDropped) {
  FrameTasks tasks({0, 0, 16, 16}, 64, 16);
  tasks.TakeFresh(AtMost(32));
  EXPECT_EQ(tasks.FitOf({0, {8, 8}}), Fit::kPartial);
}

TEST(FrameTasksTest, LateResultThatIsPartlyDoneIsDropped) {
  FrameTasks tasks({0, 0, 16, 16}, 64, 16);
  tasks.Accept(*tasks.TakeFresh(AtMost(8)));
  EXPECT_EQ(tasks.FitOf({0, {0, 32}}), Fit::kPartial);
  EXPECT_EQ(tasks.FitOf({0, {0, 4}}), Fit::kCovered);
}

TEST(FrameTasksTest, LateResultInsideAReturnedBlockLeavesTheRest) {
  FrameTasks tasks({0, 0, 16, 16}, 64, 16);
  const Task task = *tasks.TakeFresh(AtMost(32));
  tasks.PutBack(task);
  ASSERT_EQ(tasks.FitOf({0, {8, 8}}), Fit::kWanted);
  tasks.Accept({0, {8, 8}});
  EXPECT_EQ(tasks.TakeReturned(Anything, 10), std::nullopt);
  uint64_t rest = 0;
  while (const std::optional<Task> next = tasks.TakeFresh(AtMost(64))) rest += next->block.count;
  EXPECT_EQ(rest, 56u);
}

TEST(FrameTasksTest, WhatIsNoBlockOfTheFrameIsOutside) {
  const FrameTasks tasks(kTwoTiles, 100, 16);
  EXPECT_EQ(tasks.FitOf({7, {0, 16}}), Fit::kOutside);
  EXPECT_EQ(tasks.FitOf({0, {96, 32}}), Fit::kOutside);
  EXPECT_EQ(tasks.FitOf({0, {uint64_t{1} << 63, uint64_t{1} << 63}}), Fit::kOutside);
  EXPECT_EQ(tasks.FitOf({0, {0, 3}}), Fit::kOutside);
  EXPECT_FALSE(tasks.FindTile({0, 0, 16, 15}));
  EXPECT_EQ(tasks.FindTile({16, 0, 32, 16}), 1u);
}

TEST(FrameTasksTest, RevokedBlockIsRenderedAgain) {
  FrameTasks tasks({0, 0, 16, 16}, 16, 16);
  const Task task = *tasks.TakeFresh(AtMost(16));
  tasks.Accept(task);
  ASSERT_TRUE(tasks.Complete());
  tasks.Revoke(task);
  EXPECT_FALSE(tasks.Complete());
  EXPECT_EQ(tasks.TakeFresh(AtMost(16)), task);
}

}  // namespace
}  // namespace sheaf::coordinator
