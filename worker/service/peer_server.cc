// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "worker/service/peer_server.h"

#include <grpcpp/security/server_credentials.h>
#include <grpcpp/server_builder.h>

#include <algorithm>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "common/content/chunk_codec.h"
#include "common/rpc/channel.h"
#include "common/rpc/grpc_status.h"
#include "common/rpc/peer_credentials.h"
#include "common/rpc/protocol_calls.h"

namespace sheaf::worker {
namespace {

// How long uploads under way may take when the worker ends.
constexpr std::chrono::milliseconds kStopGrace{200};
// A wait is cut into pieces, so that a cancelled call ends soon.
constexpr absl::Duration kTurnPollInterval = absl::Milliseconds(50);

// Counts an upload while it lives.
class Upload {
 public:
  explicit Upload(std::atomic<int>* count) : count_(count), number_(++*count) {}
  ~Upload() { --*count_; }
  Upload(const Upload&) = delete;
  Upload& operator=(const Upload&) = delete;
  bool is_one_too_many() const { return number_ > kPeerUploadsMax; }

 private:
  std::atomic<int>* const count_;
  const int number_;
};

}  // namespace

absl::StatusOr<std::unique_ptr<PeerServer>> PeerServer::Start(const PeerOptions& options,
                                                              const BlobStore* blobs) {
  std::unique_ptr<PeerServer> server(new PeerServer(blobs, options.bytes_per_second_max));
  std::shared_ptr<grpc::ServerCredentials> credentials = grpc::InsecureServerCredentials();
  if (options.files) {
    absl::StatusOr<std::shared_ptr<grpc::ServerCredentials>> tls =
        PeerServerCredentials(*options.files);
    if (!tls.ok()) return tls.status();
    credentials = *std::move(tls);
  }
  const std::string address = absl::StrCat(options.files ? "[::]" : "127.0.0.1", ":", options.port);
  grpc::ServerBuilder builder;
  ApplyServerLimits(&builder);
  std::vector<std::unique_ptr<grpc::experimental::ServerInterceptorFactoryInterface>> interceptors;
  interceptors.push_back(ProtocolOfServer());
  builder.experimental().SetInterceptorCreators(std::move(interceptors));
  builder.AddListeningPort(address, credentials, &server->port_);
  builder.RegisterService(server.get());
  server->server_ = builder.BuildAndStart();
  if (server->server_ != nullptr && server->port_ != 0) return server;
  return absl::UnavailableError(absl::StrCat("cannot serve other workers at ", address,
                                             ": the port is in use; choose another with "
                                             "--peer-port, or none with --no-peers"));
}

PeerServer::~PeerServer() {
  if (server_ == nullptr) return;
  server_->Shutdown(std::chrono::system_clock::now() + kStopGrace);
  server_->Wait();
}

bool PeerServer::WaitForTurn(grpc::ServerContext* context, uint64_t size_bytes) {
  if (bytes_per_second_max_ == 0) return true;
  SteadyTime turn;
  {
    const MutexLock lock(&mutex_);
    turn = std::max(next_send_, SteadyTime::Now());
    next_send_ = turn + absl::Seconds(static_cast<double>(size_bytes) /
                                      static_cast<double>(bytes_per_second_max_));
  }
  for (absl::Duration wait = turn - SteadyTime::Now(); wait > absl::ZeroDuration();
       wait = turn - SteadyTime::Now()) {
    if (context->IsCancelled()) return false;
    std::this_thread::sleep_for(absl::ToChronoNanoseconds(std::min(wait, kTurnPollInterval)));
  }
  return true;
}

grpc::Status PeerServer::ReadPeerBlob(grpc::ServerContext* context,
                                      const v1::ReadBlobRequest* request,
                                      grpc::ServerWriter<v1::ReadBlobResponse>* writer) {
  const Upload upload(&uploads_);
  if (upload.is_one_too_many()) {
    return ToGrpcStatus(absl::ResourceExhaustedError(
        absl::StrCat("it serves ", kPeerUploadsMax, " others; ask another")));
  }
  const BlobDigest digest{request->digest().sha256_hex(), request->digest().size_bytes()};
  uint64_t offset_bytes = request->offset_bytes();
  const SteadyTime end = SteadyTime::Now() + kPeerUploadMax;
  while (!context->IsCancelled() && SteadyTime::Now() < end) {
    const absl::StatusOr<std::string> chunk =
        blobs_->ReadChunk(digest, offset_bytes, kBlobChunkBytesMax);
    if (!chunk.ok()) return ToGrpcStatus(chunk.status());
    if (chunk->empty()) break;
    if (!WaitForTurn(context, chunk->size())) break;
    v1::ReadBlobResponse response;
    response.set_zstd_chunk(CompressChunk(*chunk));
    if (!writer->Write(response)) break;
    served_bytes_ += chunk->size();
    offset_bytes += chunk->size();
  }
  return grpc::Status::OK;
}

}  // namespace sheaf::worker
