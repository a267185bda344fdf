// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// GrpcCoordinatorLink: a CoordinatorLink over gRPC. One attempt per call, each with a deadline; the
// agent repeats.
#pragma once

#include <grpcpp/channel.h>
#include <grpcpp/client_context.h>

#include <memory>
#include <set>
#include <string>
#include <vector>

#include "common/base/mutex.h"
#include "sheaf/v1/worker.grpc.pb.h"
#include "worker/agent/coordinator_link.h"
#include "worker/service/direct_upload.h"

namespace sheaf::worker {

class GrpcCoordinatorLink : public CoordinatorLink {
 public:
  // Results use the channel data, everything else control. address is for messages only.
  GrpcCoordinatorLink(const std::shared_ptr<grpc::Channel>& control,
                      const std::shared_ptr<grpc::Channel>& data, std::string address);

  absl::StatusOr<DesiredState> Synchronize(const WorkerState& state) override;
  absl::StatusOr<std::vector<UploadOutcome>> UploadResults(
      const std::string& worker_id, const std::vector<const FinishedPart*>& parts) override;
  absl::StatusOr<Delivery> Deliver(const WorkerState& state,
                                   const std::vector<const FinishedPart*>& parts) override;
  void Abort() override;

 private:
  // Registers a call for Abort during its lifetime.
  class RunningCall;
  absl::StatusOr<std::vector<PutTicket>> PlanUploads(const std::string& worker_id,
                                                     const std::vector<const FinishedPart*>& parts);

  const std::unique_ptr<v1::WorkerService::Stub> control_, data_;
  const std::string address_;
  DirectUpload direct_;
  Mutex mutex_;
  std::set<grpc::ClientContext*> running_ ABSL_GUARDED_BY(mutex_);
  bool aborted_ ABSL_GUARDED_BY(mutex_) = false;
};

}  // namespace sheaf::worker
