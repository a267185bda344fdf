// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "coordinator/access/identity_limits.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <optional>

#include "absl/strings/str_cat.h"
#include "common/base/retry_after.h"

namespace sheaf::coordinator {
namespace {

using testing::HasSubstr;

const absl::Time kNow = absl::FromUnixSeconds(1'800'000'000);
const IdentityId kAnna{IdentityKind::kUser, "anna"};
const IdentityId kBen{IdentityKind::kUser, "ben"};
const IdentityId kNode{IdentityKind::kWorker, "node7"};

IdentityLimits Few() {
  IdentityLimits limits;
  limits.calls_per_second_max = 10;
  limits.calls_burst_max = 20;
  limits.stranger_calls_per_second_max = 1;
  limits.stranger_calls_burst_max = 2;
  limits.user_streams_max = 2;
  limits.worker_streams_max = 3;
  limits.upload_bytes_per_day_max = 1000;
  return limits;
}

TEST(IdentityUseTest, LimitsTheRateOfCalls) {
  IdentityUse use(Few());
  for (int i = 0; i < 20; ++i) ASSERT_TRUE(use.NoteCall(kAnna, kNow).ok()) << i;
  const absl::Status refused = use.NoteCall(kAnna, kNow);
  EXPECT_TRUE(absl::IsResourceExhausted(refused));
  EXPECT_THAT(std::string(refused.message()), HasSubstr("10 a second"));
  EXPECT_EQ(RetryAfterOf(refused), absl::Seconds(1)) << refused;
  EXPECT_TRUE(use.NoteCall(kBen, kNow).ok()) << "others are not held up";
  int later = 0;
  while (use.NoteCall(kAnna, kNow + absl::Milliseconds(550)).ok()) ++later;
  EXPECT_EQ(later, 5);
}

TEST(IdentityUseTest, AClockThatIsSetBackGivesNoCallsAndTakesNone) {
  IdentityUse use(Few());
  for (int i = 0; i < 20; ++i) ASSERT_TRUE(use.NoteCall(kAnna, kNow).ok()) << i;
  EXPECT_FALSE(use.NoteCall(kAnna, kNow - absl::Hours(1)).ok());
  EXPECT_TRUE(use.NoteCall(kAnna, kNow + absl::Milliseconds(100)).ok());
}

TEST(IdentityUseTest, StrangersAreLimitedByAddress) {
  IdentityUse use(Few());
  EXPECT_TRUE(use.NoteStrangerCall("192.0.2.7", kNow).ok());
  EXPECT_TRUE(use.NoteStrangerCall("192.0.2.7", kNow).ok());
  const absl::Status refused = use.NoteStrangerCall("192.0.2.7", kNow);
  EXPECT_TRUE(absl::IsResourceExhausted(refused));
  EXPECT_EQ(RetryAfterOf(refused), absl::Seconds(1)) << refused;
  EXPECT_TRUE(use.NoteStrangerCall("192.0.2.8", kNow).ok());
}

TEST(IdentityUseTest, ForgetsAddressesWhenThereAreTooMany) {
  IdentityUse use(Few());
  while (use.NoteStrangerCall("192.0.2.7", kNow).ok()) {
  }
  for (size_t i = 1; i < kStrangerAddressesMax; ++i) {
    ASSERT_TRUE(use.NoteStrangerCall(absl::StrCat("other", i), kNow).ok());
  }
  EXPECT_FALSE(use.NoteStrangerCall("192.0.2.7", kNow).ok());
  EXPECT_TRUE(use.NoteStrangerCall("one more", kNow).ok());
  EXPECT_TRUE(use.NoteStrangerCall("192.0.2.7", kNow).ok());
}

TEST(IdentityUseTest, LimitsOpenStreams) {
  IdentityUse use(Few());
  std::optional<IdentityUse::Stream> first(*use.OpenStream(kAnna));
  const IdentityUse::Stream second = *use.OpenStream(kAnna);
  const absl::Status refused = use.OpenStream(kAnna).status();
  EXPECT_TRUE(absl::IsResourceExhausted(refused));
  EXPECT_FALSE(RetryAfterOf(refused)) << "nobody knows when one of them ends";
  EXPECT_TRUE(use.OpenStream(kBen).ok());
  first.reset();
  EXPECT_TRUE(use.OpenStream(kAnna).ok());
  EXPECT_TRUE(use.OpenStream(kAnna).ok()) << "the one before has ended";
  const IdentityUse::Stream streams[] = {*use.OpenStream(kNode), *use.OpenStream(kNode),
                                         *use.OpenStream(kNode)};
  EXPECT_FALSE(use.OpenStream(kNode).ok());
}

TEST(IdentityUseTest, LimitsTheBytesOfADay) {
  IdentityUse use(Few());
  EXPECT_TRUE(use.BeginUpload(kAnna, 600, kNow).ok());
  const absl::Status refused = use.BeginUpload(kAnna, 401, kNow);
  EXPECT_TRUE(absl::IsResourceExhausted(refused));
  EXPECT_THAT(std::string(refused.message()), HasSubstr("1000"));
  EXPECT_TRUE(use.BeginUpload(kAnna, 400, kNow + absl::Hours(23)).ok());
  EXPECT_FALSE(use.BeginUpload(kAnna, 1, kNow + absl::Hours(23)).ok());
  EXPECT_TRUE(use.BeginUpload(kAnna, 1000, kNow + absl::Hours(24)).ok());
}

TEST(IdentityUseTest, BytesThatDidNotComeDoNotCount) {
  IdentityUse use(Few());
  EXPECT_TRUE(use.BeginUpload(kAnna, 1000, kNow).ok());
  use.ReturnUpload(kAnna, 900);
  EXPECT_TRUE(use.BeginUpload(kAnna, 900, kNow).ok());
  EXPECT_FALSE(use.BeginUpload(kAnna, 1, kNow).ok());
}

TEST(IdentityUseTest, CountsRefusalsByLimit) {
  IdentityUse use(Few());
  for (int i = 0; i < 4; ++i) use.NoteStrangerCall("192.0.2.7", kNow).IgnoreError();
  use.BeginUpload(kAnna, 1001, kNow).IgnoreError();
  use.NoteRefused(IdentityLimit::kConnections);
  EXPECT_THAT(use.Refused(), testing::ElementsAre(0, 2, 0, 1, 1, 0));
  EXPECT_STREQ(IdentityLimitName(IdentityLimit::kUploadBytes), "upload_bytes");
}

}  // namespace
}  // namespace sheaf::coordinator
