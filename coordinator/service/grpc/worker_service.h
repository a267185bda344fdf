// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// WorkerService over gRPC: dispatch and results.
#pragma once

#include "coordinator/access/access_control.h"
#include "coordinator/service/farm/farm.h"
#include "coordinator/service/grpc/worker_versions.h"
#include "sheaf/v1/worker.grpc.pb.h"

namespace sheaf::coordinator {

inline constexpr int kResultsPerUploadMax = 1000;
// Limits of DeliverResults.
inline constexpr int kResultsPerDeliveryMax = 64;
inline constexpr size_t kDeliveryBytesMax = size_t{4} << 20;

class WorkerService final : public v1::WorkerService::Service {
 public:
  // Both must outlive the service. access: null without certificates.
  explicit WorkerService(Farm* farm, AccessControl* access = nullptr)
      : farm_(farm), access_(access) {}

  grpc::Status Synchronize(grpc::ServerContext* context, const v1::SynchronizeRequest* request,
                           v1::SynchronizeResponse* response) override;
  grpc::Status UploadResults(grpc::ServerContext* context,
                             grpc::ServerReader<v1::UploadResultsRequest>* reader,
                             v1::UploadResultsResponse* response) override;
  grpc::Status DeliverResults(grpc::ServerContext* context,
                              const v1::DeliverResultsRequest* request,
                              v1::DeliverResultsResponse* response) override;
  grpc::Status PlanUploads(grpc::ServerContext* context, const v1::PlanUploadsRequest* request,
                           v1::PlanUploadsResponse* response) override;
  grpc::Status ReadGuidingField(grpc::ServerContext* context,
                                const v1::ReadGuidingFieldRequest* request,
                                grpc::ServerWriter<v1::ReadGuidingFieldResponse>* writer) override;

 private:
  absl::Status TakeState(const grpc::ServerContext& context, const v1::SynchronizeRequest& request,
                         v1::SynchronizeResponse* response);

  Farm* const farm_;
  AccessControl* const access_;
  WorkerVersions versions_;
};

}  // namespace sheaf::coordinator
