// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Blobs from other workers: their bytes are taken only if they are the blob's, whoever lies, ends
// early, is busy or is gone; the coordinator has the rest.
#include "worker/service/blob_fetcher.h"

#include <grpcpp/security/server_credentials.h>
#include <grpcpp/server.h>
#include <grpcpp/server_builder.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <chrono>
#include <memory>
#include <random>
#include <string>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "common/base/digest.h"
#include "common/content/chunk_codec.h"
#include "sheaf/v1/peer.grpc.pb.h"

namespace sheaf::worker {
namespace {

std::string RandomBytes(size_t size) {
  std::mt19937_64 random(size);
  std::string bytes(size, '\0');
  for (char& byte : bytes) byte = static_cast<char>(random());
  return bytes;
}

void Send(const std::string& bytes, uint64_t offset_bytes,
          grpc::ServerWriter<v1::ReadBlobResponse>* writer) {
  for (size_t at = offset_bytes; at < bytes.size(); at += kBlobChunkBytesMax) {
    v1::ReadBlobResponse response;
    response.set_zstd_chunk(CompressChunk(bytes.substr(at, kBlobChunkBytesMax)));
    if (!writer->Write(response)) return;
  }
}

// A worker that sends what the test says, on loopback.
class FakePeer : public v1::PeerService::Service {
 public:
  explicit FakePeer(std::string name) : name_(std::move(name)) {
    grpc::ServerBuilder builder;
    builder.AddListeningPort("127.0.0.1:0", grpc::InsecureServerCredentials(), &port_);
    builder.RegisterService(this);
    server_ = builder.BuildAndStart();
  }
  ~FakePeer() override { server_->Shutdown(std::chrono::system_clock::now()); }
  v1::Peer Contact() const {
    v1::Peer peer;
    peer.set_worker_id(name_);
    peer.set_address(absl::StrCat("127.0.0.1:", port_));
    return peer;
  }
  grpc::Status ReadPeerBlob(grpc::ServerContext* /*context*/, const v1::ReadBlobRequest* request,
                            grpc::ServerWriter<v1::ReadBlobResponse>* writer) override {
    ++calls;
    Send(bytes, request->offset_bytes(), writer);
    return answer;
  }
  std::string bytes;
  grpc::Status answer;
  int calls = 0;

 private:
  const std::string name_;
  int port_ = 0;
  std::unique_ptr<grpc::Server> server_;
};

// A coordinator that has one blob and names peers of it.
class FakeCoordinator : public v1::ContentService::Service, public v1::TransferService::Service {
 public:
  grpc::Status ReadBlob(grpc::ServerContext* /*context*/, const v1::ReadBlobRequest* request,
                        grpc::ServerWriter<v1::ReadBlobResponse>* writer) override {
    sent_bytes += bytes.size() - request->offset_bytes();
    Send(bytes, request->offset_bytes(), writer);
    return grpc::Status::OK;
  }
  grpc::Status LocateBlob(grpc::ServerContext* /*context*/, const v1::LocateBlobRequest* request,
                          v1::LocateBlobResponse* response) override {
    if (waits-- > 0) return grpc::Status::OK;  // Neither: ask again.
    for (const v1::Peer& peer : peers) {
      const auto& tried = request->tried();
      if (std::find(tried.begin(), tried.end(), peer.worker_id()) == tried.end()) {
        *response->add_peers() = peer;
      }
    }
    response->set_from_coordinator(response->peers().empty());
    for (size_t at = 0; at < bytes.size(); at += kChunkBytesMax) {
      const std::string chunk = bytes.substr(at, kChunkBytesMax);
      v1::Chunk* wire = response->add_chunks();
      const std::string hex = Sha256Hex(chunk);
      for (size_t i = 0; i < hex.size(); i += 2) {
        wire->mutable_sha256()->push_back(
            static_cast<char>(std::stoi(hex.substr(i, 2), nullptr, 16)));
      }
      wire->set_size_bytes(static_cast<uint32_t>(chunk.size()));
    }
    return grpc::Status::OK;
  }
  grpc::Status ReportContent(grpc::ServerContext* /*context*/,
                             const v1::ReportContentRequest* request,
                             v1::ReportContentResponse* /*response*/) override {
    const MutexLock lock(&mutex);
    counts = request->counts();
    for (const v1::PeerTrouble& trouble : request->troubles()) {
      troubles.emplace_back(trouble.worker_id(), trouble.kind());
    }
    return grpc::Status::OK;
  }
  std::string bytes;
  std::vector<v1::Peer> peers;
  int waits = 0;
  uint64_t sent_bytes = 0;
  Mutex mutex;
  v1::ContentCounts counts;
  std::vector<std::pair<std::string, v1::PeerTrouble::Kind>> troubles;
};

class BlobFetcherTest : public ::testing::Test {
 protected:
  BlobFetcherTest() {
    grpc::ServerBuilder builder;
    builder.RegisterService(static_cast<v1::ContentService::Service*>(&coordinator_));
    builder.RegisterService(static_cast<v1::TransferService::Service*>(&coordinator_));
    server_ = builder.BuildAndStart();
    auto blobs = BlobStore::Open(::testing::TempDir() + "/blob_fetcher");
    blobs_ = *std::move(blobs);
    coordinator_.bytes = RandomBytes(9 << 20);
    for (FakePeer* peer : {&one_, &two_}) {
      peer->bytes = coordinator_.bytes;
      coordinator_.peers.push_back(peer->Contact());
    }
  }
  // Fetches the blob of which `there` bytes are there, and ends the worker.
  absl::Status Fetch(size_t there = 0) {
    const BlobDigest blob{Sha256Hex(coordinator_.bytes), coordinator_.bytes.size()};
    got_ = coordinator_.bytes.substr(0, there);
    PeerOptions options;
    options.enabled = true;
    PeerExchange exchange(server_->InProcessChannel({}), "me", options, blobs_.get());
    BlobFetcher fetcher(server_->InProcessChannel({}), &exchange);
    return fetcher.Fetch(blob, there,
                         [this](std::string_view bytes) {
                           got_ += bytes;
                           return absl::OkStatus();
                         },
                         {});
  }
  void ExpectWhole(const absl::Status& status) {
    EXPECT_TRUE(status.ok()) << status;
    EXPECT_TRUE(got_ == coordinator_.bytes);
  }
  using Troubles = std::vector<std::pair<std::string, v1::PeerTrouble::Kind>>;

  FakeCoordinator coordinator_;
  std::unique_ptr<grpc::Server> server_;
  std::unique_ptr<BlobStore> blobs_;
  FakePeer one_{"one"}, two_{"two"};
  std::string got_;
};

TEST_F(BlobFetcherTest, AllBytesComeFromAPeer) {
  coordinator_.waits = 2;
  ExpectWhole(Fetch());
  EXPECT_EQ(coordinator_.sent_bytes, 0U);
  EXPECT_EQ(coordinator_.counts.peer_bytes(), coordinator_.bytes.size());
  EXPECT_EQ(coordinator_.counts.peer_blobs(), 1U);
  EXPECT_EQ(two_.calls, 0);
  ExpectWhole(Fetch((5 << 20) + 17));  // Within a chunk.
  EXPECT_EQ(coordinator_.sent_bytes, 0U);
}

TEST_F(BlobFetcherTest, ALiarCostsARetryAndIsToldOf) {
  one_.bytes[(6 << 20) + 5] ^= 1;
  ExpectWhole(Fetch());
  EXPECT_EQ(coordinator_.sent_bytes, 0U);
  EXPECT_EQ(coordinator_.troubles, (Troubles{{"one", v1::PeerTrouble::KIND_WRONG_BYTES}}));
  two_.bytes = RandomBytes(9 << 20);
  two_.bytes[0] ^= 1;
  ExpectWhole(Fetch());
  EXPECT_LE(coordinator_.sent_bytes, coordinator_.bytes.size() - kChunkBytesMax)
      << "the first chunk of the first peer was right";
}

TEST_F(BlobFetcherTest, PeersThatAreBusyGoneOrEndEarlyAreLeft) {
  one_.answer = {grpc::StatusCode::RESOURCE_EXHAUSTED, "busy"};
  one_.bytes = "";
  two_.bytes.resize(5 << 20);
  ExpectWhole(Fetch());
  EXPECT_EQ(coordinator_.troubles, (Troubles{{"one", v1::PeerTrouble::KIND_REFUSED},
                                             {"two", v1::PeerTrouble::KIND_UNREACHABLE}}));
  EXPECT_EQ(coordinator_.sent_bytes, coordinator_.bytes.size() - kChunkBytesMax);
  EXPECT_EQ(coordinator_.counts.coordinator_bytes(), coordinator_.sent_bytes);
  EXPECT_EQ(coordinator_.counts.coordinator_blobs(), 1U);
}

TEST_F(BlobFetcherTest, SmallBlobsComeFromTheCoordinator) {
  coordinator_.bytes = "small";
  ExpectWhole(Fetch());
  EXPECT_EQ(one_.calls + two_.calls, 0);
  EXPECT_EQ(coordinator_.sent_bytes, 5U);
}

}  // namespace
}  // namespace sheaf::worker
