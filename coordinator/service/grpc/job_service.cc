// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "coordinator/service/grpc/job_service.h"

#include <algorithm>
#include <fstream>
#include <iterator>
#include <memory>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "common/base/status.h"
#include "common/base/steady_time.h"
#include "common/rpc/channel.h"
#include "common/rpc/grpc_status.h"
#include "common/rpc/manifest_codec.h"
#include "coordinator/service/grpc/caller.h"
#include "coordinator/service/grpc/wire.h"

namespace sheaf::coordinator {
namespace {

// Frames that an entry of the audit log names.
constexpr int kAuditedFramesMax = 16;

// The part of a job that a call names, after the job's name: "/frames/7/tasks/3", "/frames/1,2".
std::string PartName(const JobArguments& arguments) {
  if (const std::vector<int32_t>& frames = arguments.frames; !frames.empty()) {
    const auto end =
        frames.size() > kAuditedFramesMax ? frames.begin() + kAuditedFramesMax : frames.end();
    return absl::StrCat("/frames/", absl::StrJoin(frames.begin(), end, ","),
                        end == frames.end() ? "" : ",...");
  }
  return absl::StrCat(arguments.frame ? absl::StrCat("/frames/", *arguments.frame) : "",
                      arguments.task ? absl::StrCat("/tasks/", *arguments.task) : "");
}

std::string JobNameOf(const JobView& job) { return absl::StrCat("jobs/", job.job_id); }

}  // namespace

absl::StatusOr<JobView> JobService::Find(const std::string& name) const {
  const absl::StatusOr<std::string> id = ParseJobName(name);
  if (!id.ok()) return id.status();
  if (uint64_t number = 0; absl::SimpleAtoi(*id, &number)) farm_->NotePilotRequest(number);
  return farm_->view().FindJob(*id);
}

absl::Status JobService::RequireFilesOf(const BlobDigest& scene) const {
  const absl::StatusOr<std::string> bytes = farm_->blobs().ReadChunk(scene, 0, kManifestBytesMax);
  if (!bytes.ok()) return bytes.status();
  const absl::StatusOr<Manifest> manifest = DecodeManifest(*bytes);
  if (!manifest.ok()) {
    return absl::InvalidArgumentError(
        absl::StrCat("scene ", scene.sha256_hex, ": ", manifest.status().message()));
  }
  std::vector<BlobDigest> digests;
  for (const ManifestFile& file : manifest->files) digests.push_back(file.digest);
  const absl::StatusOr<std::vector<BlobDigest>> missing = farm_->blobs().FindMissing(digests);
  if (!missing.ok()) return missing.status();
  if (missing->empty()) return absl::OkStatus();
  std::set<std::string> absent;
  for (const BlobDigest& digest : *missing) absent.insert(digest.sha256_hex);
  std::string names;
  int listed = 0;
  for (const ManifestFile& file : manifest->files) {
    if (!absent.contains(file.digest.sha256_hex) || ++listed > kMissingNamesMax) continue;
    absl::StrAppend(&names, listed == 1 ? "" : ", ", file.name, " (", file.digest.sha256_hex, ")");
  }
  return absl::FailedPreconditionError(absl::StrCat(
      missing->size(), " files of scene ", manifest->main_file, " are not uploaded: ", names));
}

absl::Status JobService::RequireBlobs(const JobSpec& spec) const {
  std::set<std::string> checked;
  for (const FrameSpec& frame : spec.frames) {
    if (!frame.resumed.sha256_hex.empty()) {
      if (absl::Status status = farm_->blobs().PathOf(frame.resumed).status(); !status.ok()) {
        return absl::FailedPreconditionError(absl::StrCat("the image from which to resume frame ",
                                                          frame.frame_number,
                                                          " is not uploaded: ", status.message()));
      }
    }
    if (!checked.insert(frame.scene.sha256_hex).second) continue;
    const absl::StatusOr<std::vector<BlobDigest>> missing =
        farm_->blobs().FindMissing({frame.scene});
    if (!missing.ok()) return missing.status();
    if (!missing->empty()) {
      return absl::FailedPreconditionError(
          absl::StrCat("the manifest of frame ", frame.frame_number,
                       " is not uploaded: ", frame.scene.sha256_hex));
    }
    if (absl::Status status = RequireFilesOf(frame.scene); !status.ok()) return status;
  }
  return absl::OkStatus();
}

absl::StatusOr<JobView> JobService::CreateFor(const std::string& owner,
                                              const v1::CreateJobRequest& request) {
  absl::StatusOr<JobSpec> spec = FromWire(request);
  if (!spec.ok()) return spec.status();
  spec->owner = owner;
  if (absl::Status status = RequireBlobs(*spec); !status.ok()) return status;
  if (absl::Status status = RequireRoom(spec->owner); !status.ok()) return status;
  const absl::StatusOr<uint64_t> id = farm_->CreateJob(*std::move(spec), request.request_id());
  if (!id.ok()) return id.status();
  return farm_->job_views().Find(absl::StrCat(*id), /*with_frames=*/false);
}

grpc::Status JobService::CreateJob(grpc::ServerContext* context,
                                   const v1::CreateJobRequest* request, v1::Job* response) {
  const absl::StatusOr<JobView> view = CreateFor(OwnerOf(*context), *request);
  NoteInAudit(*context, access_, "CreateJob", view.ok() ? JobNameOf(*view) : request->title(),
              view.status());
  if (!view.ok()) return ToGrpcStatus(view.status());
  *response = ToWire(*view);
  return grpc::Status::OK;
}

grpc::Status JobService::GetJob(grpc::ServerContext* /*context*/, const v1::GetJobRequest* request,
                                v1::Job* response) {
  const absl::StatusOr<JobView> view = Find(request->name());
  if (!view.ok()) return ToGrpcStatus(view.status());
  *response = ToWire(*view);
  return grpc::Status::OK;
}

// The page token is the id of the last job of the page before.
grpc::Status JobService::ListJobs(grpc::ServerContext* /*context*/,
                                  const v1::ListJobsRequest* request,
                                  v1::ListJobsResponse* response) {
  if (request->page_size() < 0 || request->page_size() > kJobPageSizeMax) {
    return ToGrpcStatus(absl::InvalidArgumentError(
        absl::StrCat("page_size: ", request->page_size(), " is outside 0 to ", kJobPageSizeMax)));
  }
  const int page_size = request->page_size() == 0 ? kJobPageSizeDefault : request->page_size();
  const std::vector<JobView> views =
      request->with_pilots() ? farm_->job_views().ListWithPilots() : farm_->view().ListJobs();
  auto view = views.begin();
  if (const std::string& token = request->page_token(); !token.empty()) {
    view = std::find_if(views.begin(), views.end(),
                        [&](const JobView& candidate) { return candidate.job_id == token; });
    if (view == views.end()) {
      return ToGrpcStatus(absl::InvalidArgumentError("page_token: is not from this service"));
    }
    ++view;
  }
  for (; view != views.end() && response->jobs_size() < page_size; ++view) {
    *response->add_jobs() = ToWire(*view);
  }
  if (view != views.end()) response->set_next_page_token(std::prev(view)->job_id);
  return grpc::Status::OK;
}

absl::StatusOr<JobView> JobService::TryChange(const grpc::ServerContext& context, JobVerb verb,
                                              const std::string& name,
                                              const JobArguments& arguments) {
  const absl::StatusOr<std::string> id = ParseJobName(name);
  if (!id.ok()) return id.status();
  const absl::StatusOr<JobView> view = farm_->job_views().Find(*id, /*with_frames=*/false);
  if (!view.ok()) return view.status();
  absl::Status allowed = RequireJobControl(context, access_, view->owner);
  if (!allowed.ok()) return allowed;
  uint64_t number = 0;
  if (!absl::SimpleAtoi(*id, &number)) return absl::NotFoundError("no such job");
  farm_->NotePilotRequest(number);
  absl::Status changed = farm_->ChangeJob(verb, number, arguments);
  if (!changed.ok()) return changed;
  return verb == JobVerb::kDeleteJob ? view : farm_->job_views().Find(*id, /*with_frames=*/false);
}

grpc::Status JobService::Change(const grpc::ServerContext& context, JobVerb verb,
                                const std::string& name, absl::StatusOr<JobArguments> arguments,
                                v1::Job* response) {
  if (!arguments.ok()) return ToGrpcStatus(arguments.status());
  arguments->user = OwnerOf(context);
  const absl::StatusOr<JobView> view = TryChange(context, verb, name, *arguments);
  NoteInAudit(context, access_, RowOf(verb).name, name + PartName(*arguments), view.status());
  if (!view.ok()) return ToGrpcStatus(view.status());
  *response = ToWire(*view);
  return grpc::Status::OK;
}

grpc::Status JobService::ListJobEvents(grpc::ServerContext* /*context*/,
                                       const v1::ListJobEventsRequest* request,
                                       v1::ListJobEventsResponse* response) {
  const absl::StatusOr<std::string> id = ParseJobName(request->name());
  if (!id.ok()) return ToGrpcStatus(id.status());
  const absl::StatusOr<std::vector<JobEvent>> events = farm_->view().ListEvents(*id);
  if (!events.ok()) return ToGrpcStatus(events.status());
  for (const JobEvent& event : *events) *response->add_events() = ToWire(event);
  return grpc::Status::OK;
}

grpc::Status JobService::PriceRefinement(grpc::ServerContext* /*context*/,
                                         const v1::PriceRefinementRequest* request,
                                         v1::PriceRefinementResponse* response) {
  const absl::StatusOr<std::string> id = ParseJobName(request->name());
  if (!id.ok()) return ToGrpcStatus(id.status());
  const absl::StatusOr<RefinementPrices> prices = farm_->view().PriceRefinement(
      *id, {request->target_errors().begin(), request->target_errors().end()});
  if (!prices.ok()) return ToGrpcStatus(prices.status());
  *response = ToWire(*prices);
  return grpc::Status::OK;
}

grpc::Status JobService::WatchJob(grpc::ServerContext* context, const v1::WatchJobRequest* request,
                                  grpc::ServerWriter<v1::Job>* writer) {
  const absl::StatusOr<IdentityUse::Stream> stream = OpenStream(*context, access_, "WatchJob");
  if (!stream.ok()) return ToGrpcStatus(stream.status());
  const absl::StatusOr<std::string> id = ParseJobName(request->name());
  if (!id.ok()) return ToGrpcStatus(id.status());
  const std::shared_ptr<JobWatch> watch = watches_.Of(*id);
  uint64_t version = 0;
  while (!stopping_ && !context->IsCancelled()) {
    // A watch does not outlive the permission to watch.
    const absl::Status permitted = CallerOf(*context, access_).status();
    if (!permitted.ok()) return ToGrpcStatus(permitted);
    const uint64_t seen = farm_->view().ChangeCount(), ends_seen = farm_->signals().EndCount();
    if (!farm_->job_views().IsLive(*id)) {
      const absl::StatusOr<JobView> view = Find(request->name());
      if (!view.ok()) return ToGrpcStatus(view.status());
      if (HasEnded(view->state)) {  // Otherwise it was just retried.
        writer->Write(ToWire(*view));
        return grpc::Status::OK;
      }
    }
    if (uint64_t number = 0; absl::SimpleAtoi(*id, &number)) farm_->NotePilotRequest(number);
    const absl::StatusOr<std::optional<v1::Job>> job =
        watch->Next(&version, request->changes_only());
    if (!job.ok()) return ToGrpcStatus(job.status());
    if (*job && !writer->Write(**job)) return grpc::Status::OK;  // The watcher has gone.
    // A client that waits for a job's end learns of it at once.
    farm_->signals().WaitForEnd(ends_seen, kWatchIntervalMin);
    farm_->view().WaitForChange(seen, kWatchIntervalMin);
  }
  return stopping_ ? ToGrpcStatus(absl::UnavailableError("the coordinator is stopping"))
                   : grpc::Status::OK;
}

grpc::Status JobService::ReadFrameOutput(grpc::ServerContext* context,
                                         const v1::ReadFrameOutputRequest* request,
                                         grpc::ServerWriter<v1::ReadFrameOutputResponse>* writer) {
  const absl::StatusOr<IdentityUse::Stream> stream =
      OpenStream(*context, access_, "ReadFrameOutput");
  if (!stream.ok()) return ToGrpcStatus(stream.status());
  const absl::StatusOr<FrameId> id = ParseFrameName(request->name());
  if (!id.ok()) return ToGrpcStatus(id.status());
  const absl::StatusOr<std::string> path = farm_->images().Find(id->job_id, id->frame_number);
  if (!path.ok()) return ToGrpcStatus(path.status());
  std::ifstream file(*path, std::ios::binary);
  if (!file) return ToGrpcStatus(absl::DataLossError(*path + ": the delivered image is missing"));
  std::string chunk(kStreamChunkBytesMax, '\0');
  while (file && !context->IsCancelled()) {
    file.read(chunk.data(), static_cast<std::streamsize>(chunk.size()));
    if (file.gcount() == 0) break;
    v1::ReadFrameOutputResponse response;
    response.set_chunk(chunk.data(), static_cast<size_t>(file.gcount()));
    if (!writer->Write(response)) break;
  }
  if (file.bad()) return ToGrpcStatus(absl::DataLossError(*path + ": cannot be read"));
  return grpc::Status::OK;
}

grpc::Status JobService::ListWorkers(grpc::ServerContext* /*context*/,
                                     const v1::ListWorkersRequest* /*request*/,
                                     v1::ListWorkersResponse* response) {
  for (const WorkerView& view : farm_->view().ListWorkers())
    *response->add_workers() = ToWire(view);
  return grpc::Status::OK;
}

grpc::Status JobService::LiftQuarantine(grpc::ServerContext* context,
                                        const v1::LiftQuarantineRequest* request,
                                        v1::LiftQuarantineResponse* /*response*/) {
  if (request->identity().empty() || request->identity().size() > kWorkerTextBytesMax) {
    return ToGrpcStatus(absl::InvalidArgumentError(absl::StrCat(
        "identity: must have 1 to ", kWorkerTextBytesMax, " bytes; sheaf workers shows it")));
  }
  const absl::Status lifted = farm_->LiftQuarantine(request->identity());
  NoteInAudit(*context, access_, "LiftQuarantine", request->identity(), lifted);
  return ToGrpcStatus(lifted);
}

}  // namespace sheaf::coordinator
