// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Page files give the bits of the grids that they were made of, whatever the memory for pages is.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <bit>
#include <cstddef>
#include <cstring>
#include <fstream>
#include <limits>
#include <memory>
#include <random>
#include <string>
#include <thread>
#include <vector>

#include "common/base/digest.h"
#include "common/base/file.h"
#include "common/volume/page_format.h"
#include "common/volume/page_maker.h"
#include "common/volume/volume_file.h"
#include "common/volume/volume_pages.h"
#include "tests/support/temporary_path.h"
#include "tests/support/volume/volume_files.h"

namespace sheaf {
namespace {

using ::sheaf::testing::GridToWrite;
using ::sheaf::testing::Lumps;
using ::sheaf::testing::NvdbCodec;
using ::sheaf::testing::NvdbFile;
using ::sheaf::testing::TemporaryPath;
using ::sheaf::testing::VdbFile;
using ::sheaf::testing::Voxel;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using volume::VolumePages;

// Most of it is empty: pages of all kinds.
float Sparse(const Voxel& v) {
  const bool is_there = ((v[0] >> 4) + (v[1] >> 5) + (v[2] >> 3)) % 3 == 0;
  return is_there ? 0.25f + Lumps(v) : 0;
}

class PageFileTest : public ::testing::Test {
 protected:
  ~PageFileTest() override {
    ::unlink(volume_path_.c_str());
    ::unlink(page_path_.c_str());
  }
  // Makes the page file of a volume file of these bytes.
  absl::StatusOr<PageFileSummary> Make(const std::string& bytes) {
    EXPECT_TRUE(WriteFileAtomically(volume_path_, bytes).ok());
    return MakePageFile("smoke.vdb", volume_path_, page_path_);
  }
  absl::StatusOr<VolumeGrid> Read(std::shared_ptr<VolumePages> pages,
                                  const std::string& grid = "density") {
    return ReadVolumeGrid("smoke.pages", page_path_, grid, {}, 1, std::move(pages));
  }
  absl::StatusOr<VolumeGrid> ReadVolume() {
    return ReadVolumeGrid("smoke.vdb", volume_path_, "density");
  }
  const std::string volume_path_ = TemporaryPath("volume");
  const std::string page_path_ = TemporaryPath("pages");
};

GridToWrite Cloud(const std::string& type = "float") {
  GridToWrite written{.lo = {-40, -9, 3}, .hi = {45, 40, 50}, .value = Sparse};
  written.type = type;
  return written;
}

// Beyond the limit there are at most the pages that cursors pinned.
constexpr uint64_t kPinnedBytesMax = 8 * (uint64_t{18} << 10);

uint32_t Bits(float v) { return std::bit_cast<uint32_t>(v); }

// Compares lookups at random points, and at their neighbors. Returns the number of differences.
int CompareLookups(const VolumeGrid& a, const VolumeGrid& b, uint32_t seed, int points) {
  std::mt19937 random(seed);
  std::uniform_real_distribution<double> x(-60, 65), y(-30, 60), z(-20, 70);
  VolumeGrid::Cursor at_a(a), at_b(b);
  int differences = 0;
  for (int i = 0; i < points; ++i) {
    Vec3d p{x(random), y(random), z(random)};
    for (int step = 0; step < 8; ++step) {
      differences += Bits(a.At(p, &at_a)) != Bits(b.At(p, &at_b)) ? 1 : 0;
      p = p + Vec3d{0.7, -0.4, 0.9};
    }
  }
  return differences;
}

// Pages in memory: 1 %, 10 % and all of the grid.
std::vector<uint64_t> Budgets(const PageFileSummary& summary) {
  return {summary.image_bytes / 100, summary.image_bytes / 10, 2 * summary.image_bytes};
}

TEST_F(PageFileTest, LookupsHaveTheBitsOfTheImage) {
  for (const char* type : {"float", "Fp4", "Fp8", "Fp16", "FpN"}) {
    const auto made = Make(NvdbFile({Cloud(type)}, NvdbCodec::kNone));
    ASSERT_TRUE(made.ok()) << made.status();
    const auto image = ReadVolume();
    ASSERT_TRUE(image.ok()) << image.status();
    for (const uint64_t budget : Budgets(*made)) {
      const auto pages = std::make_shared<VolumePages>(budget);
      const auto paged = Read(pages);
      ASSERT_TRUE(paged.ok()) << paged.status();
      EXPECT_TRUE(paged->is_paged());
      EXPECT_FALSE(image->is_paged());
      EXPECT_EQ(CompareLookups(*image, *paged, 1, 400), 0) << type << " " << budget;
      EXPECT_TRUE(pages->status().ok()) << pages->status();
      EXPECT_EQ(paged->info().values, image->info().values);
      EXPECT_EQ(paged->info().index_min, image->info().index_min);
      EXPECT_EQ(paged->info().index_max, image->info().index_max);
      EXPECT_EQ(paged->info().active_voxel_count, image->info().active_voxel_count);
      EXPECT_EQ(paged->info().type, image->info().type);
      EXPECT_EQ(paged->box().lo, image->box().lo);
      EXPECT_EQ(paged->box().hi, image->box().hi);
      EXPECT_EQ(paged->medium_from_index(), image->medium_from_index());
    }
  }
}

TEST_F(PageFileTest, BoxesHaveTheValuesOfTheImage) {
  testing::VdbOptions with_tile;
  with_tile.with_tile = true;
  testing::VdbOptions level_set;
  level_set.level_set = true;
  GridToWrite distances = Cloud();
  distances.background = 0.5f;
  int uniform = 0, known = 0;
  for (const std::string& file : {NvdbFile({Cloud()}, NvdbCodec::kNone),
                                  VdbFile({Cloud()}, with_tile), VdbFile({distances}, level_set)}) {
    const auto made = Make(file);
    ASSERT_TRUE(made.ok()) << made.status();
    const auto image = ReadVolume();
    const auto paged = Read(std::make_shared<VolumePages>(uint64_t{1} << 20));
    ASSERT_TRUE(image.ok() && paged.ok()) << image.status() << paged.status();
    EXPECT_EQ(CompareLookups(*image, *paged, 2, 500), 0);
    std::mt19937 random(3);
    for (int i = 0; i < 1000; ++i) {
      Index3 lo, hi;
      for (size_t a = 0; a < 3; ++a) {
        lo[a] = static_cast<int32_t>(random() % 140) - 70;
        hi[a] = lo[a] + static_cast<int32_t>(random() % (i % 3 == 0 ? 12 : 150));
      }
      const auto expected = image->UniformValue(lo, hi);
      ASSERT_EQ(paged->UniformValue(lo, hi), expected) << lo[0] << " " << lo[1] << " " << lo[2];
      uniform += expected ? 1 : 0;
      // The range of a block, and of the voxels around that its lookups reach.
      const Index3 origin{lo[0] & ~7, lo[1] & ~7, lo[2] & ~7};
      const Index3 from{origin[0] - 1, origin[1] - 1, origin[2] - 1};
      const Index3 to{origin[0] + 10, origin[1] + 10, origin[2] + 10};
      std::vector<float> of_image(12 * 12 * 12), of_pages(12 * 12 * 12);
      VolumeGrid::Cursor at_image(*image), at_pages(*paged);
      image->ReadBox(from, to, of_image, &at_image);
      paged->ReadBox(from, to, of_pages, &at_pages);
      ASSERT_EQ(of_image, of_pages);
      EXPECT_FALSE(image->BlockRange(origin));
      const auto range = paged->BlockRange(origin);
      if (!range) continue;
      ++known;
      const auto [low, high] = std::minmax_element(of_image.begin(), of_image.end());
      ASSERT_EQ(*range, (ValueRange{*low, *high}));
    }
  }
  EXPECT_GT(uniform, 100);
  EXPECT_GT(known, 100);
}

TEST_F(PageFileTest, IsAFunctionOfTheGrids) {
  std::string first;
  for (const NvdbCodec codec : {NvdbCodec::kNone, NvdbCodec::kZip, NvdbCodec::kBlosc}) {
    ASSERT_TRUE(Make(NvdbFile({Cloud()}, codec)).ok());
    const auto bytes = ReadWholeFile(page_path_);
    ASSERT_TRUE(bytes.ok());
    if (first.empty()) first = *bytes;
    EXPECT_TRUE(*bytes == first);
  }
}

// Sets the mean in the index of the only grid, and the index' digest.
void SetMean(const std::string& path, float mean, float rest = 0) {
  std::string bytes = *ReadWholeFile(path);
  volume::PageTrailer trailer;
  char* const end = bytes.data() + bytes.size() - sizeof(trailer);
  std::memcpy(&trailer, end, sizeof(trailer));
  char* const index = bytes.data() + trailer.index_offset_bytes;
  volume::PageGridHead head;
  std::memcpy(&head, index, sizeof(head));
  head.mean = mean;
  std::memcpy(index, &head, sizeof(head));
  char* const region = index + sizeof(head) + head.root_tile_count * sizeof(volume::PageRootTile);
  std::memcpy(region + offsetof(volume::PageRegion, mean_rest), &rest, sizeof(rest));
  const std::string digest = Sha256Hex(std::string_view(index, trailer.index_bytes));
  std::copy(digest.begin(), digest.end(), trailer.index_sha256.begin());
  std::memcpy(end, &trailer, sizeof(trailer));
  ASSERT_TRUE(WriteFileAtomically(path, bytes).ok());
}

TEST_F(PageFileTest, KeepsTheMeanOfTheGrid) {
  for (const char* type : {"float", "Fp4", "Fp8", "Fp16", "FpN"}) {
    const auto made = Make(NvdbFile({Cloud(type)}, NvdbCodec::kNone));
    const auto image = ReadVolume();
    ASSERT_TRUE(made.ok() && image.ok()) << made.status() << image.status();
    const double mean = image->MeanValue();
    EXPECT_GT(mean, 0.05);
    const auto pages = std::make_shared<VolumePages>(made->image_bytes);
    EXPECT_EQ(Read(pages)->MeanValue(), mean) << type;
    EXPECT_EQ(pages->counts().pages_read, 0u);
    // Earlier files have none, so that pages are read.
    SetMean(page_path_, 0);
    EXPECT_EQ(Read(pages)->MeanValue(), mean) << type;
    EXPECT_GT(pages->counts().pages_read, 0u);
  }
  for (const float mean : {std::numeric_limits<float>::quiet_NaN(), -0.5f, 3.0f}) {
    SetMean(page_path_, mean);
    EXPECT_THAT(std::string(Read(nullptr).status().message()), HasSubstr("out of range"));
  }
  for (const float rest : {std::numeric_limits<float>::quiet_NaN(), 0.1f}) {
    SetMean(page_path_, 0.25f, rest);
    EXPECT_THAT(std::string(Read(nullptr).status().message()), HasSubstr("mean is not a number"));
  }
}

TEST_F(PageFileTest, HoldsAllGridsOfNumbers) {
  GridToWrite heat = Cloud(), wind = Cloud("Vec3f");
  heat.name = "temperature";
  heat.value = Lumps;
  wind.name = "velocity";
  const auto made = Make(NvdbFile({Cloud(), wind, heat}, NvdbCodec::kZip));
  ASSERT_TRUE(made.ok()) << made.status();
  EXPECT_THAT(made->grids, ElementsAre("density", "temperature"));
  EXPECT_THAT(made->left_out, ElementsAre("velocity"));
  const auto entries = ListVolumeFile("smoke.pages", page_path_);
  ASSERT_TRUE(entries.ok()) << entries.status();
  ASSERT_EQ(entries->size(), 2u);
  EXPECT_EQ((*entries)[1].role, VolumeRole::kTemperature);
  EXPECT_THAT(std::string(Read(nullptr, "velocity").status().message()),
              HasSubstr("no grid \"velocity\"; there are: \"density\" (float), \"temperature\""));
  // Grids share the memory for pages.
  const auto pages = std::make_shared<VolumePages>(uint64_t{1} << 18);
  const auto density = Read(pages), temperature = Read(pages, "temperature");
  ASSERT_TRUE(density.ok() && temperature.ok());
  const auto image = ReadVolume();
  EXPECT_EQ(CompareLookups(*image, *density, 4, 300), 0);
  EXPECT_GT(CompareLookups(*temperature, *density, 4, 300), 0);
  EXPECT_LE(pages->page_bytes(), pages->bytes_max() + 2 * kPinnedBytesMax);
  EXPECT_THAT(std::string(Make(NvdbFile({wind}, NvdbCodec::kNone)).status().message()),
              HasSubstr("has no grid of scalars"));
}

TEST_F(PageFileTest, PageFilesAreNotPackedAgain) {
  ASSERT_TRUE(Make(NvdbFile({Cloud()}, NvdbCodec::kNone)).ok());
  const auto again = MakePageFile("smoke.pages", page_path_, volume_path_);
  EXPECT_THAT(std::string(again.status().message()), HasSubstr("is a page file already"));
}

TEST_F(PageFileTest, DamagedVolumesAreRefused) {
  const std::string whole = NvdbFile({Cloud()}, NvdbCodec::kNone);
  constexpr size_t kImage = 16 + 176 + 8, kTree = kImage + 672, kRoot = kTree + 64;
  // Magic, version, type of values, place of the root, size of its table, key and child of a tile.
  for (const size_t at :
       {kImage, kImage + 18, kImage + 636, kTree + 30, kRoot + 26, kRoot + 71, kRoot + 74}) {
    std::string bytes = whole;
    bytes[at] = static_cast<char>(bytes[at] ^ 0x55);
    EXPECT_FALSE(Make(bytes).ok()) << at;
  }
  EXPECT_EQ(Make(whole.substr(0, whole.size() / 2)).status().code(), absl::StatusCode::kDataLoss);
}

// The error of opening the page file, or of reading it all.
absl::Status StatusOfReading(const std::string& path) {
  const auto pages = std::make_shared<VolumePages>(uint64_t{64} << 20);
  const auto grid = ReadVolumeGrid("smoke.pages", path, "density", {}, 1, pages);
  if (!grid.ok()) return grid.status();
  VolumeGrid::Cursor cursor(*grid);
  for (int32_t x = -40; x <= 45; x += 4) {
    for (int32_t y = -9; y <= 40; y += 4) {
      for (int32_t z = 3; z <= 50; z += 4) {
        const float v = grid->At({double(x), double(y), double(z)}, &cursor);
        EXPECT_TRUE(v >= 0 && v < 2);
      }
    }
  }
  return pages->status();
}

TEST_F(PageFileTest, AlteredBytesAreFound) {
  ASSERT_TRUE(Make(NvdbFile({Cloud()}, NvdbCodec::kNone)).ok());
  const auto whole = ReadWholeFile(page_path_);
  ASSERT_TRUE(whole.ok());
  ASSERT_TRUE(StatusOfReading(page_path_).ok()) << StatusOfReading(page_path_);
  std::mt19937 random(6);
  for (int i = 0; i < 40; ++i) {
    std::string bytes = *whole;
    const size_t tail = sizeof(volume::PageTrailer);
    const size_t at = i % 4 == 0 ? bytes.size() - 1 - random() % tail : random() % bytes.size();
    bytes[at] = static_cast<char>(bytes[at] ^ (1 << random() % 8));
    ASSERT_TRUE(WriteFileAtomically(page_path_, bytes).ok());
    EXPECT_FALSE(StatusOfReading(page_path_).ok()) << "byte " << at << " of " << bytes.size();
  }
}

// Pages that were verified once are compared with what they were.
TEST_F(PageFileTest, PagesAlteredAfterTheirFirstReadingAreFound) {
  ASSERT_TRUE(Make(NvdbFile({Cloud()}, NvdbCodec::kNone)).ok());
  const auto image = ReadVolume();
  const auto pages = std::make_shared<VolumePages>(1);  // Each page is read anew.
  const auto paged = Read(pages);
  ASSERT_TRUE(image.ok() && paged.ok());
  ASSERT_EQ(CompareLookups(*image, *paged, 5, 300), 0);
  const uint64_t read_once = pages->counts().pages_read;
  ASSERT_EQ(CompareLookups(*image, *paged, 5, 300), 0);
  ASSERT_GT(pages->counts().pages_read, read_once + 20);
  ASSERT_TRUE(pages->status().ok()) << pages->status();
  const auto whole = ReadWholeFile(page_path_);
  ASSERT_TRUE(whole.ok());
  volume::PageTrailer trailer;
  std::memcpy(&trailer, whole->data() + whole->size() - sizeof(trailer), sizeof(trailer));
  std::fstream file(page_path_, std::ios::in | std::ios::out | std::ios::binary);
  for (uint64_t at = 40; at < trailer.index_offset_bytes; at += 256) {
    file.seekp(static_cast<std::streamoff>(at));
    file.put(static_cast<char>((*whole)[at] ^ 1));
  }
  file.close();
  CompareLookups(*image, *paged, 5, 300);
  EXPECT_THAT(std::string(pages->status().message()), HasSubstr("does not match its digest"));
}

TEST_F(PageFileTest, FilesCutShortAreRefused) {
  ASSERT_TRUE(Make(NvdbFile({Cloud()}, NvdbCodec::kNone)).ok());
  const auto whole = ReadWholeFile(page_path_);
  ASSERT_TRUE(whole.ok());
  for (const size_t size : {size_t{8}, size_t{95}, whole->size() / 2, whole->size() - 1}) {
    ASSERT_TRUE(WriteFileAtomically(page_path_, whole->substr(0, size)).ok());
    const absl::Status status = StatusOfReading(page_path_);
    EXPECT_EQ(status.code(), absl::StatusCode::kInvalidArgument);
    EXPECT_THAT(std::string(status.message()),
                HasSubstr("the page file is altered or cut short; make it again (sheaf pack)"));
  }
}

TEST_F(PageFileTest, AFileThatChangesWhileItIsReadIsOneError) {
  ASSERT_TRUE(Make(NvdbFile({Cloud()}, NvdbCodec::kNone)).ok());
  const auto pages = std::make_shared<VolumePages>(uint64_t{1} << 20);
  const auto grid = Read(pages);
  ASSERT_TRUE(grid.ok());
  ASSERT_EQ(::truncate(page_path_.c_str(), 100), 0);
  VolumeGrid::Cursor cursor(*grid);
  EXPECT_EQ(grid->At({0, 20, 30}, &cursor), 0);
  EXPECT_THAT(std::string(pages->status().message()),
              HasSubstr("smoke.pages: grid \"density\": page "));
}

TEST_F(PageFileTest, ThreadsShareFewPages) {
  const auto made = Make(NvdbFile({Cloud()}, NvdbCodec::kNone));
  ASSERT_TRUE(made.ok());
  const auto image = ReadVolume();
  constexpr uint32_t kThreads = 4;
  for (const uint64_t budget : Budgets(*made)) {
    const auto pages = std::make_shared<VolumePages>(budget);
    const auto paged = Read(pages);
    ASSERT_TRUE(paged.ok());
    std::atomic<int> differences{0};
    std::vector<std::thread> threads;
    for (uint32_t t = 0; t < kThreads; ++t) {
      threads.emplace_back([&, t] { differences += CompareLookups(*image, *paged, t, 200); });
    }
    for (std::thread& thread : threads) thread.join();
    EXPECT_EQ(differences, 0);
    EXPECT_TRUE(pages->status().ok());
    EXPECT_LE(pages->page_bytes(), budget + kThreads * kPinnedBytesMax);
  }
}

TEST_F(PageFileTest, MemoryIsBoundedAndCounted) {
  const auto made = Make(NvdbFile({Cloud()}, NvdbCodec::kNone));
  ASSERT_TRUE(made.ok());
  const auto image = ReadVolume();
  const auto all = std::make_shared<VolumePages>(uint64_t{1} << 30);
  {
    const auto paged = Read(all);
    ASSERT_TRUE(paged.ok());
    const volume::PageCounts before = VolumePages::CountsOfThread();
    CompareLookups(*image, *paged, 7, 400);
    const volume::PageCounts once = all->counts();
    CompareLookups(*image, *paged, 7, 400);
    EXPECT_EQ(all->counts().pages_read, once.pages_read);
    EXPECT_EQ(all->counts().pages_pinned, 2 * once.pages_pinned);
    EXPECT_GT(once.pages_pinned, once.pages_read);
    EXPECT_EQ(all->counts().pages_evicted, 0u);
    EXPECT_GT(once.pages_read, 10u);
    EXPECT_LE(once.bytes_read, made->file_bytes);
    EXPECT_EQ((VolumePages::CountsOfThread() - before).pages_read, once.pages_read);
    const auto index_bytes = PageIndexBytes(page_path_);
    ASSERT_TRUE(index_bytes);
    EXPECT_NEAR(static_cast<double>(paged->memory_bytes()), static_cast<double>(*index_bytes),
                0.3 * static_cast<double>(*index_bytes));
  }
  EXPECT_EQ(all->page_bytes(), 0u);
  // Memory beside pages leaves less for these, but a quarter.
  const auto some = std::make_shared<VolumePages>(uint64_t{2} << 20);
  some->AddOtherBytes(uint64_t{1} << 30);
  const auto paged = Read(some);
  ASSERT_TRUE(paged.ok());
  CompareLookups(*image, *paged, 8, 400);
  EXPECT_LE(some->page_bytes(), (uint64_t{512} << 10) + kPinnedBytesMax);
  EXPECT_GT(some->counts().pages_read, all->counts().pages_read);
  EXPECT_GT(some->counts().pages_evicted, 0u);
  EXPECT_LE(some->counts().pages_evicted, some->counts().pages_read);
  EXPECT_FALSE(PageIndexBytes(volume_path_));
}

}  // namespace
}  // namespace sheaf
