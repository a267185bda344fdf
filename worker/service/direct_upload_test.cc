// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "worker/service/direct_upload.h"

#include "common/objects/s3_objects.h"
#include "gtest/gtest.h"
#include "tests/support/farm/s3_test_server.h"

namespace sheaf::worker {
namespace {

using FaultKind = S3TestServer::FaultKind;

FinishedPart PartOf(const std::string& bytes) {
  FinishedPart part;
  part.exr_bytes = bytes;
  part.digest = {Sha256Hex(bytes), bytes.size()};
  return part;
}

class DirectUploadTest : public ::testing::Test {
 protected:
  DirectUploadTest() { upload_.SetWanted(true); }

  std::vector<bool> Store(const std::vector<const FinishedPart*>& parts) {
    return upload_.Store(parts, [this](const std::vector<const FinishedPart*>& planned) {
      std::vector<PutTicket> tickets;
      for (const FinishedPart* part : planned) {
        tickets.push_back(*objects_.TicketToPut(
            part->digest.sha256_hex, {part->digest.sha256_hex, part->digest.size_bytes}));
      }
      return tickets;
    });
  }

  S3TestServer fake_;
  S3Server server_{fake_.Options()};
  S3Objects objects_{&server_, "parts"};
  DirectUpload upload_{""};
  const FinishedPart large_ = PartOf(std::string(kDirectUploadBytesMin, 'a'));
  const FinishedPart other_ = PartOf(std::string(kDirectUploadBytesMin + 1, 'b'));
  const FinishedPart small_ = PartOf("small");
};

TEST_F(DirectUploadTest, StoresLargeResults) {
  EXPECT_EQ(Store({&large_, &small_, &other_}), (std::vector<bool>{true, false, true}));
  EXPECT_EQ(fake_.objects().size(), 2u);
  EXPECT_EQ(fake_.objects().at("p/parts/" + other_.digest.sha256_hex), other_.exr_bytes);
}

TEST_F(DirectUploadTest, RepeatsWhatPasses) {
  fake_.Cause({"PUT", FaultKind::kStatus, 503, "SlowDown"});
  fake_.Cause({"PUT", FaultKind::kReset});
  EXPECT_EQ(Store({&large_}), std::vector<bool>{true});
}

TEST_F(DirectUploadTest, LeavesItToTheCoordinatorAfterARefusal) {
  fake_.Cause({"PUT", FaultKind::kStatus, 403, "AccessDenied"});
  EXPECT_EQ(Store({&large_, &other_}), (std::vector<bool>{false, false}));
  const int before = fake_.request_count();
  EXPECT_EQ(Store({&large_}), std::vector<bool>{false});
  EXPECT_EQ(fake_.request_count(), before);
}

TEST_F(DirectUploadTest, DoesNothingUnasked) {
  upload_.SetWanted(false);
  EXPECT_EQ(Store({&large_}), std::vector<bool>{false});
  upload_.SetWanted(true);
  upload_.Abort();
  EXPECT_EQ(Store({&large_}), std::vector<bool>{false});
  EXPECT_EQ(fake_.request_count(), 0);
}

}  // namespace
}  // namespace sheaf::worker
