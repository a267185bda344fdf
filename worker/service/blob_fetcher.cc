// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "worker/service/blob_fetcher.h"

#include <grpcpp/client_context.h>

#include <algorithm>
#include <chrono>
#include <string>
#include <string_view>
#include <vector>

#include "absl/strings/str_cat.h"
#include "common/base/digest.h"
#include "common/base/log.h"
#include "common/base/mutex.h"
#include "common/base/printable.h"
#include "common/base/steady_time.h"
#include "common/content/chunk_codec.h"
#include "common/rpc/channel.h"
#include "common/rpc/chunk_list_codec.h"
#include "common/rpc/grpc_status.h"
#include "sheaf/v1/peer.grpc.pb.h"

namespace sheaf::worker {
namespace {

// Bounds of the wait that the coordinator asks for.
constexpr absl::Duration kRetryMin = absl::Milliseconds(10), kRetryMax = absl::Seconds(1);

void SetRequest(const BlobDigest& blob, uint64_t offset_bytes, v1::ReadBlobRequest* request) {
  request->mutable_digest()->set_sha256_hex(blob.sha256_hex);
  request->mutable_digest()->set_size_bytes(blob.size_bytes);
  request->set_offset_bytes(offset_bytes);
}

// The chunks of a blob as the coordinator states them; a small blob is one chunk.
absl::StatusOr<ChunkList> ChunksOf(const BlobDigest& blob, const v1::LocateBlobResponse& answer) {
  if (blob.size_bytes <= kUnchunkedBytesMax) return ChunkList{blob, {blob}};
  v1::Digest wire;
  wire.set_sha256_hex(blob.sha256_hex);
  wire.set_size_bytes(blob.size_bytes);
  return ChunkListFromWire(wire, answer.chunks());
}

// Tells others, while it lives, that this worker fetches the blob from the coordinator.
class FetchNote {
 public:
  FetchNote(PeerExchange* exchange, const BlobDigest& blob) : exchange_(exchange), blob_(blob) {
    if (exchange_ != nullptr) exchange_->NoteFetching(blob_, true);
  }
  ~FetchNote() {
    if (exchange_ != nullptr) exchange_->NoteFetching(blob_, false);
  }
  FetchNote(const FetchNote&) = delete;
  FetchNote& operator=(const FetchNote&) = delete;

 private:
  PeerExchange* const exchange_;
  const BlobDigest& blob_;
};

// Bytes of one peer, chunk by chunk.
class PeerStream {
 public:
  explicit PeerStream(grpc::ClientReader<v1::ReadBlobResponse>* reader) : reader_(*reader) {}

  // Whether `size` bytes came.
  bool Fill(size_t size) {
    v1::ReadBlobResponse response;
    while (buffer_.size() < size) {
      if (!reader_.Read(&response)) return false;
      const absl::StatusOr<std::string> bytes =
          DecompressChunk(response.zstd_chunk(), kBlobChunkBytesMax);
      if (!bytes.ok() || bytes->empty()) {
        is_malformed_ = true;
        return false;
      }
      buffer_ += *bytes;
    }
    return true;
  }
  std::string_view bytes() const { return buffer_; }
  void Drop(size_t size) { buffer_.erase(0, size); }
  bool is_malformed() const { return is_malformed_; }

 private:
  grpc::ClientReader<v1::ReadBlobResponse>& reader_;
  std::string buffer_;
  bool is_malformed_ = false;
};

}  // namespace

absl::Status BlobFetcher::Fetch(const BlobDigest& blob, uint64_t offset_bytes,
                                const ContentCache::Append& append, const std::stop_token& stop) {
  Progress progress{blob, append, stop, offset_bytes};
  const bool asks_peers =
      exchange_ != nullptr && exchange_->asks_peers() && blob.size_bytes >= kPeerBlobBytesMin;
  if (asks_peers && FetchFromPeers(&progress)) return progress.own;
  if (stop.stop_requested()) return absl::CancelledError("stopped while fetching the scene");
  const FetchNote note(asks_peers ? exchange_ : nullptr, blob);
  const uint64_t begin_bytes = progress.offset_bytes;
  absl::Status status = FetchFromCoordinator(&progress);
  if (exchange_ != nullptr) {
    exchange_->CountBytes(BlobSource::kCoordinator, progress.offset_bytes - begin_bytes);
    if (status.ok()) exchange_->CountBlob(BlobSource::kCoordinator);
  }
  return status;
}

bool BlobFetcher::FetchFromPeers(Progress* progress) {
  const BlobDigest& blob = progress->blob;
  const SteadyTime wait_end = SteadyTime::Now() + kPeerWaitMax;
  std::vector<std::string> tried;
  while (!progress->stop.stop_requested() && tried.size() < kPeersTriedMax) {
    const absl::StatusOr<v1::LocateBlobResponse> answer =
        exchange_->Locate(blob, tried, progress->stop);
    if (!answer.ok() || answer->from_coordinator()) return false;
    if (answer->peers().empty()) {
      if (SteadyTime::Now() > wait_end) return false;
      const absl::Duration wait = absl::Nanoseconds(answer->retry_after().nanos()) +
                                  absl::Seconds(answer->retry_after().seconds());
      SleepUnlessStopped(std::clamp(wait, kRetryMin, kRetryMax), progress->stop);
      continue;
    }
    const absl::StatusOr<ChunkList> list = ChunksOf(blob, *answer);
    if (!list.ok()) return false;
    for (const v1::Peer& peer : answer->peers()) {
      const uint64_t begin_bytes = progress->offset_bytes;
      v1::PeerTrouble::Kind kind = v1::PeerTrouble::KIND_UNREACHABLE;
      const absl::Status status = FetchFromPeer(peer, *list, progress, &kind);
      exchange_->CountBytes(BlobSource::kPeer, progress->offset_bytes - begin_bytes);
      if (status.ok()) exchange_->CountBlob(BlobSource::kPeer);
      if (status.ok() || !progress->own.ok()) return true;
      if (progress->stop.stop_requested()) return false;
      const std::string text =
          absl::StrCat("blob ", blob.sha256_hex, " from worker ", Printable(peer.worker_id()),
                       " at ", Printable(peer.address()), ": ", status.message());
      kind == v1::PeerTrouble::KIND_WRONG_BYTES ? LogWarning(text) : LogDebug(text);
      exchange_->NoteTrouble(peer.worker_id(), blob, kind);
      tried.push_back(peer.worker_id());
    }
  }
  return false;
}

absl::Status BlobFetcher::FetchFromPeer(const v1::Peer& peer, const ChunkList& list,
                                        Progress* progress, v1::PeerTrouble::Kind* kind) {
  const absl::StatusOr<std::shared_ptr<grpc::Channel>> channel = exchange_->ChannelTo(peer);
  if (!channel.ok()) return channel.status();
  const auto connect_end =
      std::chrono::system_clock::now() + absl::ToChronoNanoseconds(kPeerConnectMax);
  if (!(*channel)->WaitForConnected(connect_end)) return absl::UnavailableError("no connection");
  // Chunks are verified whole: the one in which earlier bytes end is read again.
  size_t index = 0;
  uint64_t begin_bytes = 0;
  while (index < list.chunks.size() &&
         begin_bytes + list.chunks[index].size_bytes <= progress->offset_bytes) {
    begin_bytes += list.chunks[index++].size_bytes;
  }
  grpc::ClientContext context;
  SetDeadline(&context, kPeerAttemptMin + absl::Seconds((list.blob.size_bytes - begin_bytes) /
                                                        kPeerBytesPerSecondMin));
  const std::stop_callback cancel(progress->stop, [&context] { context.TryCancel(); });
  v1::ReadBlobRequest request;
  SetRequest(list.blob, begin_bytes, &request);
  const std::unique_ptr<grpc::ClientReader<v1::ReadBlobResponse>> reader =
      v1::PeerService::NewStub(*channel)->ReadPeerBlob(&context, request);
  PeerStream stream(reader.get());
  for (; index < list.chunks.size(); ++index) {
    const BlobDigest& chunk = list.chunks[index];
    if (!stream.Fill(chunk.size_bytes)) break;
    std::string_view bytes = stream.bytes().substr(0, chunk.size_bytes);
    if (Sha256Hex(bytes) != chunk.sha256_hex) {
      context.TryCancel();
      reader->Finish();
      *kind = v1::PeerTrouble::KIND_WRONG_BYTES;
      return absl::DataLossError("it sent wrong bytes; they are fetched from elsewhere");
    }
    bytes.remove_prefix(progress->offset_bytes - begin_bytes);
    progress->own = progress->append(bytes);
    if (!progress->own.ok()) break;
    begin_bytes += chunk.size_bytes;
    progress->offset_bytes = begin_bytes;
    stream.Drop(chunk.size_bytes);
  }
  const bool is_whole = index == list.chunks.size();
  // A stream that broke off says why; one that is left is cancelled.
  if (stream.is_malformed() || !progress->own.ok()) context.TryCancel();
  const grpc::Status finished = reader->Finish();
  if (is_whole) return absl::OkStatus();
  if (stream.is_malformed()) *kind = v1::PeerTrouble::KIND_WRONG_BYTES;
  const grpc::StatusCode code = finished.error_code();
  if (code == grpc::StatusCode::RESOURCE_EXHAUSTED) *kind = v1::PeerTrouble::KIND_REFUSED;
  if (code == grpc::StatusCode::NOT_FOUND) *kind = v1::PeerTrouble::KIND_MISSING;
  const absl::Status status = FromGrpcStatus(finished);
  return status.ok() ? absl::UnavailableError("it ended too early") : status;
}

absl::Status BlobFetcher::FetchFromCoordinator(Progress* progress) {
  grpc::ClientContext context;
  SetDeadline(&context, kStreamDeadline);
  const std::stop_callback cancel(progress->stop, [&context] { context.TryCancel(); });
  v1::ReadBlobRequest request;
  SetRequest(progress->blob, progress->offset_bytes, &request);
  const std::unique_ptr<grpc::ClientReader<v1::ReadBlobResponse>> reader =
      stub_->ReadBlob(&context, request);
  absl::Status appended;
  v1::ReadBlobResponse response;
  while (appended.ok() && reader->Read(&response)) {
    const absl::StatusOr<std::string> bytes =
        DecompressChunk(response.zstd_chunk(), kBlobChunkBytesMax);
    appended =
        bytes.ok() ? progress->append(*bytes) : absl::DataLossError(bytes.status().message());
    if (appended.ok()) progress->offset_bytes += bytes->size();
  }
  if (!appended.ok()) context.TryCancel();
  const absl::Status finished = FromGrpcStatus(reader->Finish());
  return appended.ok() ? finished : appended;
}

}  // namespace sheaf::worker
