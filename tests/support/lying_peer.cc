// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// A worker that says it holds blobs and sends wrong bytes for them, for tests of those who ask it:
//
//     sheaf_lying_peer COORDINATOR HEX ...
//
// It renders nothing, and runs until it is killed.
#include <grpcpp/client_context.h>
#include <grpcpp/security/server_credentials.h>
#include <grpcpp/server.h>
#include <grpcpp/server_builder.h>

#include <algorithm>
#include <chrono>
#include <cstdio>
#include <memory>
#include <string>
#include <thread>

#include "common/content/blob_store.h"
#include "common/content/chunk_codec.h"
#include "common/rpc/channel.h"
#include "sheaf/v1/peer.grpc.pb.h"
#include "sheaf/v1/transfer.grpc.pb.h"

namespace sheaf {
namespace {

class LyingPeer final : public v1::PeerService::Service {
 public:
  grpc::Status ReadPeerBlob(grpc::ServerContext* /*context*/, const v1::ReadBlobRequest* request,
                            grpc::ServerWriter<v1::ReadBlobResponse>* writer) override {
    const uint64_t size_bytes = request->digest().size_bytes();
    for (uint64_t at = request->offset_bytes(); at < size_bytes; at += kBlobChunkBytesMax) {
      v1::ReadBlobResponse response;
      response.set_zstd_chunk(
          CompressChunk(std::string(std::min(kBlobChunkBytesMax, size_bytes - at), '#')));
      if (!writer->Write(response)) break;
    }
    return grpc::Status::OK;
  }
};

int Main(int argc, char** argv) {
  if (argc < 3) return 2;
  LyingPeer peer;
  int port = 0;
  grpc::ServerBuilder builder;
  builder.AddListeningPort("127.0.0.1:0", grpc::InsecureServerCredentials(), &port);
  builder.RegisterService(&peer);
  const std::unique_ptr<grpc::Server> server = builder.BuildAndStart();
  const auto stub = v1::TransferService::NewStub(MakeChannel(argv[1]));
  while (true) {
    v1::ReportContentRequest request;
    request.set_worker_id("a-liar");
    request.set_peer_port(static_cast<uint32_t>(port));
    for (int i = 2; i < argc; ++i) request.add_held(argv[i]);
    grpc::ClientContext context;
    SetDeadline(&context, kUnaryDeadline);
    v1::ReportContentResponse response;
    if (stub->ReportContent(&context, request, &response).ok()) {
      std::puts("reported");
      std::fflush(stdout);
    }
    std::this_thread::sleep_for(std::chrono::seconds(1));
  }
}

}  // namespace
}  // namespace sheaf

int main(int argc, char** argv) { return sheaf::Main(argc, argv); }
