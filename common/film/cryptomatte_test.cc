// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "common/film/cryptomatte.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <random>

#include "absl/strings/str_cat.h"
#include "common/film/exr/exr_codec.h"
#include "common/film/film.h"
#include "common/film/film_test_samples.h"
#include "common/math/double_float.h"

namespace sheaf {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::SizeIs;

constexpr PixelRect kMatteRect{0, 0, 5, 3};
constexpr PixelRect kMatteOfOnePixel{0, 0, 1, 1};

FilmOutputs ObjectsAndAssets() {
  FilmOutputs outputs;
  outputs.AddIdNumber(IdKind::kObject);
  outputs.AddCryptomatte(IdKind::kObject);
  outputs.AddCryptomatte(IdKind::kAsset);
  return outputs;
}

// A few ids are frequent and many are rare; a sample that hits nothing has none.
OutputSample TestIds(const FilmOutputs& outputs, int32_t x, int32_t y, uint64_t n, float alpha,
                     uint32_t id_count) {
  OutputSample sample(outputs);
  if (alpha == 0) return sample;
  const float u = HashToUnit(n * 977 + static_cast<uint64_t>(x * 31 + y));
  sample.ids[0] = 1 + static_cast<uint32_t>(u * u * u * static_cast<float>(id_count));
  sample.ids[2] = 1 + sample.ids[0] % 3;
  return sample;
}

FilmTile MakeMatteTile(PixelRect rect, SampleBlock block, uint32_t id_count) {
  const FilmOutputs outputs = ObjectsAndAssets();
  FilmTile tile(rect, block, outputs);
  PixelAccumulator accumulator(&tile);
  for (int32_t y = rect.y0; y < rect.y1; ++y) {
    for (int32_t x = rect.x0; x < rect.x1; ++x) {
      accumulator.Begin(x, y);
      for (uint64_t n = block.first; n < block.End(); ++n) {
        const FilmSample sample = MakeTestSample(x, y, n);
        accumulator.Add(n, sample, TestIds(outputs, x, y, n, sample.alpha, id_count));
      }
      accumulator.End();
    }
  }
  for (const IdKind kind : {IdKind::kObject, IdKind::kAsset}) {
    for (const IdList& list : tile.ids(kind).pixels) {
      for (const IdWeight& entry : list) {
        if (entry.id != kNoId) {
          tile.ids(kind).names[entry.id] = absl::StrCat(IdKindName(kind), " \"", entry.id, "\"\n");
        }
      }
    }
  }
  return tile;
}

void CutBlockAtRandom(SampleBlock block, std::mt19937* random, std::vector<SampleBlock>* blocks) {
  if (block.count == 1 || (*random)() % 3 == 0) return blocks->push_back(block);
  CutBlockAtRandom({block.first, block.count / 2}, random, blocks);
  CutBlockAtRandom({block.first + block.count / 2, block.count / 2}, random, blocks);
}

FilmTile Merge(std::vector<SampleBlock> blocks, uint32_t id_count, bool through_bytes) {
  TileTree tree(kMatteRect);
  for (const SampleBlock& block : blocks) {
    FilmTile tile = MakeMatteTile(kMatteRect, block, id_count);
    if (through_bytes) {
      absl::StatusOr<DecodedPart> part = DecodePart(EncodePart(tile, {"digest", "profile"}));
      EXPECT_TRUE(part.ok()) << part.status();
      EXPECT_EQ(part->tile, tile);
      tile = std::move(part->tile);
    }
    EXPECT_TRUE(tree.Insert(std::move(tile)).ok());
  }
  return tree.Root();
}

FrameImage DevelopMattes(const FilmTile& tile) {
  FrameImage image = MakeFrameImage(tile.rect(), tile.rect().x1, tile.rect().y1, tile.outputs());
  DevelopTile(tile, &image);
  NoteNames(tile, &image);
  image.attributes = CryptomatteAttributes(image);
  return image;
}

// 12 ids fit in a pixel's list. 3000 do not, and then the dropped ids must not depend on the
// partition either.
TEST(CryptomatteTest, AnyPartitionGivesTheSameBits) {
  std::mt19937 random(3);
  for (const uint32_t id_count : {12u, 3000u}) {
    for (const uint64_t count : {21u, 1024u}) {
      const std::vector<SampleBlock> whole_blocks = CutSamples(0, count, uint64_t{1} << 40);
      const FilmTile whole = Merge(whole_blocks, id_count, false);
      const FrameImage expected = DevelopMattes(whole);
      for (int i = 0; i < 3; ++i) {
        std::vector<SampleBlock> blocks;
        for (const SampleBlock& block : whole_blocks) CutBlockAtRandom(block, &random, &blocks);
        std::shuffle(blocks.begin(), blocks.end(), random);
        const FilmTile merged = Merge(blocks, id_count, blocks.size() < 100);
        EXPECT_EQ(merged.ids(IdKind::kObject).pixels, whole.ids(IdKind::kObject).pixels);
        const FrameImage image = DevelopMattes(merged);
        EXPECT_EQ(ImageDigest(image), ImageDigest(expected));
        EXPECT_EQ(image.attributes, expected.attributes);
      }
    }
  }
}

TEST(CryptomatteTest, FullListsLoseNoWeight) {
  const FilmTile tile = MakeMatteTile(kMatteRect, {0, 1024}, 3000);
  for (size_t p = 0; p < tile.plane_size(); ++p) {
    const IdList& list = tile.ids(IdKind::kObject).pixels[p];
    EXPECT_THAT(list, SizeIs(kIdsPerPixelMax + 1));
    EXPECT_EQ(list[0].id, kNoId);
    double sum = 0;
    for (const IdWeight& entry : list) sum += entry.weight;
    // At a surface alpha is 1, so the ids' weights add up to the sum of alpha, which is a sum of
    // floats.
    EXPECT_NEAR(sum, static_cast<double>(tile.channel(FilmChannel::kAlpha)[p]), 1e-3);
  }
  const FrameImage image = DevelopMattes(tile);
  EXPECT_GT((*image.Find("rest.CryptoObject"))[0], 0.5f);
  EXPECT_EQ((*image.Find("rest.CryptoAsset"))[0], 0.0f);
}

// Values of the reference implementation and of its specification's rule for floats.
TEST(CryptomatteTest, HashIsMurmurHash3) {
  EXPECT_EQ(MurmurHash3(""), 0u);
  EXPECT_EQ(MurmurHash3("a"), 0x3c2569b2u);
  EXPECT_EQ(MurmurHash3("aaaa"), 0x7eeed987u);
  EXPECT_EQ(MurmurHash3("hello"), 0x248bfa47u);
  EXPECT_EQ(MurmurHash3("hello, world"), 0x149bbb7fu);
  EXPECT_EQ(MurmurHash3("The quick brown fox jumps over the lazy dog"), 0x2e4ff723u);
  EXPECT_EQ(CryptomatteIdBits("hello"), 0x248bfa47u);
  EXPECT_EQ(CryptomatteIdBits(""), 0x00800000u);
  for (int i = 0; i < 100'000; ++i) {
    const float id = std::bit_cast<float>(CryptomatteIdBits(absl::StrCat("object ", i)));
    ASSERT_TRUE(std::isnormal(id)) << i;
  }
}

TEST(CryptomatteTest, RanksByCoverage) {
  const std::map<uint32_t, std::string> names = {{1, "a"}, {2, "b"}, {3, "c"}, {4, "a"}};
  const auto values = RankIds({{kNoId, 1}, {1, 1}, {2, 4}, {3, -1}, {4, 2}}, names, 8);
  const auto id = [](const char* name) { return std::bit_cast<float>(CryptomatteIdBits(name)); };
  // Both ids named "a" form one matte; coverage not above 0 gets no rank.
  EXPECT_THAT(std::vector<float>(values.begin(), values.begin() + 6),
              ElementsAre(id("b"), 0.5f, id("a"), 0.375f, 0, 0));
  EXPECT_EQ(values.back(), 0.0f);
  EXPECT_EQ(LeadingId({{kNoId, 9}, {1, 1}, {2, 4}, {3, 4}}), 2u);
  EXPECT_EQ(LeadingId({}), kNoId);
  EXPECT_THAT(RankIds({{1, 1}}, names, 0), ::testing::Each(0.0f));
}

TEST(CryptomatteTest, ExcessIdsAreReported) {
  std::map<uint32_t, std::string> names;
  IdList list;
  for (uint32_t id = 1; id <= 10; ++id) {
    names[id] = absl::StrCat("n", id);
    list.push_back({id, static_cast<double>(id)});
  }
  const auto values = RankIds(list, names, 55);
  EXPECT_EQ(values[0], std::bit_cast<float>(CryptomatteIdBits("n10")));
  EXPECT_EQ(values[11], static_cast<float>(5.0 / 55));
  EXPECT_FLOAT_EQ(values.back(), static_cast<float>(10.0 / 55));
}

TEST(CryptomatteTest, ManifestListsVisibleNames) {
  FilmOutputs outputs;
  outputs.AddCryptomatte(IdKind::kMaterial);
  FilmTile tile(kMatteOfOnePixel, {0, 1}, outputs);
  tile.ids(IdKind::kMaterial).pixels[0] = {{7, 1}};
  tile.ids(IdKind::kMaterial).names = {{7, "say \"hi\"\\\n"}, {8, "given up"}};
  const absl::StatusOr<FrameImage> image = DecodeFrameImage(EncodeFrameImage(DevelopMattes(tile)));
  ASSERT_TRUE(image.ok()) << image.status();
  ASSERT_THAT(image->attributes, SizeIs(4));
  const std::string key = image->attributes.begin()->first.substr(0, 20);
  EXPECT_THAT(key, HasSubstr("cryptomatte/"));
  EXPECT_EQ(image->attributes.at(key + "name"), "CryptoMaterial");
  EXPECT_EQ(image->attributes.at(key + "hash"), "MurmurHash3_32");
  EXPECT_EQ(image->attributes.at(key + "conversion"), "uint32_to_float32");
  EXPECT_THAT(image->attributes.at(key + "manifest"),
              ::testing::StartsWith("{\"say \\\"hi\\\"\\\\\\u000a\":\""));
  EXPECT_EQ(image->attributes.at(key + "manifest").find("given up"), std::string::npos);
  EXPECT_NE(image->Find("CryptoMaterial02.A"), nullptr);
}

TEST(CryptomatteTest, DamagedListsAreRefused) {
  FilmOutputs outputs;
  outputs.AddCryptomatte(IdKind::kObject);
  const auto decode = [&outputs](const IdList& list, const std::map<uint32_t, std::string>& names) {
    FilmTile tile(kMatteOfOnePixel, {0, 1}, outputs);
    tile.channel(FilmChannel::kSampleCount)[0] = 1;
    tile.ids(IdKind::kObject).pixels[0] = list;
    tile.ids(IdKind::kObject).names = names;
    return DecodePart(EncodePart(tile, {})).status();
  };
  EXPECT_TRUE(decode({{1, 1}, {2, 1}}, {{1, "a"}, {2, "b"}}).ok());
  EXPECT_FALSE(decode({{2, 1}, {1, 1}}, {{1, "a"}, {2, "b"}}).ok());
  EXPECT_FALSE(decode({{1, 1}, {1, 1}}, {{1, "a"}}).ok());
  EXPECT_FALSE(decode({{1, 1}, {2, 1}}, {{1, "a"}}).ok());
  EXPECT_FALSE(decode({{1, std::nan("")}}, {{1, "a"}}).ok());
  IdList long_list;
  std::map<uint32_t, std::string> names;
  for (uint32_t id = 1; id <= kIdsPerPixelMax + 2; ++id) {
    long_list.push_back({id, 1});
    names[id] = "x";
  }
  EXPECT_FALSE(decode(long_list, names).ok());
}

}  // namespace
}  // namespace sheaf
