// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "coordinator/scheduling/pending_frames.h"

#include <set>
#include <vector>

#include "absl/strings/str_cat.h"
#include "common/base/digest.h"
#include "gtest/gtest.h"

namespace sheaf::coordinator {
namespace {

TEST(PendingFramesTest, NumbersAreFoundAcrossWords) {
  NumberSet numbers(10'000);
  for (uint32_t i = 0; i < 10'000; ++i) numbers.Erase(i);
  EXPECT_EQ(numbers.NextFrom(0), 10'000u);
  for (const uint32_t there : {63u, 64u, 4095u, 4096u, 9'999u}) numbers.Insert(there);
  EXPECT_EQ(numbers.NextFrom(0), 63u);
  EXPECT_EQ(numbers.NextFrom(64), 64u);
  EXPECT_EQ(numbers.NextFrom(65), 4095u);
  EXPECT_EQ(numbers.NextFrom(4097), 9'999u);
  EXPECT_EQ(numbers.NextFrom(10'000), 10'000u);
  numbers.Erase(9'999);
  EXPECT_EQ(numbers.NextFrom(4097), 10'000u);
  EXPECT_EQ(NumberSet(0).NextFrom(0), 0u);
}

// Against a plain set: frames leave and come back.
TEST(PendingFramesTest, TheFirstFrameIsThatOfAPlainSet) {
  constexpr uint32_t kFrames = 300, kScenes = 7;
  std::vector<PackedDigest> scenes;
  for (uint32_t i = 0; i < kFrames; ++i) {
    scenes.emplace_back(Sha256Hex(absl::StrCat(i * 31 % kScenes)));
  }
  PendingFrames pending(kFrames, [&](uint32_t i) -> const PackedDigest& { return scenes[i]; });
  std::set<uint32_t> plain;
  for (uint32_t i = 0; i < kFrames; ++i) plain.insert(i);
  uint32_t number = 1;
  for (int step = 0; step < 3000; ++step) {
    number = (number * 1103515245 + 12345) % (1u << 31);
    const uint32_t index = number / 65536 % kFrames;
    // First most leave, then most come back.
    const bool leaves = (number / 7 % 10 < 8) == (step < 1500);
    leaves ? pending.Erase(index) : pending.Insert(index);
    leaves ? static_cast<void>(plain.erase(index)) : static_cast<void>(plain.insert(index));
    ASSERT_EQ(pending.empty(), plain.empty());
    if (!plain.empty()) {
      ASSERT_EQ(pending.First(), *plain.begin());
    }
    std::optional<uint32_t> first;
    for (const uint32_t i : plain) {
      if (!first && scenes[i] == scenes[index]) first = i;
    }
    ASSERT_EQ(pending.FirstOf(scenes[index]), first);
  }
  EXPECT_FALSE(pending.FirstOf(PackedDigest(Sha256Hex("no scene"))));
}

}  // namespace
}  // namespace sheaf::coordinator
