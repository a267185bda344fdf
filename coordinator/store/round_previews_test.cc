// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "coordinator/store/round_previews.h"

#include <filesystem>

#include "common/base/check.h"
#include "gtest/gtest.h"

namespace sheaf::coordinator {
namespace {

constexpr FrameId kFrame{3, -7};

class RoundPreviewsTest : public ::testing::Test {
 protected:
  RoundPreviewsTest()
      : directory_(::testing::TempDir() + "sheaf-rounds-" +
                   ::testing::UnitTest::GetInstance()->current_test_info()->name()) {
    std::filesystem::remove_all(directory_);
    Reopen();
  }
  ~RoundPreviewsTest() override { std::filesystem::remove_all(directory_); }
  void Reopen() {
    auto opened = RoundPreviews::Open(directory_, limits_);
    SHEAF_CHECK(opened.ok());
    previews_ = *std::move(opened);
  }
  // Stores an image whose pixels all have the round's number as their value.
  void Keep(const FrameId& frame, int32_t round) {
    FrameImage image = MakeFrameImage({0, 0, 64, 32}, 64, 32);
    *image.Find("R") = std::vector<float>(64 * 32, static_cast<float>(round));
    EXPECT_TRUE(previews_->Keep(frame, round, image).ok());
  }
  size_t CountOf(const FrameId& frame, int32_t end) const {
    size_t count = 0;
    for (int32_t i = 0; i < end; ++i) count += previews_->VersionOf(frame, i) > 0;
    return count;
  }

  const std::string directory_;
  RoundPreviewLimits limits_{.pixels_max = 128, .rounds_max = 4};
  std::unique_ptr<RoundPreviews> previews_;
};

TEST_F(RoundPreviewsTest, PreviewsSurviveARestart) {
  Keep(kFrame, 0);
  Keep(kFrame, 1);
  for (int i = 0; i < 2; ++i) {
    const auto image = previews_->Read(kFrame, 1);
    ASSERT_TRUE(image.ok()) << image.status();
    EXPECT_EQ(image->window, (PixelRect{0, 0, 16, 8}));
    EXPECT_EQ(image->Find("R")->at(5), 1);
    EXPECT_NE(image->Find("stderr.B"), nullptr);
    EXPECT_EQ(previews_->Read(kFrame, 2).status().code(), absl::StatusCode::kNotFound);
    Reopen();
  }
  EXPECT_LT(previews_->VersionOf(kFrame, 0), previews_->VersionOf(kFrame, 1));
  const uint64_t before = previews_->VersionOf(kFrame, 1);
  Keep(kFrame, 1);
  EXPECT_GT(previews_->VersionOf(kFrame, 1), before);
}

TEST_F(RoundPreviewsTest, ThinsOutMiddleRounds) {
  for (int32_t round = 0; round < 20; ++round) Keep(kFrame, round);
  EXPECT_GT(previews_->VersionOf(kFrame, 0), 0u);
  EXPECT_GT(previews_->VersionOf(kFrame, 19), 0u);
  EXPECT_LE(CountOf(kFrame, 20), limits_.rounds_max);
  EXPECT_GE(CountOf(kFrame, 20), 3u);
}

TEST_F(RoundPreviewsTest, DropsOldestAndRevokedRounds) {
  Keep(kFrame, 0);
  const uint64_t size = std::filesystem::file_size(directory_ + "/3/-7/0.exr");
  limits_.bytes_max = 3 * size + size / 2;
  Reopen();
  for (uint64_t job = 4; job < 8; ++job) Keep({job, 1}, 0);
  EXPECT_EQ(previews_->VersionOf(kFrame, 0), 0u);
  EXPECT_FALSE(std::filesystem::exists(directory_ + "/3/-7"));
  EXPECT_GT(previews_->VersionOf({7, 1}, 0), 0u);
  Keep({7, 1}, 1);
  previews_->RemoveFrom({7, 1}, 1);
  EXPECT_GT(previews_->VersionOf({7, 1}, 0), 0u);
  EXPECT_EQ(previews_->VersionOf({7, 1}, 1), 0u);
  limits_.bytes_max = 0;
  Reopen();
  Keep(kFrame, 0);
  EXPECT_EQ(previews_->VersionOf(kFrame, 0), 0u);
}

TEST_F(RoundPreviewsTest, RemovesThoseOfAJob) {
  Keep({3, 1}, 0);
  Keep({3, 2}, 1);
  Keep({4, 1}, 0);
  const std::map<uint64_t, uint64_t> bytes = previews_->BytesByJob();
  ASSERT_EQ(bytes.size(), 2u);
  EXPECT_EQ(bytes.at(4), std::filesystem::file_size(directory_ + "/4/1/0.exr"));
  EXPECT_GT(bytes.at(3), bytes.at(4));
  previews_->RemoveJob(3);
  EXPECT_FALSE(std::filesystem::exists(directory_ + "/3"));
  EXPECT_GT(previews_->VersionOf({4, 1}, 0), 0u);
  EXPECT_EQ(previews_->BytesByJob().size(), 1u);
}

}  // namespace
}  // namespace sheaf::coordinator
