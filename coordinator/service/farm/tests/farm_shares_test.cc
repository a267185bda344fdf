// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Weights and limits of a farm: durable, and refused where the disk or a rule refuses them.
#include "coordinator/service/farm/farm.h"
#include "coordinator/service/farm/tests/farm_fixture.h"
#include "gtest/gtest.h"

namespace sheaf::coordinator {
namespace {

const ShareSubject kAnna{ShareKind::kUser, "anna"}, kComet{ShareKind::kShow, "comet"};

TEST_F(FarmTest, SharesSurviveARestartUntilTheyAreReset) {
  store_->Open();
  ShareControl* shares = &farm_->share_control();
  ASSERT_TRUE(shares->Set(kAnna, [](ShareSetting* s) { s->weight = 2; }).ok());
  const auto both = shares->Set(kAnna, [](ShareSetting* s) { s->threads_max = 64; });
  ASSERT_TRUE(both.ok()) << both.status();
  EXPECT_EQ(both->setting, (ShareSetting{2, 64}));
  ASSERT_TRUE(shares->Set(kComet, [](ShareSetting* s) { s->threads_max = 8; }).ok());
  EXPECT_TRUE(absl::IsInvalidArgument(
      shares->Set(kAnna, [](ShareSetting* s) { s->weight = -1; }).status()));
  farm_.reset();
  Start();
  store_->Open();
  shares = &farm_->share_control();
  const std::vector<ShareView> views = shares->List();
  ASSERT_EQ(views.size(), 2u);
  EXPECT_EQ(views[0].subject, FormatShareSubject(kAnna));
  EXPECT_EQ(views[0].setting, (ShareSetting{2, 64}));
  EXPECT_EQ(views[1].setting, (ShareSetting{1, 8}));
  ASSERT_TRUE(shares->Reset(kAnna).ok());
  ASSERT_TRUE(shares->Reset(kAnna).ok()) << "again";
  farm_.reset();
  Start();
  store_->Open();
  const std::vector<ShareView> left = farm_->share_control().List();
  ASSERT_EQ(left.size(), 1u);
  EXPECT_EQ(left[0].subject, FormatShareSubject(kComet));
}

}  // namespace
}  // namespace sheaf::coordinator
