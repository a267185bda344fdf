// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// JobService over gRPC: submitting and watching.
#pragma once

#include <atomic>
#include <functional>
#include <string>

#include "coordinator/access/access_control.h"
#include "coordinator/core/job/job_verbs.h"
#include "coordinator/service/farm/farm.h"
#include "coordinator/service/grpc/job_watches.h"
#include "coordinator/service/grpc/wire.h"
#include "sheaf/v1/job.grpc.pb.h"

namespace sheaf::coordinator {

inline constexpr int kJobPageSizeDefault = 100;
inline constexpr int kJobPageSizeMax = 1000;
inline constexpr int kMissingNamesMax = 20;  // Listed in a message about missing blobs.

class JobService final : public v1::JobService::Service {
 public:
  // Both must outlive the service. access: null without certificates; every caller may do
  // everything.
  explicit JobService(Farm* farm, AccessControl* access = nullptr)
      : farm_(farm), access_(access), watches_(farm) {}
  // Ends watches, so that the server can stop.
  void Stop() { stopping_ = true; }

  // CreateJob for the owner, who is admitted and within the limits of calls. Errors: those of the
  // call.
  absl::StatusOr<JobView> CreateFor(const std::string& owner, const v1::CreateJobRequest& request);

  grpc::Status CreateJob(grpc::ServerContext* context, const v1::CreateJobRequest* request,
                         v1::Job* response) override;
  grpc::Status GetJob(grpc::ServerContext* context, const v1::GetJobRequest* request,
                      v1::Job* response) override;
  grpc::Status ListJobs(grpc::ServerContext* context, const v1::ListJobsRequest* request,
                        v1::ListJobsResponse* response) override;
  // The verbs of job_verbs.h.
#define SHEAF_VERB(call, word, takes)                                                            \
  grpc::Status call(grpc::ServerContext* context, const v1::call##Request* request,              \
                    v1::Job* response) override {                                                \
    return Change(*context, JobVerb::k##call, request->name(), ArgumentsOf(*request), response); \
  }
  SHEAF_JOB_VERBS(SHEAF_VERB)
#undef SHEAF_VERB
  grpc::Status ListJobEvents(grpc::ServerContext* context, const v1::ListJobEventsRequest* request,
                             v1::ListJobEventsResponse* response) override;
  grpc::Status CollectGarbage(grpc::ServerContext* context,
                              const v1::CollectGarbageRequest* request,
                              v1::CollectGarbageResponse* response) override;
  grpc::Status ReadTaskBundle(grpc::ServerContext* context,
                              const v1::ReadTaskBundleRequest* request,
                              grpc::ServerWriter<v1::ReadTaskBundleResponse>* writer) override;
  grpc::Status SetShare(grpc::ServerContext* context, const v1::SetShareRequest* request,
                        v1::Share* response) override;
  grpc::Status ResetShare(grpc::ServerContext* context, const v1::ResetShareRequest* request,
                          v1::ResetShareResponse* response) override;
  grpc::Status ListShares(grpc::ServerContext* context, const v1::ListSharesRequest* request,
                          v1::ListSharesResponse* response) override;
  grpc::Status ListUsage(grpc::ServerContext* context, const v1::ListUsageRequest* request,
                         v1::ListUsageResponse* response) override;
  grpc::Status DrainWorkers(grpc::ServerContext* context, const v1::DrainWorkersRequest* request,
                            v1::DrainWorkersResponse* response) override;
  grpc::Status UndrainWorkers(grpc::ServerContext* context,
                              const v1::UndrainWorkersRequest* request,
                              v1::UndrainWorkersResponse* response) override;
  grpc::Status LiftQuarantine(grpc::ServerContext* context,
                              const v1::LiftQuarantineRequest* request,
                              v1::LiftQuarantineResponse* response) override;
  grpc::Status PriceRefinement(grpc::ServerContext* context,
                               const v1::PriceRefinementRequest* request,
                               v1::PriceRefinementResponse* response) override;
  grpc::Status WatchJob(grpc::ServerContext* context, const v1::WatchJobRequest* request,
                        grpc::ServerWriter<v1::Job>* writer) override;
  grpc::Status ReadFrameOutput(grpc::ServerContext* context,
                               const v1::ReadFrameOutputRequest* request,
                               grpc::ServerWriter<v1::ReadFrameOutputResponse>* writer) override;
  grpc::Status ListWorkers(grpc::ServerContext* context, const v1::ListWorkersRequest* request,
                           v1::ListWorkersResponse* response) override;

 private:
  // The task that the request names, if the caller may control its job.
  absl::StatusOr<TaskReport> FindTask(const grpc::ServerContext& context,
                                      const v1::ReadTaskBundleRequest& request) const;
  absl::StatusOr<JobView> Find(const std::string& name) const;
  // Changes a job, if the caller may, and answers with its new state. arguments: an error is the
  // answer.
  grpc::Status Change(const grpc::ServerContext& context, JobVerb verb, const std::string& name,
                      absl::StatusOr<JobArguments> arguments, v1::Job* response);
  absl::StatusOr<JobView> TryChange(const grpc::ServerContext& context, JobVerb verb,
                                    const std::string& name, const JobArguments& arguments);
  absl::StatusOr<ShareView> TrySetShare(const v1::SetShareRequest& request);
  // Adds those of these ids. Requires: ids is sorted.
  void AddWorkers(const std::vector<std::string>& ids,
                  google::protobuf::RepeatedPtrField<v1::Worker>* workers) const;
  // Errors: kFailedPrecondition, naming the missing blobs.
  absl::Status RequireBlobs(const JobSpec& spec) const;
  absl::Status RequireFilesOf(const BlobDigest& scene) const;
  // Checks that a job of the owner may begin, given the owner's stored bytes. Errors:
  // kResourceExhausted, counted.
  absl::Status RequireRoom(const std::string& owner) const;

  Farm* const farm_;
  AccessControl* const access_;
  JobWatches watches_;
  std::atomic<bool> stopping_{false};
};

}  // namespace sheaf::coordinator
