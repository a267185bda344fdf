// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "common/content/chunk_codec.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace sheaf {
namespace {

TEST(ChunkCodecTest, RoundTrips) {
  for (const std::string& bytes :
       {std::string(), std::string("a"), std::string(1 << 20, 'x'), std::string("\0\1\2", 3)}) {
    const absl::StatusOr<std::string> back = DecompressChunk(CompressChunk(bytes), 1 << 20);
    ASSERT_TRUE(back.ok()) << back.status();
    EXPECT_EQ(*back, bytes);
  }
}

TEST(ChunkCodecTest, RefusesAFrameThatClaimsMoreThanTheLimit) {
  const std::string bomb = CompressChunk(std::string(2 << 20, '\0'));
  EXPECT_LT(bomb.size(), 1000u);
  const absl::StatusOr<std::string> back = DecompressChunk(bomb, 1 << 20);
  EXPECT_EQ(back.status().code(), absl::StatusCode::kInvalidArgument);
  EXPECT_THAT(std::string(back.status().message()), ::testing::HasSubstr("limit"));
}

TEST(ChunkCodecTest, RefusesDamagedAndTruncatedFrames) {
  const std::string frame = CompressChunk("the quick brown fox jumps over the lazy dog");
  for (size_t size = 0; size < frame.size(); ++size) {
    EXPECT_FALSE(DecompressChunk(frame.substr(0, size), 1000).ok()) << size;
  }
  std::string damaged = frame;
  damaged[frame.size() / 2] = static_cast<char>(damaged[frame.size() / 2] ^ 0x10);
  EXPECT_FALSE(DecompressChunk(damaged, 1000).ok());
}

}  // namespace
}  // namespace sheaf
