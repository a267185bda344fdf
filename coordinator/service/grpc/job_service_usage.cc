// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// The part of JobService that reports accounts, and refuses jobs of users with too many stored
// bytes.
#include "common/rpc/grpc_status.h"
#include "coordinator/service/grpc/caller.h"
#include "coordinator/service/grpc/job_service.h"

namespace sheaf::coordinator {

absl::Status JobService::RequireRoom(const std::string& owner) const {
  absl::Status room = farm_->CheckOwnerBytes(owner, /*more=*/0);
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

}  // namespace sheaf::coordinator
