// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "common/rpc/protocol_version.h"

#include <string>
#include <vector>

#include "gtest/gtest.h"

namespace sheaf {
namespace {

TEST(ProtocolVersionTest, BothSidesSpeakTheNewestThatBothUnderstand) {
  struct Case {
    ProtocolRange client, coordinator;
    int agreed;
  };
  const std::vector<Case> cases = {
      {{1, 1}, {1, 2}, 1},  // A client of the first version.
      {{1, 2}, {1, 1}, 1},  // A coordinator of the first version.
      {{1, 2}, {1, 2}, 2},  // The same.
      {{4, 5}, {5, 6}, 5},  // An older neighbour calls.
      {{5, 6}, {4, 5}, 5},  // A newer one does.
      {{3, 3}, {1, 9}, 3},  // One version among many.
      {{2, 7}, {5, 9}, 7},
  };
  for (const Case& c : cases) {
    const absl::StatusOr<int> agreed = AgreeOnProtocol(c.client, c.coordinator);
    ASSERT_TRUE(agreed.ok()) << agreed.status();
    EXPECT_EQ(*agreed, c.agreed) << FormatProtocol(c.client) << ' '
                                 << FormatProtocol(c.coordinator);
  }
}

TEST(ProtocolVersionTest, OthersAreRefusedInWords) {
  struct Case {
    ProtocolRange client, coordinator;
    std::string words;
  };
  const std::vector<Case> cases = {
      {{1, 1},
       {2, 3},
       "this program speaks version 1 of Sheaf's protocol, and the coordinator versions 2 to 3: "
       "this program is older; install the coordinator's release here"},
      {{2, 3},
       {1, 1},
       "this program speaks versions 2 to 3 of Sheaf's protocol, and the coordinator version 1: "
       "the coordinator's program is older; update it, or use its release here meanwhile"},
  };
  for (const Case& c : cases) {
    const absl::Status status = AgreeOnProtocol(c.client, c.coordinator).status();
    EXPECT_TRUE(absl::IsFailedPrecondition(status)) << status;
    EXPECT_EQ(status.message(), c.words);
  }
}

TEST(ProtocolVersionTest, RangesSurviveTheirText) {
  for (const ProtocolRange& range : {kProtocol, ProtocolRange{0, 0}, ProtocolRange{3, 3},
                                     ProtocolRange{12, kProtocolVersionMax}}) {
    const absl::StatusOr<ProtocolRange> parsed = ParseProtocol(FormatProtocol(range));
    ASSERT_TRUE(parsed.ok()) << parsed.status();
    EXPECT_EQ(*parsed, range);
  }
  const absl::StatusOr<ProtocolRange> of_none = ParseProtocol("");
  ASSERT_TRUE(of_none.ok());
  EXPECT_EQ(*of_none, (ProtocolRange{1, 1})) << "a tool speaks the first version";
}

TEST(ProtocolVersionTest, MalformedRangesAreRefused) {
  for (const std::string text :
       {"1", "-", "1-", "-1", "2-1", "0-1-2", " 0-1", "0-1 ", "0-+1", "a-b", "0x1-2", "0-1000000",
        "0-99999999999999999999", "0-1,0-1", "0--1", "\n"}) {
    const absl::Status status = ParseProtocol(text).status();
    EXPECT_TRUE(absl::IsFailedPrecondition(status)) << text;
    EXPECT_EQ(std::string(status.message()).find('\n'), std::string::npos) << "printed raw";
  }
}

TEST(ProtocolVersionTest, TheseProgramsUnderstandTheirNeighbour) {
  EXPECT_LE(kOldestProtocolVersion, kProtocolVersion);
  EXPECT_TRUE(AgreeOnProtocol(kProtocol, {1, kOldestProtocolVersion}).ok());
  EXPECT_TRUE(AgreeOnProtocol({kProtocolVersion, kProtocolVersion + 1}, kProtocol).ok());
}

}  // namespace
}  // namespace sheaf
