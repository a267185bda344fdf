// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Where workers are told to fetch a blob: one from the coordinator, the others from its holders. No
// worker waits for one that is gone or asks one that lies.
#include "coordinator/core/policy/peer_directory.h"

#include <gtest/gtest.h>

#include "absl/strings/str_cat.h"

namespace sheaf::coordinator {
namespace {

class PeerDirectoryTest : public ::testing::Test {
 protected:
  static PeerContact Contact(const std::string& id) {
    return {id, absl::StrCat(id, ".example:7"), absl::StrCat("worker:", id)};
  }
  void Report(const std::string& id, const std::vector<std::string>& held = {},
              const std::vector<std::string>& fetching = {}) {
    directory_.Report(Contact(id), held, fetching, now_);
  }
  PeerAnswer Locate(const std::string& id, const std::set<std::string>& tried = {}) {
    return directory_.Locate("blob", id, /*serves=*/true, tried, now_);
  }
  static bool IsWait(const PeerAnswer& answer) {
    return answer.peers.empty() && !answer.from_coordinator;
  }

  PeerDirectory directory_;
  SteadyTime now_ = SteadyTime() + absl::Hours(1);
};

TEST_F(PeerDirectoryTest, OneFetchesFromTheCoordinatorAndTheOthersFromIt) {
  for (const char* id : {"a", "b", "c"}) Report(id);
  EXPECT_TRUE(Locate("a").from_coordinator);
  EXPECT_TRUE(Locate("a").from_coordinator) << "the answer may be lost";
  EXPECT_TRUE(IsWait(Locate("b")));
  Report("a", {"blob"});
  EXPECT_EQ(Locate("b").peers, std::vector{Contact("a")});
  Report("b", {"blob"});
  // The load spreads: b has been named less often.
  EXPECT_EQ(Locate("c").peers, (std::vector{Contact("b"), Contact("a")}));
  EXPECT_EQ(Locate("c", {"a", "b"}).from_coordinator, true);
  EXPECT_EQ(directory_.CountServing(now_), 3U);
}

TEST_F(PeerDirectoryTest, NobodyWaitsForAWorkerThatFallsSilent) {
  Report("a");
  Report("b");
  EXPECT_TRUE(Locate("a").from_coordinator);
  now_ += kFetchSilenceMax;
  Report("a", {}, {"blob"});
  now_ += kFetchSilenceMax;
  EXPECT_TRUE(IsWait(Locate("b"))) << "it reports progress";
  now_ += absl::Seconds(1);
  EXPECT_TRUE(Locate("b").from_coordinator);
  EXPECT_TRUE(IsWait(Locate("a"))) << "the other brings it now";
}

TEST_F(PeerDirectoryTest, WorkersThatServeNothingAreNotWaitedFor) {
  EXPECT_TRUE(directory_.Locate("blob", "x", /*serves=*/false, {}, now_).from_coordinator);
  EXPECT_TRUE(Locate("a").from_coordinator);
  directory_.Report({"x", "", ""}, {"blob"}, {}, now_);
  EXPECT_TRUE(IsWait(Locate("b"))) << "x has it and does not serve";
}

TEST_F(PeerDirectoryTest, HoldersThatAreGoneOrFailedAreNotAsked) {
  Report("a", {"blob"});
  Report("c", {"blob"});
  EXPECT_EQ(Locate("b", {"a"}).peers, std::vector{Contact("c")});
  directory_.NoteTrouble("c", "blob", PeerTroubleKind::kUnreachable, "b", now_);
  EXPECT_EQ(Locate("b").peers, std::vector{Contact("a")});
  directory_.NoteTrouble("a", "blob", PeerTroubleKind::kRefused, "b", now_);
  EXPECT_EQ(Locate("b").peers, std::vector{Contact("a")}) << "it was busy";
  now_ += kPeerSilenceMax + absl::Seconds(1);
  EXPECT_TRUE(Locate("b").from_coordinator);
}

TEST_F(PeerDirectoryTest, ALiarIsShunnedOnceSeveralSaySo) {
  const std::vector<std::string> all = {"blob", "2", "3", "other"};
  Report("liar", all);
  int blob = 0;
  for (const char* accuser : {"a", "a", "b"}) {
    directory_.NoteTrouble("liar", all[static_cast<size_t>(blob++)], PeerTroubleKind::kWrongBytes,
                           accuser, now_);
  }
  EXPECT_TRUE(directory_.Locate("blob", "b", true, {}, now_).from_coordinator);
  EXPECT_EQ(directory_.Locate("other", "b", true, {}, now_).peers.size(), 1U)
      << "two accusers may be wrong themselves";
  directory_.NoteTrouble("liar", "other", PeerTroubleKind::kWrongBytes, "c", now_);
  Report("liar", all);
  EXPECT_TRUE(directory_.Locate("other", "b", true, {}, now_).peers.empty());
  now_ += kShunnedTime;
  Report("liar", all);
  EXPECT_EQ(directory_.Locate("other", "b", true, {}, now_).peers.size(), 1U);
}

TEST_F(PeerDirectoryTest, WhatItRemembersIsBounded) {
  std::vector<std::string> many;
  for (size_t i = 0; i < 2 * kHoldersPerBlobMax; ++i) Report(absl::StrCat("w", i), {"blob"});
  EXPECT_EQ(Locate("a").peers.size(), kPeersAnsweredMax);
  for (size_t i = 0; i <= kDirectoryBlobsMax; ++i) many.push_back(absl::StrCat(i));
  Report("a", many);
  EXPECT_LE(directory_.blob_count(), kDirectoryBlobsMax);
}

}  // namespace
}  // namespace sheaf::coordinator
