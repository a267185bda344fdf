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

const absl::Time kNow = absl::FromUnixSeconds(1'800'000'000);
const PageUser kAnna{{IdentityKind::kUser, "anna"}, 2};

TEST(PageSecretsTest, StandForTheirUserUntilTheyExpire) {
  PageSecrets secrets(absl::Minutes(5));
  const std::string secret = secrets.Make(kAnna, kNow);
  EXPECT_EQ(secret.size(), 43u) << "256 bits in base64url";
  ASSERT_TRUE(secrets.Find(secret, kNow + absl::Minutes(4)));
  EXPECT_EQ(secrets.Find(secret, kNow)->id, kAnna.id);
  EXPECT_EQ(secrets.Find(secret, kNow)->generation, 2u);
  EXPECT_FALSE(secrets.Find(secret, kNow + absl::Minutes(5)));
  EXPECT_FALSE(secrets.Find("", kNow));
}

TEST(PageSecretsTest, OneOfManyConcurrentTakersGetsASecret) {
  PageSecrets secrets(absl::Minutes(5));
  const std::string secret = secrets.Make(kAnna, kNow);
  constexpr int kTakers = 16;
  std::atomic<int> taken{0};
  std::latch together(kTakers);
  {
    std::vector<std::jthread> threads;
    for (int i = 0; i < kTakers; ++i) {
      threads.emplace_back([&] {
        together.arrive_and_wait();
        if (secrets.Take(secret, kNow)) ++taken;
      });
    }
  }
  EXPECT_EQ(taken, 1);
}

TEST(PageSecretsTest, NobodyPushesOthersOut) {
  PageSecrets secrets(absl::Minutes(5));
  const std::string others = secrets.Make({{IdentityKind::kUser, "ben"}, 1}, kNow);
  const std::string first = secrets.Make(kAnna, kNow);
  for (size_t i = 0; i < kPageSecretsOfIdentityMax; ++i) {
    secrets.Make(kAnna, kNow + absl::Seconds(1));
  }
  EXPECT_FALSE(secrets.Find(first, kNow)) << "her oldest one has made room";
  EXPECT_TRUE(secrets.Find(others, kNow));
}

}  // namespace
}  // namespace sheaf::coordinator
