// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "coordinator/scheduling/packed_frame.h"

#include <malloc.h>

#include <random>
#include <set>
#include <vector>

#include "absl/strings/str_cat.h"
#include "common/base/digest.h"
#include "coordinator/scheduling/frames_by_digest.h"
#include "coordinator/scheduling/pending_frames.h"
#include "coordinator/scheduling/scheduler.h"
#include "gtest/gtest.h"

namespace sheaf::coordinator {
namespace {

FrameSpec FrameOf(int32_t number) {
  FrameSpec frame;
  frame.frame_number = number;
  frame.scene = {Sha256Hex(absl::StrCat("scene", number)), 17};
  frame.frame_digest = Sha256Hex(absl::StrCat("frame", number));
  frame.settings.width_px = frame.settings.height_px = 512;
  frame.settings.window = {0, 0, 512, 512};
  frame.settings.outputs.light_groups = {"key", "rim"};
  frame.stop.target_error = 0.01;
  frame.resumed = {Sha256Hex("image"), 5};
  return frame;
}

TEST(PackedFrameTest, RoundTrips) {
  FrameShapes shapes;
  const FrameSpec spec = FrameOf(7);
  const PackedFrame packed(spec, &shapes);
  const FrameSpec back = packed.Unpack();
  EXPECT_EQ(back.frame_number, 7);
  EXPECT_EQ(back.scene, spec.scene);
  EXPECT_EQ(back.frame_digest, spec.frame_digest);
  EXPECT_EQ(back.settings.outputs, spec.settings.outputs);
  EXPECT_EQ(back.settings.window, spec.settings.window);
  EXPECT_EQ(back.stop, spec.stop);
  EXPECT_EQ(back.resumed, spec.resumed);
}

TEST(PackedFrameTest, FramesShareEqualParts) {
  FrameShapes shapes;
  FrameSpec spec = FrameOf(1);
  const PackedFrame first(spec, &shapes);
  const PackedFrame second(FrameOf(2), &shapes);
  EXPECT_EQ(&first.shape(), &second.shape());
  spec.settings.seed = 3;
  EXPECT_EQ(PackedFrame(spec, &shapes).shape().settings.seed, 3u);
  spec.stop.target_error = 0.02;
  EXPECT_EQ(PackedFrame(spec, &shapes).shape().stop.target_error, 0.02);
  EXPECT_EQ(shapes.size(), 3u);
}

TEST(PackedFrameTest, PendingFramesAreSmall) {
  constexpr int32_t kFrames = 50'000;
  JobSpec job;
  job.job_id = 1;
  job.numeric_profile = "profile";
  for (int32_t i = 1; i <= kFrames; ++i) job.frames.push_back(FrameOf(i));
  Scheduler scheduler(Limits(), 1);
  const size_t before = mallinfo2().uordblks + mallinfo2().hblkhd;
  scheduler.AddJob(job);
  const size_t after = mallinfo2().uordblks + mallinfo2().hblkhd;
  RecordProperty("bytes_a_frame", static_cast<int>((after - before) / kFrames));
  EXPECT_LT((after - before) / kFrames, 300u);
}

TEST(PendingFramesTest, FindsFramesByNumberAndScene) {
  constexpr uint32_t kFrames = 300;
  std::vector<PackedDigest> scenes;
  for (uint32_t i = 0; i < kFrames; ++i) {
    scenes.emplace_back(Sha256Hex(absl::StrCat("scene", i % 7)));
  }
  const PackedDigest other(Sha256Hex("another"));
  PendingFrames pending(kFrames, [&](uint32_t i) -> const PackedDigest& { return scenes[i]; });
  std::set<uint32_t> expected;
  for (uint32_t i = 0; i < kFrames; ++i) expected.insert(i);
  std::mt19937 random(3);
  while (true) {
    ASSERT_EQ(pending.empty(), expected.empty());
    EXPECT_EQ(pending.FirstOf(other), std::nullopt);
    for (uint32_t scene = 0; scene < 7; ++scene) {
      std::optional<uint32_t> first;
      for (const uint32_t i : expected) {
        if (i % 7 == scene && !first) first = i;
      }
      ASSERT_EQ(pending.FirstOf(scenes[scene]), first);
    }
    if (expected.empty()) break;
    ASSERT_EQ(pending.First(), *expected.begin());
    const auto gone = static_cast<uint32_t>(random() % kFrames);
    pending.Erase(gone);
    pending.Erase(gone);
    expected.erase(gone);
  }
}

TEST(FramesByDigestTest, FindsAllFramesOfADigest) {
  FramesByDigest frames;
  const PackedDigest a(Sha256Hex("a")), b(Sha256Hex("b"));
  frames.Insert(a, {2, 1});
  frames.Insert(a, {1, 1});
  frames.Insert(a, {3, 1});
  frames.Insert(b, {1, 2});
  EXPECT_EQ(frames.Find(a), (std::vector<FrameId>{{1, 1}, {2, 1}, {3, 1}}));
  frames.Erase(a, {2, 1});
  frames.Erase(a, {9, 9});
  EXPECT_EQ(frames.Find(a), (std::vector<FrameId>{{1, 1}, {3, 1}}));
  frames.Erase(a, {1, 1});
  frames.Erase(a, {3, 1});
  frames.Erase(a, {3, 1});
  EXPECT_TRUE(frames.Find(a).empty());
  EXPECT_EQ(frames.Find(b), (std::vector<FrameId>{{1, 2}}));
}

}  // namespace
}  // namespace sheaf::coordinator
