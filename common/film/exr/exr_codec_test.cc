// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "common/film/exr/exr_codec.h"

#include <gtest/gtest.h>
#include <unistd.h>

#include <cmath>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <limits>
#include <random>

#include "common/base/file.h"
#include "common/film/film_test_samples.h"
#include "common/film/light/light_pass_accumulator.h"

namespace sheaf {
namespace {

const PartHeader kHeader{std::string(64, 'a'), "x86-64-v3 g++-12"};

std::string MakePart(SampleBlock block, PixelRect rect = {16, 32, 24, 40}) {
  return EncodePart(MakeTestTile(rect, block), kHeader);
}

TEST(ExrCodecTest, PartsRoundTripExactly) {
  const uint64_t far = uint64_t{1} << 40;
  for (const SampleBlock block : {SampleBlock{0, 1}, {12, 4}, {16, 16}, {64, 64}, {far, 8}}) {
    for (const PixelRect rect :
         {PixelRect{0, 0, 1, 1}, {-3, -5, 20, 14}, {4000, 70000, 4033, 70001}}) {
      const FilmTile tile = MakeTestTile(rect, block);
      const std::string bytes = EncodePart(tile, kHeader);
      EXPECT_EQ(EncodePart(tile, kHeader), bytes);
      const absl::StatusOr<DecodedPart> part = DecodePart(bytes);
      ASSERT_TRUE(part.ok()) << part.status();
      EXPECT_TRUE(SameBits(part->tile, tile));
      EXPECT_EQ(part->header.frame_digest, kHeader.frame_digest);
      EXPECT_EQ(part->header.numeric_profile, kHeader.numeric_profile);
    }
  }
}

TEST(ExrCodecTest, PartsHaveStandardColorChannels) {
  const FilmTile tile = MakeTestTile({0, 0, 8, 8}, {0, 16});
  const absl::StatusOr<FrameImage> image = DecodeFrameImage(EncodePart(tile, kHeader));
  ASSERT_TRUE(image.ok()) << image.status();
  EXPECT_EQ(image->Find("G")->at(9), tile.channel(FilmChannel::kGreenHi)[9]);
  EXPECT_EQ(image->metadata.at("blockCount"), "16");
}

TEST(ExrCodecTest, EveryTruncationIsAnError) {
  const std::string bytes = MakePart({0, 4});
  for (size_t size = 0; size < bytes.size(); size += 1 + size / 40) {
    const absl::StatusOr<DecodedPart> part = DecodePart(std::string_view(bytes).substr(0, size));
    ASSERT_FALSE(part.ok()) << size;
    EXPECT_TRUE(absl::IsDataLoss(part.status()) || absl::IsInvalidArgument(part.status()))
        << part.status();
  }
}

TEST(ExrCodecTest, DamagedPartsNeverCrash) {
  const std::string bytes = MakePart({0, 4});
  std::mt19937 bits(17);
  for (int i = 0; i < 3000; ++i) {
    std::string damaged = bytes;
    // Half of the damage is in the header, which holds the sizes.
    const size_t range = i & 1 ? bytes.size() : 1800;
    for (int flips = 1 + i % 4; flips > 0; --flips)
      damaged[bits() % range] = static_cast<char>(bits());
    const absl::StatusOr<DecodedPart> part = DecodePart(damaged);
    if (part.ok()) {
      EXPECT_TRUE(IsAligned(part->tile.block()));
    }
  }
}

// Replaces the one occurrence of `from` in the header.
std::string Replaced(std::string bytes, const std::string& from, const std::string& to) {
  const size_t at = bytes.find(from);
  EXPECT_NE(at, std::string::npos);
  return bytes.replace(at, from.size(), to);
}
std::string BoxBytes(int32_t x0, int32_t y0, int32_t x1, int32_t y1) {
  const int32_t box[4] = {x0, y0, x1, y1};
  return std::string(reinterpret_cast<const char*>(box), sizeof box);
}
void ExpectRefused(const std::string& bytes, const std::string& why) {
  const absl::StatusOr<DecodedPart> part = DecodePart(bytes);
  ASSERT_FALSE(part.ok());
  EXPECT_NE(std::string(part.status().message()).find(why), std::string::npos) << part.status();
}

TEST(ExrCodecTest, FalseHeadersAreRefusedBeforeAllocation) {
  const std::string bytes = MakePart({64, 4});
  const auto window = [](const std::string& name, int32_t x1, int32_t y1) {
    return name + std::string("Window\0box2i\0\x10\0\0\0", 17) + BoxBytes(16, 32, x1, y1);
  };
  const auto with_windows = [&](int32_t x1, int32_t y1) {
    std::string changed = bytes;
    for (const char* name : {"data", "display"}) {
      changed = Replaced(changed, window(name, 23, 39), window(name, x1, y1));
    }
    return changed;
  };
  ExpectRefused(with_windows(0x3fffffff, 0x3fffffff), "pixels");
  ExpectRefused(with_windows(0x7fffffff, 39), "out of bounds");
  ExpectRefused(with_windows(0, 0), "empty");
  ExpectRefused(with_windows(2015, 2031), "too short");
  ExpectRefused(with_windows(24, 39), "damaged");
  ExpectRefused(with_windows(22, 39), "damaged");
  for (const char* name : {"data", "display"}) {
    const std::string good = window(name, 23, 39);
    ExpectRefused(Replaced(bytes, good, window(name, 22, 39)), "other pixels");
    ExpectRefused(Replaced(bytes, good, window(name, 24, 39)), "other pixels");
  }
  ExpectRefused(Replaced(bytes, "film-part 1", "film-part 9"), "format");
  ExpectRefused(Replaced(bytes, "albedo.R", "albedo.Q"), "wrong channels");
  ExpectRefused(Replaced(bytes,
                         std::string("blockFirst\0string\0\2\0\0\0"
                                     "64",
                                     24),
                         std::string("blockFirst\0string\0\2\0\0\0"
                                     "65",
                                     24)),
                "aligned");
  ExpectRefused(Replaced(bytes,
                         std::string("blockFirst\0string\0\2\0\0\0"
                                     "64",
                                     24),
                         std::string("blockFirst\0string\0\2\0\0\0"
                                     "68",
                                     24)),
                "wrong channels");  // Replicates that do not match its samples.
  ExpectRefused("not an EXR at all", "magic");
  ExpectRefused("", "magic");
}

TEST(ExrCodecTest, ImpossibleSumsAreRefused) {
  FilmTile tile = MakeTestTile({0, 0, 2, 2}, {0, 16});
  FilmTile bad = tile;
  bad.channel(FilmChannel::kNormalX)[3] = std::numeric_limits<float>::quiet_NaN();
  ExpectRefused(EncodePart(bad, kHeader), "not finite");
  bad = tile;
  bad.replicate(7, 2)[0] = std::numeric_limits<float>::infinity();
  ExpectRefused(EncodePart(bad, kHeader), "not finite");
  bad = tile;
  bad.channel(FilmChannel::kSampleCount)[1] = 17;
  ExpectRefused(EncodePart(bad, kHeader), "sample counts");
  bad.channel(FilmChannel::kSampleCount)[1] = 15.5F;
  bad.channel(FilmChannel::kNonFiniteCount)[1] = 0.5F;
  ExpectRefused(EncodePart(bad, kHeader), "sample counts");
}

// Two pixels of 16 samples each, through a filter without negative weights.
FilmTile BoxFilteredTile() {
  FilmTile tile({0, 0, 2, 1}, {0, 16});
  for (size_t p = 0; p < 2; ++p) {
    tile.channel(FilmChannel::kSampleCount)[p] = tile.channel(FilmChannel::kWeight)[p] = 16;
  }
  return tile;
}

TEST(ExrCodecTest, ImpossibleRadianceSumsAreRefused) {
  const FilmTile tile = BoxFilteredTile();
  ASSERT_TRUE(DecodePart(EncodePart(tile, kHeader)).ok());
  FilmTile bad = tile;
  bad.channel(FilmChannel::kGreenHi)[1] = -1e30F;
  ExpectRefused(EncodePart(bad, kHeader), "negative light");
  bad = tile;
  bad.channel(FilmChannel::kBlueLo)[0] = -1;
  ExpectRefused(EncodePart(bad, kHeader), "negative light");
  bad = tile;
  bad.replicate(3, 0)[1] = -2;
  ExpectRefused(EncodePart(bad, kHeader), "negative light");
  bad = tile;
  bad.channel(FilmChannel::kRedHi)[0] = 17 * kSampleMagnitudeMax;
  ExpectRefused(EncodePart(bad, kHeader), "more than 16 samples");
  bad.channel(FilmChannel::kRedHi)[0] = 16 * kSampleMagnitudeMax;
  EXPECT_TRUE(DecodePart(EncodePart(bad, kHeader)).ok());
}

// Colors beyond sRGB have negative components, and filters with negative lobes have negative sums.
TEST(ExrCodecTest, PossibleNegativeSumsAreAccepted) {
  FilmTile tile = BoxFilteredTile();
  // 16 samples of light of 505 nm.
  tile.channel(FilmChannel::kRedHi)[0] = -9.6F;
  tile.channel(FilmChannel::kGreenHi)[0] = 12.8F;
  tile.channel(FilmChannel::kBlueHi)[0] = 3.2F;
  EXPECT_TRUE(DecodePart(EncodePart(tile, kHeader)).ok());
  tile.channel(FilmChannel::kWeight)[1] = 13.5F;
  tile.channel(FilmChannel::kRedHi)[1] = -100;
  EXPECT_TRUE(DecodePart(EncodePart(tile, kHeader)).ok());
}

TEST(ExrCodecTest, LatticePartsHoldOnlyTheirPixels) {
  const PartHeader header{"digest", "profile", {6, 3}};
  FilmTile tile({8, 8, 16, 16}, {0, 16});
  for (int32_t y = 8; y < 16; ++y) {
    for (int32_t x = 8; x < 16; ++x) {
      const SampleBlock samples = header.lattice.SamplesOf(header.lattice.PartOf(x, y), {0, 16});
      tile.channel(FilmChannel::kSampleCount)[(y - 8) * 8 + x - 8] =
          static_cast<float>(samples.count);
    }
  }
  const absl::StatusOr<DecodedPart> part = DecodePart(EncodePart(tile, header));
  ASSERT_TRUE(part.ok()) << part.status();
  EXPECT_EQ(part->header.lattice, header.lattice);
  ExpectRefused(EncodePart(tile, {"digest", "profile"}), "sample counts");
  ExpectRefused(EncodePart(tile, {"digest", "profile", {7, 3}}), "sample counts");
  ExpectRefused(EncodePart(tile, {"digest", "profile", {6, 4}}), "sample counts");
  ExpectRefused(EncodePart(tile, {"digest", "profile", {1000}}), "pixel stride");
}

FilmTile LightTile(SampleBlock block) {
  FilmTile tile({8, 8, 24, 16}, block);
  LightPassAccumulator film(&tile);
  for (uint64_t pass = block.first; pass < block.End(); ++pass) {
    film.Add(9, 10, {HashToUnit(pass), 0.5F, -0.1F}, -1, std::nullopt);
    film.Add(10, 10, {1, std::nanf(""), 1}, 1, std::nullopt);
    film.EndPass();
  }
  film.Finish();
  return tile;
}

TEST(ExrCodecTest, LightPartsRoundTrip) {
  const PartHeader header{"digest", "profile", {}, {}, TaskKind::kLight};
  for (const SampleBlock block : {SampleBlock{3, 1}, SampleBlock{16, 16}}) {
    const FilmTile tile = LightTile(block);
    const std::string bytes = EncodePart(tile, header);
    const absl::StatusOr<DecodedPart> part = DecodePart(bytes);
    ASSERT_TRUE(part.ok()) << part.status();
    EXPECT_EQ(part->header.kind, TaskKind::kLight);
    EXPECT_TRUE(SameBits(part->tile, tile));
    EXPECT_LT(bytes.size(), tile.size_bytes() / 2) << "empty planes take no room";
  }
}

TEST(ExrCodecTest, FalseLightPartsAreRefused) {
  const PartHeader header{"digest", "profile", {}, {}, TaskKind::kLight};
  const FilmTile tile = LightTile({0, 4});
  ExpectRefused(EncodePart(tile, {"digest", "profile"}), "sample counts");  // Too many not finite.
  ExpectRefused(EncodePart(tile, {"d", "p", {6, 3}, {}, TaskKind::kLight}), "all pixels");
  const auto with = [&](FilmChannel channel, float value) {
    FilmTile changed = tile;
    changed.channel(channel)[5] = value;
    return EncodePart(changed, header);
  };
  ExpectRefused(with(FilmChannel::kSampleCount, 3), "counts of light passes");
  ExpectRefused(with(FilmChannel::kWeight, 5), "counts of light passes");
  ExpectRefused(with(FilmChannel::kNonFiniteCount, -1), "counts of light passes");
  ExpectRefused(with(FilmChannel::kNonFiniteCount, 0.5F), "counts of light passes");
  ExpectRefused(with(FilmChannel::kAlpha, 1), "surfaces");
  ExpectRefused(with(FilmChannel::kDepth, 1), "surfaces");
  ExpectRefused(with(FilmChannel::kRedHi, 5e30F), "more than 4 samples");
  ExpectRefused(with(FilmChannel::kRedHi, std::nanf("")), "not finite");
}

TEST(ExrCodecTest, CellPartsHoldOnlyTheirPixels) {
  const PartHeader header{"digest", "profile", {}, {4, 0b1001}};
  FilmTile tile({8, 8, 16, 16}, {0, 16});
  for (const PixelRect& cell : RectsOf(tile.rect(), header.cells)) {
    Paste(MakeTestTile(cell, tile.block()), &tile);
  }
  const absl::StatusOr<DecodedPart> part = DecodePart(EncodePart(tile, header));
  ASSERT_TRUE(part.ok()) << part.status();
  EXPECT_EQ(part->header.cells, header.cells);
  EXPECT_TRUE(SameBits(part->tile, tile));
  const std::string bytes = EncodePart(tile, header);
  const size_t whole = EncodePart(MakeTestTile(tile.rect(), tile.block()), {"d", "p"}).size();
  EXPECT_LT(bytes.size(), 0.7 * static_cast<double>(whole)) << "other cells take no room";
  ExpectRefused(EncodePart(tile, {"digest", "profile"}), "sample counts");
  ExpectRefused(EncodePart(tile, {"digest", "profile", {}, {4, 0b1011}}), "sample counts");
  const auto cells_of = [](const std::string& mask) {
    return std::string("sheaf:cells\0string\0\1\0\0\0", 23) + mask;
  };
  const auto cell_size = [](const std::string& size_px) {
    return std::string("sheaf:cellSizePx\0string\0\1\0\0\0", 28) + size_px;
  };
  ExpectRefused(Replaced(bytes, cells_of("9"), cells_of("0")), "cells");
  ExpectRefused(Replaced(bytes, cells_of("9"), cells_of("2")), "other pixels");
  ExpectRefused(Replaced(bytes, cells_of("9"), cells_of("7")), "other pixels");
  // The same number of other cells: a valid part of those, which the receiver rejects by its
  // header.
  const auto others = DecodePart(Replaced(bytes, cells_of("9"), cells_of("6")));
  ASSERT_TRUE(others.ok()) << others.status();
  EXPECT_EQ(others->header.cells, (TileCells{4, 6}));
  ExpectRefused(Replaced(bytes, cell_size("4"), cell_size("0")), "cells");
  ExpectRefused(Replaced(bytes, cell_size("4"), cell_size("5")), "other pixels");
  ExpectRefused(Replaced(bytes, cell_size("4"), cell_size("8")), "cells");
  ExpectRefused(EncodePart(FilmTile({8, 8, 16, 16}, {0, 16}), {"d", "p", {6, 3}, {4, 0b1001}}),
                "lattice");
}

// The last tile of a frame: cells of 4 and of 2 columns, 4 and 3 rows.
TEST(ExrCodecTest, BorderCellsAreSmaller) {
  const PixelRect rect{8, 8, 14, 15};
  for (const uint64_t mask : {0b0111, 0b1010, 0b1100, 0b1000}) {
    const PartHeader header{"digest", "profile", {}, {4, mask}};
    FilmTile tile(rect, {0, 16});
    for (const PixelRect& cell : RectsOf(rect, header.cells)) {
      Paste(MakeTestTile(cell, tile.block()), &tile);
    }
    const absl::StatusOr<DecodedPart> part = DecodePart(EncodePart(tile, header));
    ASSERT_TRUE(part.ok()) << part.status();
    EXPECT_TRUE(SameBits(part->tile, tile)) << mask;
  }
}

TEST(ExrCodecTest, PartsBeyondTheLimitAreRefused) {
  EXPECT_TRUE(DecodePart(MakePart({0, 1}), 64).ok());
  EXPECT_TRUE(absl::IsInvalidArgument(DecodePart(MakePart({0, 1}), 63).status()));
}

class ExrCodecFileTest : public ::testing::Test {
 protected:
  void SetUp() override {
    std::string pattern = ::testing::TempDir() + "sheaf-exr-XXXXXX";
    ASSERT_NE(::mkdtemp(pattern.data()), nullptr);
    directory_ = pattern;
  }
  void TearDown() override { std::filesystem::remove_all(directory_); }
  std::string directory_;
};

TEST_F(ExrCodecFileTest, ImagesRoundTripExactly) {
  FrameImage image = MakeFrameImage({100, 50, 117, 61}, 640, 480);
  std::mt19937 bits(23);
  std::normal_distribution<float> value(0, 1000);
  for (auto& plane : image.planes) {
    for (float& v : plane) v = value(bits);
  }
  image.metadata = {{"sceneDigest", std::string(64, 'c')}, {"samples", "64"}, {"note", ""}};
  const std::string path = directory_ + "/an image.exr";
  ASSERT_TRUE(WriteFrameImage(image, path).ok());
  const absl::StatusOr<FrameImage> read = ReadFrameImage(path);
  ASSERT_TRUE(read.ok()) << read.status();
  EXPECT_EQ(read->window, image.window);
  EXPECT_EQ(read->frame_width_px, 640);
  EXPECT_EQ(read->frame_height_px, 480);
  EXPECT_EQ(read->metadata, image.metadata);
  ASSERT_EQ(read->channel_names.size(), image.channel_names.size());
  for (size_t i = 0; i < image.planes.size(); ++i) {
    ASSERT_NE(read->Find(image.channel_names[i]), nullptr);
    EXPECT_EQ(*read->Find(image.channel_names[i]), image.planes[i]);
  }
  EXPECT_EQ(EncodeFrameImage(image), *ReadWholeFile(path));
}

TEST_F(ExrCodecFileTest, FindsColorInALayer) {
  FrameImage image;
  image.window = {0, 0, 2, 1};
  image.channel_names = {"alpha.R", "beauty.B", "beauty.G", "beauty.R"};
  image.planes = {{9, 9}, {3, 30}, {2, 20}, {1, 10}};
  const absl::StatusOr<FrameImage> read = DecodeFrameImage(EncodeFrameImage(image));
  ASSERT_TRUE(read.ok()) << read.status();
  EXPECT_EQ(*read->Find("R"), (std::vector<float>{1, 10}));
  EXPECT_EQ(*read->Find("B"), (std::vector<float>{3, 30}));
  EXPECT_EQ(read->frame_width_px, 2);
}

TEST_F(ExrCodecFileTest, ErrorsNameTheFile) {
  EXPECT_TRUE(absl::IsNotFound(ReadFrameImage(directory_ + "/none.exr").status()));
  const std::string path = directory_ + "/text.exr";
  ASSERT_TRUE(WriteFileAtomically(path, "hello").ok());
  const absl::Status status = ReadFrameImage(path).status();
  EXPECT_TRUE(absl::IsInvalidArgument(status));
  EXPECT_NE(std::string(status.message()).find(path), std::string::npos);
  EXPECT_FALSE(
      WriteFrameImage(MakeFrameImage({0, 0, 1, 1}, 1, 1), directory_ + "/no/such/dir.exr").ok());
}

TEST(ExrCodecTest, ImagesBeyondTheCallersLimitAreRefused) {
  const std::string bytes = EncodeFrameImage(MakeFrameImage({0, 0, 64, 64}, 64, 64));
  EXPECT_TRUE(DecodeFrameImage(bytes).ok());
  EXPECT_TRUE(absl::IsResourceExhausted(DecodeFrameImage(bytes, 64 * 64).status()));
}

TEST(ExrCodecTest, ImagesWithoutColorAreRefused) {
  FrameImage image;
  image.window = {0, 0, 1, 1};
  image.channel_names = {"Y", "a.R"};
  image.planes = {{1}, {2}};
  EXPECT_TRUE(absl::IsInvalidArgument(DecodeFrameImage(EncodeFrameImage(image)).status()));
}

}  // namespace
}  // namespace sheaf
