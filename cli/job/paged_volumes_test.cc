// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Large files of volumes are submitted as page files in parts: the same ones each time, once, and
// only where media alone read them.
#include "cli/job/paged_volumes.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <map>
#include <memory>

#include "absl/strings/str_format.h"
#include "common/base/file.h"
#include "common/scene/pbrt/scene_reader.h"
#include "common/volume/volume_file.h"
#include "tests/support/temporary_path.h"
#include "tests/support/volume/volume_writers.h"

namespace sheaf::cli {
namespace {

using ::sheaf::testing::NvdbCodec;
using ::sheaf::testing::NvdbFile;
using ::sheaf::testing::Voxel;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::SizeIs;

constexpr char kSmoke[] =
    "WorldBegin\nMakeNamedMedium \"m\" \"string type\" \"nanovdb\" \"string filename\" "
    "\"smoke.nvdb\"%s\nMediumInterface \"m\" \"\"\nMaterial \"interface\"\n"
    "Shape \"sphere\" \"float radius\" 50\n";

class PagedVolumesTest : public ::testing::Test {
 protected:
  void SetUp() override {
    std::filesystem::create_directories(folder_ + "/kept");
    const auto lumps = [](const Voxel& v) {
      return static_cast<float>(((v[0] * 7 + v[1] * 5 + v[2] * 3) & 15) + 1);
    };
    Write("smoke.nvdb",
          NvdbFile({{.lo = {-30, 0, 1}, .hi = {40, 10, 20}, .value = lumps}}, NvdbCodec::kNone));
    Write("scene.pbrt", absl::StrFormat(kSmoke, ""));
  }
  ~PagedVolumesTest() override { std::filesystem::remove_all(folder_); }
  void Write(const std::string& name, const std::string& bytes) {
    ASSERT_TRUE(WriteFileAtomically(folder_ + "/" + name, bytes).ok());
  }
  // Reads the scene, and replaces its volumes of at least bytes_min.
  absl::StatusOr<std::set<std::string>> Replace(uint64_t bytes_min) {
    files_ = std::make_unique<OpenedFiles>(folder_);
    const auto read = ReadScene("scene.pbrt", *files_);
    if (!read.ok()) return read.status();
    PagedVolumes volumes(bytes_min, folder_ + "/kept", &digests_);
    notes_.clear();
    return volumes.Replace(read->scene, files_.get(), &notes_);
  }
  size_t KeptCount() const {
    size_t count = 0;
    for (const auto& entry : std::filesystem::directory_iterator(folder_ + "/kept")) {
      count += entry.is_directory() ? 1 : 0;
    }
    return count;
  }

  const std::string folder_ = sheaf::testing::TemporaryPath("paged");
  FileDigests digests_;
  std::unique_ptr<OpenedFiles> files_;
  std::vector<std::string> notes_;
};

TEST_F(PagedVolumesTest, ReplacesLargeFiles) {
  const auto parts = Replace(1);
  ASSERT_TRUE(parts.ok()) << parts.status();
  EXPECT_THAT(*parts, ElementsAre("smoke.nvdb.parts/0000"));
  EXPECT_THAT(notes_, IsEmpty());
  const std::map<std::string, std::string> used = files_->FilesUsed();
  ASSERT_THAT(used, SizeIs(3));
  const auto part = files_->OpenPart("smoke.nvdb.parts/0000");
  ASSERT_TRUE(part.ok()) << part.status();
  const auto whole = ReadVolumeGrid("smoke.nvdb", folder_ + "/smoke.nvdb", "density");
  const auto paged =
      ReadVolumeGrid("smoke.nvdb", used.at("smoke.nvdb"), "density", {}, 1, nullptr,
                     [this](size_t n) { return files_->OpenPart(PagePartName("smoke.nvdb", n)); });
  ASSERT_TRUE(whole.ok() && paged.ok()) << paged.status();
  VolumeGrid::Cursor at_whole(*whole), at_paged(*paged);
  for (int i = -35; i < 45; ++i) {
    const Vec3d p{static_cast<double>(i), 5, 9.25};
    EXPECT_EQ(paged->At(p, &at_paged), whole->At(p, &at_whole));
  }
  EXPECT_TRUE(CheckUnchanged(files_->States()).ok());
}

TEST_F(PagedVolumesTest, PageFilesAreMadeOnce) {
  ASSERT_THAT(*Replace(1), SizeIs(1));
  const std::string index = files_->FilesUsed().at("smoke.nvdb");
  const auto made = std::filesystem::last_write_time(index);
  ASSERT_THAT(*Replace(1), SizeIs(1));
  EXPECT_EQ(files_->FilesUsed().at("smoke.nvdb"), index);
  EXPECT_EQ(std::filesystem::last_write_time(index), made);
  EXPECT_EQ(KeptCount(), 1u);
}

TEST_F(PagedVolumesTest, PageFilesThatScenesNameAreOnlySplit) {
  ASSERT_THAT(*Replace(1), SizeIs(1));
  const std::string index = *ReadWholeFile(files_->FilesUsed().at("smoke.nvdb"), 1 << 30);
  ASSERT_TRUE(MakePageFile("smoke", folder_ + "/smoke.nvdb", folder_ + "/smoke.pages").ok());
  std::filesystem::rename(folder_ + "/smoke.pages", folder_ + "/smoke.nvdb");
  ASSERT_THAT(*Replace(1), SizeIs(1));
  EXPECT_EQ(*ReadWholeFile(files_->FilesUsed().at("smoke.nvdb"), 1 << 30), index);
  EXPECT_TRUE(std::filesystem::exists(folder_ + "/smoke.nvdb"));
}

TEST_F(PagedVolumesTest, PartsOfASceneThatComesFromAFarmAreFound) {
  ASSERT_THAT(*Replace(1), SizeIs(1));
  const std::string index = files_->FilesUsed().at("smoke.nvdb");
  std::filesystem::create_directory(folder_ + "/smoke.nvdb.parts");
  std::filesystem::copy(index.substr(0, index.rfind('/')) + "/0000",
                        folder_ + "/smoke.nvdb.parts/0000");
  std::filesystem::copy(index, folder_ + "/smoke.nvdb",
                        std::filesystem::copy_options::overwrite_existing);
  EXPECT_THAT(*Replace(uint64_t{1} << 40), ElementsAre("smoke.nvdb.parts/0000"));
  EXPECT_EQ(files_->FilesUsed().at("smoke.nvdb.parts/0000"), folder_ + "/smoke.nvdb.parts/0000");
}

TEST_F(PagedVolumesTest, OthersStayAsTheyAre) {
  EXPECT_THAT(*Replace(uint64_t{1} << 30), IsEmpty());  // Small.
  EXPECT_EQ(files_->FilesUsed().at("smoke.nvdb"), folder_ + "/smoke.nvdb");
  Write("scene.pbrt", absl::StrFormat(kSmoke, " \"string velocity\" \"vel\""));
  EXPECT_THAT(*Replace(1), IsEmpty());
  EXPECT_EQ(KeptCount(), 0u);
  EXPECT_THAT(notes_, IsEmpty());
}

TEST_F(PagedVolumesTest, DamagedFilesAreLeftToTheReader) {
  Write("smoke.nvdb", std::string(1000, 'x'));
  EXPECT_THAT(*Replace(1), IsEmpty());
  EXPECT_THAT(notes_, ElementsAre(HasSubstr("smoke.nvdb: is submitted whole")));
  EXPECT_EQ(KeptCount(), 0u);
}

}  // namespace
}  // namespace sheaf::cli
