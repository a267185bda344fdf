// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "coordinator/core/frame/lease_token.h"

#include <functional>
#include <vector>

#include "gtest/gtest.h"

namespace sheaf::coordinator {
namespace {

const LeasedWork kWork{7, "w", "0123abcd", {0, 32, 32, 64}, {16, 16}, {8, 5}};

TEST(LeaseTokenTest, TokensProveTheirWorkOnly) {
  const LeaseTokens tokens("secret");
  const std::string token = tokens.Make(kWork);
  EXPECT_EQ(token.size(), 32u);
  EXPECT_TRUE(tokens.IsValid(kWork, token));
  const std::vector<std::function<void(LeasedWork*)>> changes = {
      [](LeasedWork* work) { work->lease_id = 8; },
      [](LeasedWork* work) { work->identity = "v"; },
      [](LeasedWork* work) { work->frame_digest = "0123abce"; },
      [](LeasedWork* work) { work->tile.x0 = 1; },
      [](LeasedWork* work) { work->tile.y1 = 65; },
      [](LeasedWork* work) {
        work->block = {0, 16};
      },
      [](LeasedWork* work) {
        work->block = {16, 32};
      },
      [](LeasedWork* work) { work->cells.mask = 4; },
      [](LeasedWork* work) { work->cells = {}; },
      [](LeasedWork* work) { work->kind = TaskKind::kLight; },
      [](LeasedWork* work) { work->kind = TaskKind::kTraining; },
  };
  for (size_t i = 0; i < changes.size(); ++i) {
    LeasedWork other = kWork;
    changes[i](&other);
    EXPECT_FALSE(tokens.IsValid(other, token)) << "change " << i;
  }
  EXPECT_FALSE(tokens.IsValid(kWork, ""));
  EXPECT_FALSE(tokens.IsValid(kWork, token.substr(1)));
}

TEST(LeaseTokenTest, OtherSecretsMakeOtherTokens) {
  EXPECT_FALSE(LeaseTokens("one").IsValid(kWork, LeaseTokens("two").Make(kWork)));
}

}  // namespace
}  // namespace sheaf::coordinator
