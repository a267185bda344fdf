// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Chunks keep their limits and give the file back, and their ends stay in place when bytes are
// inserted, removed or changed elsewhere.
#include "common/content/chunk_cutter.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cstdint>
#include <fstream>
#include <random>
#include <set>
#include <string>
#include <vector>

#include "common/base/digest.h"

namespace sheaf {
namespace {

std::string RandomBytes(size_t size, uint64_t seed) {
  std::mt19937_64 random(seed);
  std::string bytes(size, '\0');
  for (char& byte : bytes) byte = static_cast<char>(random());
  return bytes;
}

std::vector<std::string_view> Cut(std::string_view bytes) {
  std::vector<std::string_view> chunks;
  while (!bytes.empty()) {
    chunks.push_back(bytes.substr(0, ChunkLength(bytes)));
    bytes.remove_prefix(chunks.back().size());
  }
  return chunks;
}

// Bytes of the chunks that `before` does not have.
size_t NewBytes(const std::string& before, const std::string& after) {
  std::set<std::string_view> old;
  const std::vector<std::string_view> chunks = Cut(before);
  old.insert(chunks.begin(), chunks.end());
  size_t bytes = 0;
  for (const std::string_view chunk : Cut(after)) bytes += old.contains(chunk) ? 0 : chunk.size();
  return bytes;
}

TEST(ChunkCutterTest, LengthsKeepTheirLimitsAndGatherAroundTheAverage) {
  const std::string bytes = RandomBytes(64 << 20, 1);
  const std::vector<std::string_view> chunks = Cut(bytes);
  for (size_t i = 0; i + 1 < chunks.size(); ++i) {
    EXPECT_GE(chunks[i].size(), kChunkBytesMin);
    EXPECT_LE(chunks[i].size(), kChunkBytesMax);
  }
  EXPECT_GT(chunks.size(), 64U * 2 / 3);
  EXPECT_LT(chunks.size(), 64U * 3 / 2);
  // Bytes that never end a chunk.
  EXPECT_EQ(ChunkLength(std::string(2 * kChunkBytesMax, 'a')), kChunkBytesMax);
  EXPECT_EQ(ChunkLength("short"), 5U);
  EXPECT_EQ(ChunkLength(""), 0U);
}

TEST(ChunkCutterTest, InsertedRemovedAndChangedBytesChangeOnlyTheChunksAroundThem) {
  const std::string before = RandomBytes(48 << 20, 2);
  std::mt19937_64 random(3);
  // The chunk that is hit, and those until the ends are the same again.
  constexpr size_t kChangedMax = 3 * size_t{kChunkBytesMax};
  for (int round = 0; round < 6; ++round) {
    const size_t at = random() % before.size();
    const size_t count = 1 + random() % 100'000;
    std::string after = before;
    if (round % 3 == 0) after.insert(at, RandomBytes(count, random()));
    if (round % 3 == 1) after.erase(at, count);
    if (round % 3 == 2) after[at] = static_cast<char>(after[at] + 1);
    EXPECT_LE(NewBytes(before, after), kChangedMax) << "round " << round << " at " << at;
  }
}

TEST(ChunkCutterTest, AFileIsCutAsItsBytesAre) {
  const std::string path = ::testing::TempDir() + "/chunk_cutter_file";
  const std::string bytes = RandomBytes((21 << 20) + 17, 4);
  std::ofstream(path, std::ios::binary) << bytes;
  const absl::StatusOr<ChunkList> list = CutFile(path);
  ASSERT_TRUE(list.ok()) << list.status();
  EXPECT_EQ(list->blob, (BlobDigest{Sha256Hex(bytes), bytes.size()}));
  EXPECT_TRUE(CheckChunkList(*list).ok());
  std::vector<BlobDigest> expected;
  for (const std::string_view chunk : Cut(bytes)) {
    expected.push_back({Sha256Hex(chunk), chunk.size()});
  }
  EXPECT_EQ(list->chunks, expected);
  // The cuts are part of the format: other ones would make every stored list useless.
  EXPECT_EQ(ChunkLength(RandomBytes(8 << 20, 5)), Cut(RandomBytes(8 << 20, 5))[0].size());
  const absl::StatusOr<ChunkList> again = DecodeChunkList(EncodeChunkList(*list));
  ASSERT_TRUE(again.ok()) << again.status();
  EXPECT_EQ(*again, *list);
}

TEST(ChunkCutterTest, ListsThatCannotBeTheirBlobsAreRefused) {
  const std::string hex = Sha256Hex("x");
  const ChunkList good{{hex, kChunkBytesMin + 1}, {{hex, kChunkBytesMin}, {hex, 1}}};
  EXPECT_TRUE(CheckChunkList(good).ok());
  ChunkList bad = good;
  bad.blob.size_bytes = 1;
  EXPECT_FALSE(CheckChunkList(bad).ok());
  bad = good;
  std::swap(bad.chunks[0], bad.chunks[1]);  // A short chunk that is not the last.
  EXPECT_FALSE(CheckChunkList(bad).ok());
  bad = {{hex, uint64_t{kChunkBytesMax} + 1}, {{hex, uint64_t{kChunkBytesMax} + 1}}};
  EXPECT_FALSE(CheckChunkList(bad).ok());
  bad = good;
  bad.chunks[1].sha256_hex = "../../etc";
  EXPECT_FALSE(CheckChunkList(bad).ok());
  EXPECT_FALSE(DecodeChunkList("").ok());
  EXPECT_FALSE(DecodeChunkList(hex).ok());
}

}  // namespace
}  // namespace sheaf
