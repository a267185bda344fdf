// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// The calls of JobService for operators: shares, drained workers, accounts and removals.
#include <algorithm>
#include <string>
#include <vector>

#include "absl/strings/str_cat.h"
#include "absl/strings/strip.h"
#include "common/base/printable.h"
#include "common/rpc/grpc_status.h"
#include "coordinator/service/grpc/caller.h"
#include "coordinator/service/grpc/job_service.h"
#include "coordinator/service/grpc/wire.h"

namespace sheaf::coordinator {
namespace {

// "user:anna weight 2 threads_max 64": the request, for the audit log.
std::string AskedText(const v1::SetShareRequest& request) {
  std::string text = Printable(request.subject());
  if (request.has_weight()) absl::StrAppend(&text, " weight ", request.weight());
  if (request.has_threads_max()) absl::StrAppend(&text, " threads_max ", request.threads_max());
  return text;
}

// Errors: kInvalidArgument.
absl::StatusOr<ChosenWorkers> ChosenBy(const google::protobuf::RepeatedPtrField<std::string>& names,
                                       const std::string& host) {
  ChosenWorkers chosen{{}, host};
  for (const std::string& name : names) {
    absl::string_view id = name;
    if (!absl::ConsumePrefix(&id, "workers/") || id.empty() || id.size() > kWorkerTextBytesMax) {
      return absl::InvalidArgumentError(
          absl::StrCat("names: \"", name, "\" is not of the form workers/ID"));
    }
    chosen.worker_ids.emplace_back(id);
  }
  if (host.size() > kWorkerTextBytesMax) {
    return absl::InvalidArgumentError(
        absl::StrCat("host: is over ", kWorkerTextBytesMax, " bytes"));
  }
  return chosen;
}

}  // namespace

absl::StatusOr<ShareView> JobService::TrySetShare(const v1::SetShareRequest& request) {
  const absl::StatusOr<ShareSubject> subject = ParseShareSubject(request.subject());
  if (!subject.ok()) return subject.status();
  if (!request.has_weight() && !request.has_threads_max()) {
    return absl::InvalidArgumentError("neither a weight nor threads_max is given");
  }
  return farm_->share_control().Set(*subject, [&](ShareSetting* setting) {
    if (request.has_weight()) setting->weight = request.weight();
    if (request.has_threads_max()) setting->threads_max = request.threads_max();
  });
}

grpc::Status JobService::SetShare(grpc::ServerContext* context, const v1::SetShareRequest* request,
                                  v1::Share* response) {
  const absl::StatusOr<ShareView> view = TrySetShare(*request);
  NoteInAudit(*context, access_, "SetShare", AskedText(*request), view.status());
  if (!view.ok()) return ToGrpcStatus(view.status());
  *response = ToWire(*view);
  return grpc::Status::OK;
}

grpc::Status JobService::ResetShare(grpc::ServerContext* context,
                                    const v1::ResetShareRequest* request,
                                    v1::ResetShareResponse* /*response*/) {
  const absl::StatusOr<ShareSubject> subject = ParseShareSubject(request->subject());
  const absl::Status reset =
      subject.ok() ? farm_->share_control().Reset(*subject) : subject.status();
  NoteInAudit(*context, access_, "ResetShare", Printable(request->subject()), reset);
  return ToGrpcStatus(reset);
}

grpc::Status JobService::ListShares(grpc::ServerContext* /*context*/,
                                    const v1::ListSharesRequest* /*request*/,
                                    v1::ListSharesResponse* response) {
  for (const ShareView& view : farm_->share_control().List()) {
    *response->add_shares() = ToWire(view);
  }
  return grpc::Status::OK;
}

void JobService::AddWorkers(const std::vector<std::string>& ids,
                            google::protobuf::RepeatedPtrField<v1::Worker>* workers) const {
  for (const WorkerView& view : farm_->view().ListWorkers()) {
    if (std::ranges::binary_search(ids, view.worker_id)) *workers->Add() = ToWire(view);
  }
}

grpc::Status JobService::DrainWorkers(grpc::ServerContext* context,
                                      const v1::DrainWorkersRequest* request,
                                      v1::DrainWorkersResponse* response) {
  const absl::StatusOr<ChosenWorkers> chosen = ChosenBy(request->names(), request->host());
  if (!chosen.ok()) return ToGrpcStatus(chosen.status());
  const absl::StatusOr<std::vector<std::string>> ids =
      farm_->drains().Drain(*chosen, request->then_exit());
  if (!ids.ok()) {
    NoteInAudit(*context, access_, "DrainWorkers", "nothing", ids.status());
    return ToGrpcStatus(ids.status());
  }
  for (const std::string& id : *ids) {
    NoteInAudit(*context, access_, "DrainWorkers", absl::StrCat("workers/", id), absl::OkStatus());
  }
  AddWorkers(*ids, response->mutable_workers());
  return grpc::Status::OK;
}

grpc::Status JobService::UndrainWorkers(grpc::ServerContext* context,
                                        const v1::UndrainWorkersRequest* request,
                                        v1::UndrainWorkersResponse* response) {
  const absl::StatusOr<ChosenWorkers> chosen = ChosenBy(request->names(), request->host());
  if (!chosen.ok()) return ToGrpcStatus(chosen.status());
  const absl::StatusOr<std::vector<std::string>> ids = farm_->drains().Undrain(*chosen);
  if (!ids.ok()) {
    NoteInAudit(*context, access_, "UndrainWorkers", "nothing", ids.status());
    return ToGrpcStatus(ids.status());
  }
  for (const std::string& id : *ids) {
    NoteInAudit(*context, access_, "UndrainWorkers", absl::StrCat("workers/", id),
                absl::OkStatus());
  }
  AddWorkers(*ids, response->mutable_workers());
  return grpc::Status::OK;
}

absl::Status JobService::RequireRoom(const std::string& owner) const {
  absl::Status room = farm_->keeper().CheckOwner(owner, /*more=*/0);
  if (!room.ok() && access_ != nullptr) access_->use().NoteRefused(IdentityLimit::kStoredBytes);
  return room;
}

grpc::Status JobService::ListUsage(grpc::ServerContext* context,
                                   const v1::ListUsageRequest* request,
                                   v1::ListUsageResponse* response) {
  absl::StatusOr<UsageQuery> query =
      ParseUsageQuery(request->by(), request->since_day(), request->until_day(), request->daily());
  if (!query.ok()) return ToGrpcStatus(query.status());
  const absl::StatusOr<Caller> caller = CallerOf(*context, access_);
  if (!caller.ok()) return ToGrpcStatus(caller.status());
  query->owner = AccessControl::UsageOwnerOf(*caller);
  const absl::StatusOr<UsageReport> report = farm_->ListUsage(*query);
  if (!report.ok()) return ToGrpcStatus(report.status());
  for (const UsageSum& sum : report->sums) {
    v1::UsageRow& row = *response->add_rows();
    const Usage& usage = sum.usage;
    if (sum.day) row.set_day(FormatUsageDay(*sum.day));
    row.set_user(sum.user);
    row.set_show(sum.show);
    row.set_job(sum.job);
    row.set_result_count(usage.result_count);
    row.set_sample_count(usage.sample_count);
    row.set_ray_count(usage.ray_count);
    row.set_cpu_seconds(absl::ToDoubleSeconds(usage.cpu_duration));
    row.set_repeated_count(usage.repeated_count);
    row.set_repeated_cpu_seconds(absl::ToDoubleSeconds(usage.repeated_cpu_duration));
    row.set_lost_count(usage.lost_count);
    row.set_lost_cpu_seconds(absl::ToDoubleSeconds(usage.lost_cpu_duration));
    row.set_upload_bytes(usage.upload_bytes);
    row.set_part_bytes(usage.part_bytes);
    row.set_image_bytes(usage.image_bytes);
  }
  for (const StoredView& view : report->stored) {
    v1::StoredBytes& stored = *response->add_stored();
    stored.set_user(view.user);
    stored.set_total_bytes(view.bytes.Total());
    if (view.bytes_max != UINT64_MAX) stored.set_limit_bytes(view.bytes_max);
    stored.set_part_bytes(view.bytes.part_bytes);
    stored.set_image_bytes(view.bytes.image_bytes);
    stored.set_preview_bytes(view.bytes.preview_bytes);
    stored.set_content_bytes(view.bytes.content_bytes);
  }
  return grpc::Status::OK;
}

grpc::Status JobService::CollectGarbage(grpc::ServerContext* context,
                                        const v1::CollectGarbageRequest* request,
                                        v1::CollectGarbageResponse* response) {
  const absl::StatusOr<std::vector<RemovalView>> removals =
      farm_->keeper().CollectForPeople(request->dry_run());
  if (!request->dry_run()) {
    const std::string what =
        removals.ok() ? absl::StrCat(removals->size(), " removals") : std::string("nothing");
    NoteInAudit(*context, access_, "CollectGarbage", what, removals.status());
  }
  if (!removals.ok()) return ToGrpcStatus(removals.status());
  for (const RemovalView& view : *removals) *response->add_removals() = ToWire(view);
  return grpc::Status::OK;
}

}  // namespace sheaf::coordinator
