// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "worker/service/frame_loader.h"

#include <grpcpp/client_context.h>

#include <functional>
#include <set>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "common/base/digest.h"
#include "common/base/file.h"
#include "common/base/log.h"
#include "common/base/mutex.h"
#include "common/rpc/channel.h"
#include "common/rpc/grpc_status.h"
#include "common/rpc/manifest_codec.h"
#include "common/rpc/retry.h"

namespace sheaf::worker {
namespace {

// The most time that one attempt to fetch a guiding field takes, and all attempts together.
constexpr absl::Duration kFieldAttemptMax = absl::Minutes(2), kFieldFetchMax = absl::Minutes(3);

using FieldFetch =
    std::function<absl::StatusOr<std::string>(const Lease& lease, std::stop_token stop)>;

LoadResult Failed(FailureKind kind, const absl::Status& status) { return {nullptr, status, kind}; }

// The fetches of one load: counts the blobs that were in the cache, and reports those that are now.
class LoadFetches {
 public:
  LoadFetches(BlobFetcher* fetcher, PeerExchange* exchange, std::stop_token stop)
      : fetcher_(fetcher), exchange_(exchange), stop_(std::move(stop)) {}

  ContentCache::Fetch AsFetch() {
    return
        [this](const BlobDigest& blob, uint64_t offset_bytes, const ContentCache::Append& append) {
          NoteFetched();  // The next blob is asked for once the one before is complete.
          fetched_.insert(blob.sha256_hex);
          fetching_ = blob;
          return fetcher_->Fetch(blob, offset_bytes, append, stop_);
        };
  }
  // The files are all in the cache.
  void NoteAcquired(const std::vector<ManifestFile>& files) {
    NoteFetched();
    if (exchange_ == nullptr) return;
    std::set<std::string> seen;
    for (const ManifestFile& file : files) {
      const BlobDigest& blob = file.digest;
      if (!seen.insert(blob.sha256_hex).second || fetched_.contains(blob.sha256_hex)) continue;
      exchange_->CountBlob(BlobSource::kCache);
      exchange_->CountBytes(BlobSource::kCache, blob.size_bytes);
      // Another worker of this machine may have fetched it.
      exchange_->NoteHeld(blob, /*is_new=*/false);
    }
  }

 private:
  void NoteFetched() {
    if (exchange_ != nullptr && !fetching_.sha256_hex.empty())
      exchange_->NoteHeld(fetching_, /*is_new=*/true);
    fetching_ = {};
  }

  BlobFetcher* const fetcher_;
  PeerExchange* const exchange_;
  const std::stop_token stop_;
  std::set<std::string> fetched_;
  BlobDigest fetching_;
};

// An open scene together with its files.
class FrameScene : public LoadedScene {
 public:
  FrameScene(const ContentCache* cache, ContentLease files, std::unique_ptr<const OpenScene> scene,
             FieldFetch fetch_field)
      : cache_(cache),
        files_(std::move(files)),
        scene_(std::move(scene)),
        fetch_field_(std::move(fetch_field)) {}

  uint64_t memory_bytes() const override { return scene_->memory_bytes(); }

  absl::StatusOr<FinishedPart> Render(const Lease& lease, std::stop_token stop) const override {
    // Texture tiles are read from the files on demand, so the files are checked before the task and
    // after it: changes in between may affect the image.
    if (absl::Status status = cache_->CheckUnchanged(files_); !status.ok()) return status;
    if (absl::Status status = EnsureField(lease, stop); !status.ok()) return status;
    absl::StatusOr<RenderedPart> rendered = scene_->Render(lease, stop);
    if (absl::IsCancelled(rendered.status())) return rendered.status();
    // An error that altered files cause is not the scene's.
    if (absl::Status status = cache_->CheckUnchanged(files_); !status.ok()) return status;
    if (!rendered.ok()) return rendered.status();
    FinishedPart part;
    part.lease_id = lease.lease_id;
    part.frame_digest = lease.frame_digest;
    part.tile = lease.tile;
    part.block = lease.block;
    part.cells = lease.cells;
    part.kind = lease.kind;
    part.exr_bytes = std::move(rendered->exr_bytes);
    part.digest = {Sha256Hex(part.exr_bytes), part.exr_bytes.size()};
    part.ray_count = rendered->ray_count;
    part.cpu_seconds = rendered->cpu_seconds;
    part.token = lease.token;
    part.field = lease.field;
    return part;
  }

 private:
  // Gives the scene the lease's guiding field, unless it has it. Others wait meanwhile.
  absl::Status EnsureField(const Lease& lease, const std::stop_token& stop) const {
    if (lease.field.sha256_hex.empty()) return absl::OkStatus();
    const MutexLock lock(&field_mutex_);
    if (lease.field == field_) return absl::OkStatus();
    if (!field_.sha256_hex.empty()) {
      return absl::AbortedError("the scene has an earlier guiding field; it is loaded again");
    }
    const absl::StatusOr<std::string> bytes = fetch_field_(lease, stop);
    if (!bytes.ok()) return bytes.status();
    if (absl::Status status = scene_->SetField(*bytes, stop); !status.ok()) return status;
    field_ = lease.field;
    return absl::OkStatus();
  }

  const ContentCache* const cache_;
  ContentLease files_;  // Pins the files for the lifetime of the scene.
  std::unique_ptr<const OpenScene> scene_;
  const FieldFetch fetch_field_;
  mutable Mutex field_mutex_;
  mutable BlobDigest field_ ABSL_GUARDED_BY(field_mutex_);
};

}  // namespace

FrameLoader::FrameLoader(const std::shared_ptr<grpc::Channel>& channel, ContentCache* cache,
                         SceneOpener* scenes, SceneLimits limits, PeerExchange* exchange)
    : fetcher_(channel, exchange),
      exchange_(exchange),
      worker_stub_(v1::WorkerService::NewStub(channel)),
      cache_(cache),
      scenes_(scenes),
      limits_(limits) {}

absl::StatusOr<std::string> FrameLoader::FetchField(const Lease& lease,
                                                    std::stop_token stop) const {
  v1::ReadGuidingFieldRequest request;
  request.set_frame_name(lease.frame_name);
  request.mutable_digest()->set_sha256_hex(lease.field.sha256_hex);
  request.mutable_digest()->set_size_bytes(lease.field.size_bytes);
  std::string field;
  const auto fetch = [&] {
    field.clear();
    grpc::ClientContext context;
    SetDeadline(&context, kFieldAttemptMax);
    const std::stop_callback cancel(stop, [&context] { context.TryCancel(); });
    const std::unique_ptr<grpc::ClientReader<v1::ReadGuidingFieldResponse>> reader =
        worker_stub_->ReadGuidingField(&context, request);
    v1::ReadGuidingFieldResponse response;
    while (field.size() <= lease.field.size_bytes && reader->Read(&response)) {
      field += response.chunk();
    }
    if (field.size() > lease.field.size_bytes) context.TryCancel();
    return FromGrpcStatus(reader->Finish());
  };
  RetryEnvironment environment = SystemRetryEnvironment();
  environment.sleep = [&stop](absl::Duration wait) { return SleepUnlessStopped(wait, stop); };
  const absl::Status status =
      RetryLoop({.elapsed_max = kFieldFetchMax}, Idempotency::kIdempotent, environment, fetch);
  if (stop.stop_requested()) return absl::CancelledError("stopped while a field was fetched");
  if (absl::IsNotFound(status)) return absl::AbortedError(status.message());
  const bool is_whole =
      field.size() == lease.field.size_bytes && Sha256Hex(field) == lease.field.sha256_hex;
  if (status.ok() && is_whole) return field;
  return absl::UnavailableError(
      absl::StrCat("fetching the guiding field of ", lease.frame_name, ": ",
                   status.ok() ? "its bytes do not match its digest" : status.message()));
}

LoadResult FrameLoader::Load(const Lease& lease, std::stop_token stop) {
  LoadFetches fetches(&fetcher_, exchange_, stop);
  const std::vector<ManifestFile> manifest_files = {{"scene.manifest", lease.scene}};
  absl::StatusOr<ContentLease> manifest_file =
      cache_->Acquire(manifest_files, fetches.AsFetch(), stop);
  if (!manifest_file.ok()) return Failed(FailureKind::kInfrastructure, manifest_file.status());
  fetches.NoteAcquired(manifest_files);
  const absl::StatusOr<std::string> manifest_bytes =
      ReadWholeFile(manifest_file->local_paths().at("scene.manifest"), kManifestBytesMax);
  if (!manifest_bytes.ok()) return Failed(FailureKind::kInfrastructure, manifest_bytes.status());
  if (Sha256Hex(*manifest_bytes) != lease.scene.sha256_hex) {
    return Failed(FailureKind::kInfrastructure,
                  absl::DataLossError("the scene's manifest was altered while it was read"));
  }
  const absl::StatusOr<Manifest> manifest = DecodeManifest(*manifest_bytes);
  if (!manifest.ok()) return Failed(FailureKind::kScene, manifest.status());
  absl::StatusOr<ContentLease> files = cache_->Acquire(manifest->files, fetches.AsFetch(), stop);
  if (!files.ok()) return Failed(FailureKind::kInfrastructure, files.status());
  fetches.NoteAcquired(manifest->files);

  OpenResult opened = scenes_->Open(
      {manifest->main_file, files->local_paths(), lease.settings, limits_, lease.scene.sha256_hex},
      stop);
  if (opened.scene == nullptr) {
    const absl::Status unchanged = cache_->CheckUnchanged(*files);
    if (!unchanged.ok()) return Failed(FailureKind::kInfrastructure, unchanged);
    return Failed(opened.failure_kind, opened.status);
  }
  LogInfo(absl::StrCat(lease.frame_name, ": ", manifest->main_file, " is ready, ",
                       opened.scene->memory_bytes() >> 20, " MiB"));
  const auto fetch_field = [this](const Lease& of, std::stop_token until) {
    return FetchField(of, std::move(until));
  };
  return {
      std::make_unique<FrameScene>(cache_, *std::move(files), std::move(opened.scene), fetch_field),
      absl::OkStatus(), FailureKind::kInternal};
}

}  // namespace sheaf::worker
