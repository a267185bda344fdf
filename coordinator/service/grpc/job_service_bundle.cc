// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// The part of JobService that sends tasks to users who render them again.
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "common/base/printable.h"
#include "common/content/chunk_codec.h"
#include "common/rpc/grpc_status.h"
#include "common/rpc/manifest_codec.h"
#include "common/rpc/settings_codec.h"
#include "coordinator/service/grpc/caller.h"
#include "coordinator/service/grpc/job_service.h"
#include "coordinator/service/grpc/wire.h"

namespace sheaf::coordinator {
namespace {

using BundleWriter = grpc::ServerWriter<v1::ReadTaskBundleResponse>;

constexpr int kBundleFormat = 1;

v1::TaskBundle BundleOf(const TaskReport& report) {
  v1::TaskBundle bundle;
  bundle.set_format(kBundleFormat);
  bundle.set_frame_name(FrameName(report.frame));
  bundle.set_task(report.task);
  bundle.set_whole_frame(report.whole_frame);
  v1::ResultKey& key = *bundle.mutable_key();
  key.set_frame_digest(report.spec.frame_digest);
  *key.mutable_tile() = sheaf::ToWire(report.tile);
  key.mutable_block()->set_first(report.block.first);
  key.mutable_block()->set_count(report.block.count);
  key.set_cell_size_px(report.cells.size_px);
  key.set_cells(report.cells.mask);
  key.set_kind(static_cast<v1::TaskKind>(report.kind));
  *bundle.mutable_scene() = ToWire(report.spec.scene);
  *bundle.mutable_settings() = sheaf::ToWire(report.spec.settings);
  if (report.guiding_field) *bundle.mutable_guiding_field() = ToWire(report.guiding_field->digest);
  bundle.set_set_aside(report.set_aside);
  for (const TaskFailure& failure : report.failures) {
    *bundle.add_failures() = ToWire(MakeView(failure));
  }
  bundle.set_numeric_profile(report.numeric_profile);
  return bundle;
}

// Sends a file whose bytes are in memory.
void SendBytes(const BlobDigest& digest, const std::string& bytes, BundleWriter* writer) {
  v1::ReadTaskBundleResponse response;
  *response.mutable_file() = ToWire(digest);
  for (size_t at = 0; at == 0 || at < bytes.size(); at += kBlobChunkBytesMax) {
    response.set_zstd_chunk(CompressChunk(bytes.substr(at, kBlobChunkBytesMax)));
    if (!writer->Write(response)) return;
    response.clear_file();
  }
}

// The receiver compares the bytes with the digest. Errors: kFailedPrecondition if the blob is not
// kept; those of reading it.
absl::Status SendBlob(const BlobStore& blobs, const BlobDigest& digest, const std::string& name,
                      const grpc::ServerContext& context, BundleWriter* writer) {
  v1::ReadTaskBundleResponse response;
  *response.mutable_file() = ToWire(digest);
  uint64_t at = 0;
  do {
    const absl::StatusOr<std::string> chunk = blobs.ReadChunk(digest, at, kBlobChunkBytesMax);
    if (absl::IsNotFound(chunk.status()) || absl::IsDataLoss(chunk.status())) {
      return absl::FailedPreconditionError(
          absl::StrCat("the scene's file ", Printable(name), " (", digest.sha256_hex,
                       ") is no longer kept (docs/retention.md); submit the scene again"));
    }
    if (!chunk.ok()) return chunk.status();
    if (chunk->empty() && at > 0) return absl::OkStatus();
    response.set_zstd_chunk(CompressChunk(*chunk));
    if (!writer->Write(response) || chunk->empty()) return absl::OkStatus();
    response.clear_file();
    at += chunk->size();
  } while (!context.IsCancelled());
  return absl::OkStatus();
}

}  // namespace

absl::StatusOr<TaskReport> JobService::FindTask(const grpc::ServerContext& context,
                                                const v1::ReadTaskBundleRequest& request) const {
  const absl::StatusOr<std::string> id = ParseJobName(request.name());
  if (!id.ok()) return id.status();
  if (request.has_task() && !request.has_frame_number()) {
    return absl::InvalidArgumentError("task: needs the frame_number, too");
  }
  const absl::StatusOr<JobView> view = farm_->job_views().Find(*id, /*with_frames=*/false);
  if (!view.ok()) return view.status();
  absl::Status allowed = RequireJobControl(context, access_, view->owner);
  if (!allowed.ok()) return allowed;
  std::optional<int32_t> frame;
  std::optional<uint32_t> task;
  if (request.has_frame_number()) frame = request.frame_number();
  if (request.has_task()) task = request.task();
  uint64_t number = 0;
  if (!absl::SimpleAtoi(*id, &number)) return absl::NotFoundError("no such job");
  return farm_->task_reports().Find(number, frame, task);
}

grpc::Status JobService::ReadTaskBundle(grpc::ServerContext* context,
                                        const v1::ReadTaskBundleRequest* request,
                                        BundleWriter* writer) {
  const absl::StatusOr<IdentityUse::Stream> stream =
      OpenStream(*context, access_, "ReadTaskBundle");
  if (!stream.ok()) return ToGrpcStatus(stream.status());
  const absl::StatusOr<TaskReport> report = FindTask(*context, *request);
  // The files of a scene leave the farm, so record it.
  NoteInAudit(*context, access_, "ReadTaskBundle", request->name(), report.status());
  if (!report.ok()) return ToGrpcStatus(report.status());
  const absl::StatusOr<std::string> manifest_bytes =
      farm_->blobs().ReadChunk(report->spec.scene, 0, kManifestBytesMax);
  if (!manifest_bytes.ok()) {
    return ToGrpcStatus(absl::FailedPreconditionError(absl::StrCat(
        "the list of the scene's files is not kept: ", manifest_bytes.status().message())));
  }
  const absl::StatusOr<Manifest> manifest = DecodeManifest(*manifest_bytes);
  if (!manifest.ok()) return ToGrpcStatus(manifest.status());
  v1::ReadTaskBundleResponse first;
  *first.mutable_bundle() = BundleOf(*report);
  if (!writer->Write(first)) return grpc::Status::OK;
  SendBytes(report->spec.scene, *manifest_bytes, writer);
  std::set<std::string> sent{report->spec.scene.sha256_hex};
  if (report->guiding_field && sent.insert(report->guiding_field->digest.sha256_hex).second) {
    const absl::StatusOr<std::string> field =
        farm_->task_reports().ReadField(*report->guiding_field);
    if (!field.ok()) return ToGrpcStatus(absl::FailedPreconditionError(field.status().message()));
    SendBytes(report->guiding_field->digest, *field, writer);
  }
  for (const ManifestFile& file : manifest->files) {
    if (context->IsCancelled()) break;
    if (!sent.insert(file.digest.sha256_hex).second) continue;
    const absl::Status status = SendBlob(farm_->blobs(), file.digest, file.name, *context, writer);
    if (!status.ok()) return ToGrpcStatus(status);
  }
  return grpc::Status::OK;
}

}  // namespace sheaf::coordinator
