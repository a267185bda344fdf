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

using ::testing::HasSubstr;

const absl::Time kLimitsTime = absl::FromUnixSeconds(1'800'000'000);
const IdentityId kLimitedUser{IdentityKind::kUser, "anna"};
const IdentityId kBen{IdentityKind::kUser, "ben"};
const IdentityId kLimitedWorker{IdentityKind::kWorker, "node7"};

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
  for (int i = 0; i < 20; ++i) ASSERT_TRUE(use.NoteCall(kLimitedUser, kLimitsTime).ok()) << i;
  const absl::Status refused = use.NoteCall(kLimitedUser, kLimitsTime);
  EXPECT_TRUE(absl::IsResourceExhausted(refused));
  EXPECT_THAT(std::string(refused.message()), HasSubstr("10 a second"));
  EXPECT_EQ(RetryAfterOf(refused), absl::Seconds(1)) << refused;
  EXPECT_TRUE(use.NoteCall(kBen, kLimitsTime).ok()) << "others are not held up";
  int later = 0;
  while (use.NoteCall(kLimitedUser, kLimitsTime + absl::Milliseconds(550)).ok()) ++later;
  EXPECT_EQ(later, 5);
}

TEST(IdentityUseTest, AClockThatIsSetBackGivesNoCallsAndTakesNone) {
  IdentityUse use(Few());
  for (int i = 0; i < 20; ++i) ASSERT_TRUE(use.NoteCall(kLimitedUser, kLimitsTime).ok()) << i;
  EXPECT_FALSE(use.NoteCall(kLimitedUser, kLimitsTime - absl::Hours(1)).ok());
  EXPECT_TRUE(use.NoteCall(kLimitedUser, kLimitsTime + absl::Milliseconds(100)).ok());
}

TEST(IdentityUseTest, StrangersOfANetworkOfIpv6ShareALimit) {
  IdentityUse use(Few());
  EXPECT_TRUE(use.NoteStrangerCall("2001:db8::1", kLimitsTime).ok());
  EXPECT_TRUE(use.NoteStrangerCall("ipv6:%5B2001:db8::2%5D", kLimitsTime).ok());
  const absl::Status refused = use.NoteStrangerCall("2001:db8::3", kLimitsTime);
  EXPECT_TRUE(absl::IsResourceExhausted(refused));
  EXPECT_THAT(std::string(refused.message()), HasSubstr("2001:db8::/64"));
  EXPECT_TRUE(use.NoteStrangerCall("2001:db8:0:1::1", kLimitsTime).ok());
}

TEST(IdentityUseTest, StrangersAreLimitedByAddress) {
  IdentityUse use(Few());
  EXPECT_TRUE(use.NoteStrangerCall("192.0.2.7", kLimitsTime).ok());
  EXPECT_TRUE(use.NoteStrangerCall("192.0.2.7", kLimitsTime).ok());
  const absl::Status refused = use.NoteStrangerCall("192.0.2.7", kLimitsTime);
  EXPECT_TRUE(absl::IsResourceExhausted(refused));
  EXPECT_EQ(RetryAfterOf(refused), absl::Seconds(1)) << refused;
  EXPECT_TRUE(use.NoteStrangerCall("192.0.2.8", kLimitsTime).ok());
}

TEST(IdentityUseTest, ForgetsAddressesWhenThereAreTooMany) {
  IdentityUse use(Few());
  while (use.NoteStrangerCall("192.0.2.7", kLimitsTime).ok()) {
  }
  for (size_t i = 1; i < kStrangerAddressesMax; ++i) {
    ASSERT_TRUE(use.NoteStrangerCall(absl::StrCat("other", i), kLimitsTime).ok());
  }
  EXPECT_FALSE(use.NoteStrangerCall("192.0.2.7", kLimitsTime).ok());
  EXPECT_TRUE(use.NoteStrangerCall("one more", kLimitsTime).ok());
  EXPECT_TRUE(use.NoteStrangerCall("192.0.2.7", kLimitsTime).ok());
}

TEST(IdentityUseTest, LimitsOpenStreams) {
  IdentityUse use(Few());
  std::optional<IdentityUse::Stream> first(*use.OpenStream(kLimitedUser));
  const IdentityUse::Stream second = *use.OpenStream(kLimitedUser);
  const absl::Status refused = use.OpenStream(kLimitedUser).status();
  EXPECT_TRUE(absl::IsResourceExhausted(refused));
  EXPECT_FALSE(RetryAfterOf(refused)) << "their ends are unknown";
  EXPECT_TRUE(use.OpenStream(kBen).ok());
  first.reset();
  EXPECT_TRUE(use.OpenStream(kLimitedUser).ok());
  EXPECT_TRUE(use.OpenStream(kLimitedUser).ok()) << "the one before has ended";
  const IdentityUse::Stream streams[] = {*use.OpenStream(kLimitedWorker),
                                         *use.OpenStream(kLimitedWorker),
                                         *use.OpenStream(kLimitedWorker)};
  EXPECT_FALSE(use.OpenStream(kLimitedWorker).ok());
}

TEST(IdentityUseTest, LimitsTheBytesOfADay) {
  IdentityUse use(Few());
  EXPECT_TRUE(use.BeginUpload(kLimitedUser, 600, kLimitsTime).ok());
  const absl::Status refused = use.BeginUpload(kLimitedUser, 401, kLimitsTime);
  EXPECT_TRUE(absl::IsResourceExhausted(refused));
  EXPECT_THAT(std::string(refused.message()), HasSubstr("1000"));
  EXPECT_TRUE(use.BeginUpload(kLimitedUser, 400, kLimitsTime + absl::Hours(23)).ok());
  EXPECT_FALSE(use.BeginUpload(kLimitedUser, 1, kLimitsTime + absl::Hours(23)).ok());
  EXPECT_TRUE(use.BeginUpload(kLimitedUser, 1000, kLimitsTime + absl::Hours(24)).ok());
}

TEST(IdentityUseTest, BytesThatDidNotComeDoNotCount) {
  IdentityUse use(Few());
  EXPECT_TRUE(use.BeginUpload(kLimitedUser, 1000, kLimitsTime).ok());
  use.ReturnUpload(kLimitedUser, 900);
  EXPECT_TRUE(use.BeginUpload(kLimitedUser, 900, kLimitsTime).ok());
  EXPECT_FALSE(use.BeginUpload(kLimitedUser, 1, kLimitsTime).ok());
}

TEST(IdentityUseTest, CountsRefusalsByLimit) {
  IdentityUse use(Few());
  for (int i = 0; i < 4; ++i) use.NoteStrangerCall("192.0.2.7", kLimitsTime).IgnoreError();
  use.BeginUpload(kLimitedUser, 1001, kLimitsTime).IgnoreError();
  use.NoteRefused(IdentityLimit::kConnections);
  EXPECT_THAT(use.Refused(), ::testing::ElementsAre(0, 2, 0, 1, 1, 0));
  EXPECT_STREQ(IdentityLimitName(IdentityLimit::kUploadBytes), "upload_bytes");
}

}  // namespace
}  // namespace sheaf::coordinator
