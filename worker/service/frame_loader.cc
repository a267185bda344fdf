// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "worker/service/frame_loader.h"

#include <grpcpp/client_context.h>

#include <functional>
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
#include "worker/service/load_fetches.h"

namespace sheaf::worker {
namespace {

// The most time that one attempt to fetch a guiding field takes, and all attempts together.
constexpr absl::Duration kFieldAttemptMax = absl::Minutes(2), kFieldFetchMax = absl::Minutes(3);

using FieldFetch =
    std::function<absl::StatusOr<std::string>(const Lease& lease, std::stop_token stop)>;

LoadResult Failed(FailureKind kind, const absl::Status& status) { return {nullptr, status, kind}; }

// An open scene together with its files.
class FrameScene : public LoadedScene {
 public:
  FrameScene(const ContentCache* cache, ContentLease files,
             std::shared_ptr<const OnDemandFiles> on_demand, std::unique_ptr<const OpenScene> scene,
             FieldFetch fetch_field, PeerExchange* exchange)
      : cache_(cache),
        files_(std::move(files)),
        on_demand_(std::move(on_demand)),
        scene_(std::move(scene)),
        fetch_field_(std::move(fetch_field)),
        exchange_(exchange) {}

  uint64_t memory_bytes() const override { return scene_->memory_bytes(); }

  absl::StatusOr<FinishedPart> Render(const Lease& lease, std::stop_token stop) const override {
    // Texture tiles are read from the files on demand, so the files are checked before the task and
    // after it: changes in between may affect the image.
    if (absl::Status status = CheckFiles(); !status.ok()) return status;
    if (absl::Status status = EnsureField(lease, stop); !status.ok()) return status;
    absl::StatusOr<RenderedPart> rendered = scene_->Render(lease, stop);
    if (absl::IsCancelled(rendered.status())) return rendered.status();
    // An error that altered files cause is not the scene's.
    if (absl::Status status = CheckFiles(); !status.ok()) return status;
    if (!rendered.ok()) return rendered.status();
    if (exchange_ != nullptr) exchange_->CountPages(rendered->pages, rendered->page_bytes);
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
  absl::Status CheckFiles() const {
    const absl::Status status = cache_->CheckUnchanged(files_);
    return status.ok() ? on_demand_->Check() : status;
  }
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
  std::shared_ptr<const OnDemandFiles> on_demand_;
  std::unique_ptr<const OpenScene> scene_;
  const FieldFetch fetch_field_;
  PeerExchange* const exchange_;  // Null where nothing is counted.
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

SceneInputs FrameLoader::InputsOf(const Manifest& manifest, const ContentLease& files,
                                  const Lease& lease,
                                  const std::shared_ptr<OnDemandFiles>& on_demand) const {
  SceneInputs inputs{manifest.main_file, files.local_paths(), lease.settings, limits_,
                     lease.scene.sha256_hex};
  if (!on_demand->empty()) {
    inputs.on_demand_bytes = on_demand->size_bytes();
    inputs.open_on_demand = [on_demand](const std::string& name, const std::stop_token& until) {
      return on_demand->Open(name, until);
    };
  }
  return inputs;
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
  std::vector<ManifestFile> at_once, later;
  for (const ManifestFile& file : manifest->files) {
    (file.is_on_demand ? later : at_once).push_back(file);
  }
  absl::StatusOr<ContentLease> files = cache_->Acquire(at_once, fetches.AsFetch(), stop);
  if (!files.ok()) return Failed(FailureKind::kInfrastructure, files.status());
  fetches.NoteAcquired(at_once);
  const auto on_demand = std::make_shared<OnDemandFiles>(later, cache_, &fetcher_, exchange_);

  OpenResult opened = scenes_->Open(InputsOf(*manifest, *files, lease, on_demand), stop);
  if (opened.scene == nullptr) {
    absl::Status unchanged = cache_->CheckUnchanged(*files);
    if (unchanged.ok()) unchanged = on_demand->Check();
    if (!unchanged.ok()) return Failed(FailureKind::kInfrastructure, unchanged);
    return Failed(opened.failure_kind, opened.status);
  }
  LogInfo(absl::StrCat(lease.frame_name, ": ", manifest->main_file, " is ready, ",
                       opened.scene->memory_bytes() >> 20, " MiB"));
  const auto fetch_field = [this](const Lease& of, std::stop_token until) {
    return FetchField(of, std::move(until));
  };
  return {std::make_unique<FrameScene>(cache_, *std::move(files), on_demand,
                                       std::move(opened.scene), fetch_field, exchange_),
          absl::OkStatus(), FailureKind::kInternal};
}

}  // namespace sheaf::worker
