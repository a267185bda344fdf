// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "cli/bundle/bundle_file.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>

#include "tests/support/farm/made_up_bundle.h"
#include "tests/support/temporary_path.h"

namespace sheaf::cli {
namespace {

using ::testing::HasSubstr;

class BundleFileTest : public ::testing::Test {
 protected:
  ~BundleFileTest() override { std::filesystem::remove(path_); }
  std::string BytesOf(const MadeUpBundle& made) {
    const absl::Status written = made.WriteTo(path_);
    EXPECT_TRUE(written.ok()) << written;
    return written.ok() ? *ReadWholeFile(path_) : "";
  }
  // The error of opening it.
  std::string Why(const MadeUpBundle& made) {
    return std::string(OpenBytes(BytesOf(made)).status().message());
  }
  const std::string path_ = testing::TemporaryPath("bundle.tar");
};

TEST_F(BundleFileTest, ComesBack) {
  MadeUpBundle made;
  made.AddFailure("internal", "it broke");
  made.task.set_task(3);
  const absl::StatusOr<Bundle> bundle = OpenBytes(BytesOf(made));
  ASSERT_TRUE(bundle.ok()) << bundle.status();
  EXPECT_EQ(bundle->task().version(), "9.9");
  EXPECT_EQ(bundle->task().task(), 3u);
  EXPECT_EQ(bundle->task().failures(0).message(), "it broke");
  EXPECT_EQ(bundle->lease().block, (SampleBlock{0, 4}));
  ASSERT_EQ(bundle->manifest().files.size(), 1u);
  std::string scene;
  const absl::Status fetched =
      bundle->Fetcher()(bundle->manifest().files[0].digest, 4, [&](std::string_view bytes) {
        scene += bytes;
        return absl::OkStatus();
      });
  ASSERT_TRUE(fetched.ok()) << fetched;
  EXPECT_EQ(scene, std::string(kTinyScene).substr(4));
  EXPECT_EQ(*bundle->ReadField(), "");
}

TEST_F(BundleFileTest, AnEarlierBeginningIsForgotten) {
  const MadeUpBundle made;
  BundleWriter writer(path_, "9.9");
  const std::vector<v1::ReadTaskBundleResponse> messages = made.Messages();
  ASSERT_TRUE(writer.Take(messages[0]).ok());
  ASSERT_TRUE(writer.Take(messages[1]).ok());
  for (const auto& message : messages) ASSERT_TRUE(writer.Take(message).ok());
  ASSERT_TRUE(writer.Finish().ok());
  EXPECT_TRUE(OpenBytes(*ReadWholeFile(path_)).ok());
}

TEST_F(BundleFileTest, BytesThatDoNotMatchLeaveNoFile) {
  MadeUpBundle made;
  auto messages = made.Messages();
  messages[2].set_zstd_chunk(CompressChunk("other bytes"));
  {
    BundleWriter writer(path_, "9.9");
    absl::Status status;
    for (const auto& message : messages) {
      if (status.ok()) status = writer.Take(message);
    }
    EXPECT_FALSE(status.ok());
  }
  BundleWriter early(path_, "9.9");
  EXPECT_TRUE(absl::IsDataLoss(early.Take(messages[1])));
  EXPECT_FALSE(std::filesystem::exists(path_));
}

TEST_F(BundleFileTest, EveryChangedBitIsRefused) {
  const std::string bytes = BytesOf(MadeUpBundle());
  for (size_t at = 0; at < bytes.size(); at += 7) {
    std::string changed = bytes;
    changed[at] = static_cast<char>(changed[at] ^ 1);
    EXPECT_TRUE(absl::IsDataLoss(OpenBytes(changed).status())) << at;
  }
  for (size_t size = 0; size < bytes.size(); size += 97) {
    EXPECT_TRUE(absl::IsDataLoss(OpenBytes(bytes.substr(0, size)).status())) << size;
  }
  EXPECT_THAT(std::string(OpenBytes(std::string(1'024, '\0')).status().message()),
              HasSubstr("not a file of sheaf bundle"));
}

TEST_F(BundleFileTest, TasksThatNoWorkerWouldGetAreRefusedInWords) {
  MadeUpBundle other;
  other.task.set_format(2);
  EXPECT_EQ(Why(other),
            "it has format 2, this version of sheaf reads format 1 (it was written by "
            "sheaf 9.9)");
  MadeUpBundle large;
  large.task.mutable_key()->mutable_tile()->set_x1_px(5);
  EXPECT_THAT(Why(large), HasSubstr("tile and window do not lie within the frame"));
  MadeUpBundle unaligned;
  unaligned.task.mutable_key()->mutable_block()->set_first(1);
  EXPECT_THAT(Why(unaligned), HasSubstr("not an aligned block"));
  MadeUpBundle seeded;
  seeded.task.mutable_settings()->set_seed(5);
  EXPECT_THAT(Why(seeded), HasSubstr("do not give its frame digest"));
  MadeUpBundle incomplete;
  incomplete.files[1] = "something else";
  EXPECT_THAT(Why(incomplete), HasSubstr("a file of the scene ("));
  incomplete.files.clear();
  EXPECT_THAT(Why(incomplete), HasSubstr("task.json or SHA256SUMS is missing"));
}

}  // namespace
}  // namespace sheaf::cli
