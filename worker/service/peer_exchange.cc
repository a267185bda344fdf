// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "worker/service/peer_exchange.h"

#include <grpcpp/client_context.h>

#include <algorithm>
#include <utility>

#include "absl/strings/str_cat.h"
#include "common/base/log.h"
#include "common/rpc/channel.h"
#include "common/rpc/grpc_status.h"
#include "common/rpc/peer_credentials.h"

namespace sheaf::worker {
namespace {

constexpr absl::Duration kReportDeadline = absl::Seconds(10);
// The last report, when the worker ends.
constexpr absl::Duration kFarewellDeadline = absl::Seconds(1);
// The coordinator may have to cut a large blob first, which reads it once.
constexpr absl::Duration kLocateDeadline = absl::Seconds(60);
constexpr int kFetchesReportedMax = 64;

}  // namespace

PeerExchange::PeerExchange(const std::shared_ptr<grpc::Channel>& coordinator, std::string worker_id,
                           const PeerOptions& options, const BlobStore* blobs)
    : worker_id_(std::move(worker_id)),
      options_(options),
      stub_(v1::TransferService::NewStub(coordinator)) {
  if (options_.enabled) {
    absl::StatusOr<std::unique_ptr<PeerServer>> server = PeerServer::Start(options_, blobs);
    if (server.ok()) {
      server_ = *std::move(server);
      LogInfo(absl::StrCat("serves scene files to other workers at port ", server_->port()));
    } else {
      LogWarning(std::string(server.status().message()));
    }
    for (const StoredBlob& blob : blobs->List()) NoteHeld(blob.digest, /*is_new=*/false);
  }
  reporter_ = std::jthread([this](const std::stop_token& stop) { Run(stop); });
}

PeerExchange::~PeerExchange() {
  reporter_.request_stop();
  reporter_.join();
}

void PeerExchange::Run(const std::stop_token& stop) {
  while (!stop.stop_requested()) {
    const bool answered = Report(kReportDeadline);
    if (!SleepUnlessStopped(answered ? kReportSpacing : kReportInterval, stop)) break;
    const MutexLock lock(&mutex_);
    news_.WaitFor(&mutex_, stop, kReportInterval, [this]() ABSL_NO_THREAD_SAFETY_ANALYSIS {
      return !unreported_.empty() || !troubles_.empty();
    });
  }
  Report(kFarewellDeadline);
}

v1::ReportContentRequest PeerExchange::TakeReport() {
  v1::ReportContentRequest request;
  request.set_worker_id(worker_id_);
  request.set_peer_port(server_ == nullptr ? 0 : server_->port());
  const MutexLock lock(&mutex_);
  const size_t count = std::min(unreported_.size(), kHeldPerReportMax);
  for (size_t i = 0; i < count; ++i) {
    request.add_held(std::move(unreported_.back()));
    unreported_.pop_back();
  }
  for (const std::string& blob : fetching_) {
    if (request.fetching_size() < kFetchesReportedMax) request.add_fetching(blob);
  }
  for (v1::PeerTrouble& trouble : std::exchange(troubles_, {})) {
    *request.add_troubles() = std::move(trouble);
  }
  if (server_ != nullptr) counts_.set_served_bytes(server_->served_bytes());
  *request.mutable_counts() = counts_;
  return request;
}

bool PeerExchange::Report(absl::Duration deadline) {
  const v1::ReportContentRequest request = TakeReport();
  grpc::ClientContext context;
  SetDeadline(&context, deadline);
  v1::ReportContentResponse response;
  const grpc::Status status = stub_->ReportContent(&context, request, &response);
  const MutexLock lock(&mutex_);
  if (!status.ok()) {
    // Said again with the next report.
    unreported_.insert(unreported_.end(), request.held().begin(), request.held().end());
    troubles_.insert(troubles_.end(), request.troubles().begin(), request.troubles().end());
    if (troubles_.size() > kTroublesKeptMax) troubles_.resize(kTroublesKeptMax);
    return false;
  }
  if (directory_id_ != response.directory_id()) {
    const bool is_first = directory_id_.empty();
    directory_id_ = response.directory_id();
    if (!is_first) unreported_.assign(held_.begin(), held_.end());
  }
  return true;
}

absl::StatusOr<v1::LocateBlobResponse> PeerExchange::Locate(const BlobDigest& blob,
                                                            const std::vector<std::string>& tried,
                                                            const std::stop_token& stop) {
  v1::LocateBlobRequest request;
  request.set_worker_id(worker_id_);
  request.mutable_digest()->set_sha256_hex(blob.sha256_hex);
  request.mutable_digest()->set_size_bytes(blob.size_bytes);
  for (const std::string& peer : tried) request.add_tried(peer);
  request.set_serves(server_ != nullptr);
  grpc::ClientContext context;
  SetDeadline(&context, kLocateDeadline);
  const std::stop_callback cancel(stop, [&context] { context.TryCancel(); });
  v1::LocateBlobResponse response;
  const grpc::Status status = stub_->LocateBlob(&context, request, &response);
  if (!status.ok()) return FromGrpcStatus(status);
  return response;
}

absl::StatusOr<std::shared_ptr<grpc::Channel>> PeerExchange::ChannelTo(const v1::Peer& peer) {
  const std::string key = absl::StrCat(peer.identity(), " ", peer.address());
  const MutexLock lock(&mutex_);
  if (const auto found = channels_.find(key); found != channels_.end()) return found->second;
  std::shared_ptr<grpc::ChannelCredentials> credentials;
  if (options_.files) {
    absl::StatusOr<std::shared_ptr<grpc::ChannelCredentials>> tls =
        PeerChannelCredentials(*options_.files, peer.identity());
    if (!tls.ok()) return tls.status();
    credentials = *std::move(tls);
  }
  if (channels_.size() >= kPeerChannelsMax) channels_.clear();
  return channels_[key] = MakeChannel(peer.address(), credentials);
}

void PeerExchange::NoteHeld(const BlobDigest& blob, bool is_new) {
  if (blob.size_bytes < kPeerBlobBytesMin) return;
  const MutexLock lock(&mutex_);
  if (held_.size() >= kHeldBlobsMax) return;
  if (!held_.insert(blob.sha256_hex).second && !is_new) return;
  unreported_.push_back(blob.sha256_hex);
  news_.NotifyAll();
}

void PeerExchange::NoteFetching(const BlobDigest& blob, bool is_fetching) {
  const MutexLock lock(&mutex_);
  if (is_fetching) {
    fetching_.insert(blob.sha256_hex);
  } else if (const auto found = fetching_.find(blob.sha256_hex); found != fetching_.end()) {
    fetching_.erase(found);
  }
}

void PeerExchange::NoteTrouble(const std::string& peer_id, const BlobDigest& blob,
                               v1::PeerTrouble::Kind kind) {
  v1::PeerTrouble trouble;
  trouble.set_worker_id(peer_id);
  trouble.set_sha256_hex(blob.sha256_hex);
  trouble.set_kind(kind);
  const MutexLock lock(&mutex_);
  if (troubles_.size() < kTroublesKeptMax) troubles_.push_back(std::move(trouble));
  news_.NotifyAll();
}

void PeerExchange::CountBlob(BlobSource source) {
  const MutexLock lock(&mutex_);
  switch (source) {
    case BlobSource::kCache:
      return counts_.set_cache_blobs(counts_.cache_blobs() + 1);
    case BlobSource::kPeer:
      return counts_.set_peer_blobs(counts_.peer_blobs() + 1);
    case BlobSource::kCoordinator:
      return counts_.set_coordinator_blobs(counts_.coordinator_blobs() + 1);
  }
}

void PeerExchange::CountBytes(BlobSource source, uint64_t size_bytes) {
  const MutexLock lock(&mutex_);
  switch (source) {
    case BlobSource::kCache:
      return counts_.set_cache_bytes(counts_.cache_bytes() + size_bytes);
    case BlobSource::kPeer:
      return counts_.set_peer_bytes(counts_.peer_bytes() + size_bytes);
    case BlobSource::kCoordinator:
      return counts_.set_coordinator_bytes(counts_.coordinator_bytes() + size_bytes);
  }
}

void PeerExchange::CountPages(const volume::PageCounts& pages, uint64_t resident_bytes) {
  const MutexLock lock(&mutex_);
  const uint64_t found = pages.pages_pinned - std::min(pages.pages_pinned, pages.pages_read);
  counts_.set_volume_pages_found(counts_.volume_pages_found() + found);
  counts_.set_volume_pages_read(counts_.volume_pages_read() + pages.pages_read);
  counts_.set_volume_read_bytes(counts_.volume_read_bytes() + pages.bytes_read);
  counts_.set_volume_pages_evicted(counts_.volume_pages_evicted() + pages.pages_evicted);
  counts_.set_volume_resident_bytes(resident_bytes);
}

void PeerExchange::CountPart(uint64_t size_bytes) {
  const MutexLock lock(&mutex_);
  counts_.set_volume_part_bytes(counts_.volume_part_bytes() + size_bytes);
}

}  // namespace sheaf::worker
