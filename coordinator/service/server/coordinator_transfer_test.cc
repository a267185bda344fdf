// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Uploads over gRPC: many small blobs in a call, large ones by chunks, and one that is interrupted
// by the coordinator's restart.
#include <random>
#include <string>
#include <vector>

#include "absl/strings/str_cat.h"
#include "common/base/digest.h"
#include "common/base/file.h"
#include "common/content/chunk_codec.h"
#include "common/content/chunk_cutter.h"
#include "common/rpc/chunk_list_codec.h"
#include "common/rpc/grpc_status.h"
#include "gtest/gtest.h"
#include "tests/support/farm/coordinator_server_fixture.h"

namespace sheaf::coordinator {
namespace {

class CoordinatorTransferTest : public CoordinatorServerTest {
 protected:
  void Restart() {
    Start();
    stub_ = v1::TransferService::NewStub(server_->InProcessChannel());
  }
  static void SetDigest(const BlobDigest& digest, v1::Digest* wire) {
    wire->set_sha256_hex(digest.sha256_hex);
    wire->set_size_bytes(digest.size_bytes);
  }
  ChunkList Cut(const std::string& bytes) const {
    const std::string path = directory_ + "/a file";
    EXPECT_TRUE(WriteFileOnce(path, bytes).ok());
    return CutFile(path).value_or(ChunkList{});
  }
  v1::PlanWriteResponse Plan(const ChunkList& list) {
    grpc::ClientContext context;
    v1::PlanWriteRequest request;
    SetDigest(list.blob, request.mutable_digest());
    ChunksToWire(list, request.mutable_chunks());
    v1::PlanWriteResponse plan;
    EXPECT_TRUE(stub_->PlanWrite(&context, request, &plan).ok());
    return plan;
  }
  // Sends the first count of the chunks that are missing.
  grpc::Status Send(const std::string& bytes, const ChunkList& list, int count) {
    const v1::PlanWriteResponse plan = Plan(list);
    grpc::ClientContext context;
    v1::WriteChunksResponse response;
    const auto writer = stub_->WriteChunks(&context, &response);
    v1::WriteChunksRequest first;
    SetDigest(list.blob, first.mutable_digest());
    ChunksToWire(list, first.mutable_chunks());
    first.set_offset_bytes(plan.offset_bytes());
    writer->Write(first);
    for (int i = 0; i < std::min(count, plan.missing_size()); ++i) {
      uint64_t offset = 0;
      for (uint32_t c = 0; c < plan.missing(i); ++c) offset += list.chunks[c].size_bytes;
      v1::WriteChunksRequest chunk;
      chunk.set_index(plan.missing(i));
      chunk.set_zstd_chunk(
          CompressChunk(bytes.substr(offset, list.chunks[plan.missing(i)].size_bytes)));
      writer->Write(chunk);
    }
    writer->WritesDone();
    return writer->Finish();
  }

  std::unique_ptr<v1::TransferService::Stub> stub_;
};

TEST_F(CoordinatorTransferTest, ManySmallBlobsComeInOneCall) {
  Restart();
  v1::WriteSmallBlobsRequest request;
  std::string bytes;
  std::vector<BlobDigest> digests;
  for (int i = 0; i < 3000; ++i) {
    const std::string one = absl::StrCat(i);
    digests.push_back({Sha256Hex(one), one.size()});
    SetDigest(digests.back(), request.add_digests());
    bytes += one;
  }
  request.set_zstd_bytes(CompressChunk(bytes));
  grpc::ClientContext context;
  v1::WriteSmallBlobsResponse response;
  const grpc::Status status = stub_->WriteSmallBlobs(&context, request, &response);
  ASSERT_TRUE(status.ok()) << status.error_message();
  EXPECT_TRUE(server_->farm().blobs().FindMissing(digests)->empty());
  EXPECT_EQ(Counter("sheaf_content_received_bytes_total"), bytes.size());
}

TEST_F(CoordinatorTransferTest, AnInterruptedUploadGoesOnAfterARestart) {
  Restart();
  std::mt19937_64 random(1);
  std::string bytes(10 << 20, '\0');
  for (char& byte : bytes) byte = static_cast<char>(random());
  const ChunkList list = Cut(bytes);
  EXPECT_FALSE(Send(bytes, list, 3).ok()) << "omitted chunks are not stored anywhere";
  Restart();
  EXPECT_EQ(Plan(list).missing_size(), static_cast<int>(list.chunks.size()) - 3);
  const grpc::Status status = Send(bytes, list, INT32_MAX);
  ASSERT_TRUE(status.ok()) << status.error_message();
  EXPECT_TRUE(Plan(list).complete());
  EXPECT_TRUE(server_->farm().blobs().Verify(list.blob).ok());
  // Another version takes from it what is equal.
  bytes[5 << 20] ^= 1;
  const ChunkList changed = Cut(bytes);
  EXPECT_LE(Plan(changed).missing_size(), 2);
  ASSERT_TRUE(Send(bytes, changed, INT32_MAX).ok());
  EXPECT_GE(Counter("sheaf_content_reused_bytes_total"), 4 << 20);
  EXPECT_TRUE(server_->farm().blobs().Verify(changed.blob).ok());
}

// Counts only grow, as reports may overtake each other; what is in memory now may fall.
TEST_F(CoordinatorTransferTest, PagesOfVolumesAreCounted) {
  Restart();
  const auto report = [this](const char* worker, uint64_t read, uint64_t resident_bytes) {
    grpc::ClientContext context;
    v1::ReportContentRequest request;
    request.set_worker_id(worker);
    request.mutable_counts()->set_volume_pages_read(read);
    request.mutable_counts()->set_volume_pages_found(10 * read);
    request.mutable_counts()->set_volume_part_bytes(1'000 * read);
    request.mutable_counts()->set_volume_resident_bytes(resident_bytes);
    v1::ReportContentResponse response;
    EXPECT_TRUE(stub_->ReportContent(&context, request, &response).ok());
  };
  report("one", 5, 700);
  report("two", 3, 40);
  report("one", 9, 60);
  report("one", 7, 60);
  EXPECT_EQ(Counter("sheaf_volume_part_bytes_total"), 12'000);
  EXPECT_EQ(Counter("sheaf_volume_resident_bytes"), 100);
  double pages = 0;
  for (const MetricView& metric : server_->farm().view().Metrics()) {
    if (metric.name == "sheaf_volume_pages_total") pages += metric.value;
  }
  EXPECT_EQ(pages, 12 + 120);
}

TEST_F(CoordinatorTransferTest, MalformedRequestsAreRefused) {
  Restart();
  grpc::ClientContext one, two, three;
  v1::PlanWriteRequest plan;
  SetDigest({Sha256Hex("x"), 100}, plan.mutable_digest());
  v1::PlanWriteResponse planned;
  EXPECT_EQ(stub_->PlanWrite(&one, plan, &planned).error_code(),
            grpc::StatusCode::INVALID_ARGUMENT);
  v1::ReportContentRequest report;
  report.set_worker_id("w");
  report.add_held("not a digest");
  v1::ReportContentResponse reported;
  EXPECT_EQ(stub_->ReportContent(&two, report, &reported).error_code(),
            grpc::StatusCode::INVALID_ARGUMENT);
  v1::LocateBlobRequest locate;
  SetDigest({Sha256Hex("x"), 100}, locate.mutable_digest());
  v1::LocateBlobResponse located;
  EXPECT_EQ(stub_->LocateBlob(&three, locate, &located).error_code(),
            grpc::StatusCode::INVALID_ARGUMENT);
}

}  // namespace
}  // namespace sheaf::coordinator
