// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// ContentService over gRPC: blobs in and out of a BlobStore.
#pragma once

#include "common/content/blob_store.h"
#include "coordinator/access/access_control.h"
#include "coordinator/service/farm/farm.h"
#include "sheaf/v1/content.grpc.pb.h"

namespace sheaf::coordinator {

inline constexpr int kFindMissingDigestsMax = 10'000;

class ContentService final : public v1::ContentService::Service {
 public:
  // All must outlive the service. access: null without certificates.
  explicit ContentService(Farm* farm, AccessControl* access = nullptr)
      : farm_(farm), blobs_(&farm->blobs()), access_(access) {}

  grpc::Status FindMissing(grpc::ServerContext* context, const v1::FindMissingRequest* request,
                           v1::FindMissingResponse* response) override;
  grpc::Status GetWriteStatus(grpc::ServerContext* context,
                              const v1::GetWriteStatusRequest* request,
                              v1::GetWriteStatusResponse* response) override;
  grpc::Status WriteBlob(grpc::ServerContext* context,
                         grpc::ServerReader<v1::WriteBlobRequest>* reader,
                         v1::WriteBlobResponse* response) override;
  grpc::Status ReadBlob(grpc::ServerContext* context, const v1::ReadBlobRequest* request,
                        grpc::ServerWriter<v1::ReadBlobResponse>* writer) override;

 private:
  Farm* const farm_;
  const BlobStore* const blobs_;
  AccessControl* const access_;
};

}  // namespace sheaf::coordinator
