// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "coordinator/access/page_sessions.h"

#include <gtest/gtest.h>

#include <atomic>
#include <latch>
#include <thread>
#include <vector>

#include "absl/strings/str_cat.h"

namespace sheaf::coordinator {
namespace {

const absl::Time kSessionTime = absl::FromUnixSeconds(1'800'000'000);
const PageUser kPageUser{{IdentityKind::kUser, "anna"}, 2};

TEST(PageSecretsTest, StandForTheirUserUntilTheyExpire) {
  PageSecrets secrets(absl::Minutes(5));
  const std::string secret = secrets.Make(kPageUser, kSessionTime);
  EXPECT_EQ(secret.size(), 43u) << "256 bits in base64url";
  ASSERT_TRUE(secrets.Find(secret, kSessionTime + absl::Minutes(4)));
  EXPECT_EQ(secrets.Find(secret, kSessionTime)->id, kPageUser.id);
  EXPECT_EQ(secrets.Find(secret, kSessionTime)->generation, 2u);
  EXPECT_FALSE(secrets.Find(secret, kSessionTime + absl::Minutes(5)));
  EXPECT_FALSE(secrets.Find("", kSessionTime));
}

TEST(PageSecretsTest, OneOfManyConcurrentTakersGetsASecret) {
  PageSecrets secrets(absl::Minutes(5));
  const std::string secret = secrets.Make(kPageUser, kSessionTime);
  constexpr int kTakers = 16;
  std::atomic<int> taken{0};
  std::latch together(kTakers);
  {
    std::vector<std::jthread> threads;
    for (int i = 0; i < kTakers; ++i) {
      threads.emplace_back([&] {
        together.arrive_and_wait();
        if (secrets.Take(secret, kSessionTime)) ++taken;
      });
    }
  }
  EXPECT_EQ(taken, 1);
}

TEST(PageSecretsTest, NobodyPushesOthersOut) {
  PageSecrets secrets(absl::Minutes(5));
  const std::string others = secrets.Make({{IdentityKind::kUser, "ben"}, 1}, kSessionTime);
  const std::string first = secrets.Make(kPageUser, kSessionTime);
  for (size_t i = 0; i < kPageSecretsOfIdentityMax; ++i) {
    secrets.Make(kPageUser, kSessionTime + absl::Seconds(1));
  }
  EXPECT_FALSE(secrets.Find(first, kSessionTime)) << "her oldest one has made room";
  EXPECT_TRUE(secrets.Find(others, kSessionTime));
}

}  // namespace
}  // namespace sheaf::coordinator
