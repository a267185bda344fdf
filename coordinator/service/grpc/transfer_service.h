// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// TransferService over gRPC: small blobs together, large ones by chunks, and the blobs that workers
// hold.
#pragma once

#include "common/content/blob_store.h"
#include "coordinator/access/access_control.h"
#include "coordinator/service/farm/farm.h"
#include "sheaf/v1/transfer.grpc.pb.h"

namespace sheaf::coordinator {

// Limits of one message.
inline constexpr int kReportedBlobsMax = 10'000;
inline constexpr int kReportedFetchesMax = 64;
inline constexpr int kReportedTroublesMax = 1000;
inline constexpr int kTriedPeersMax = 64;
// Retry interval of a worker that waits for another one's fetch.
inline constexpr absl::Duration kLocateRetry = absl::Milliseconds(100);

class TransferService final : public v1::TransferService::Service {
 public:
  // All must outlive the service. access: null without certificates.
  TransferService(Farm* farm, AccessControl* access)
      : farm_(farm), blobs_(&farm->blobs()), content_(&farm->content()), access_(access) {}

  grpc::Status WriteSmallBlobs(grpc::ServerContext* context,
                               const v1::WriteSmallBlobsRequest* request,
                               v1::WriteSmallBlobsResponse* response) override;
  grpc::Status PlanWrite(grpc::ServerContext* context, const v1::PlanWriteRequest* request,
                         v1::PlanWriteResponse* response) override;
  grpc::Status WriteChunks(grpc::ServerContext* context,
                           grpc::ServerReader<v1::WriteChunksRequest>* reader,
                           v1::WriteChunksResponse* response) override;
  grpc::Status LocateBlob(grpc::ServerContext* context, const v1::LocateBlobRequest* request,
                          v1::LocateBlobResponse* response) override;
  grpc::Status ReportContent(grpc::ServerContext* context, const v1::ReportContentRequest* request,
                             v1::ReportContentResponse* response) override;

 private:
  absl::Status WriteSmall(const grpc::ServerContext& context,
                          const v1::WriteSmallBlobsRequest& request);

  Farm* const farm_;
  const BlobStore* const blobs_;
  ContentExchange* const content_;
  AccessControl* const access_;
};

}  // namespace sheaf::coordinator
