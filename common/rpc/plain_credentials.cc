// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "common/rpc/plain_credentials.h"

#include <grpc/grpc_security.h>
#include <grpc/slice.h>

#include <string>
#include <string_view>

#include "absl/status/status.h"
#include "common/base/check.h"
#include "common/rpc/protocol_calls.h"

namespace sheaf {
namespace {

std::string_view TextOf(const grpc_slice& slice) {
  return {reinterpret_cast<const char*>(GRPC_SLICE_START_PTR(slice)), GRPC_SLICE_LENGTH(slice)};
}

// As gRPC's core asks, on its own threads; it keeps the metadata until `done` is called.
void AskForVersion(void* /*state*/, grpc_auth_context* /*context*/, const grpc_metadata* metadata,
                   size_t count, grpc_process_auth_metadata_done_cb done, void* user_data) {
  std::string_view operation, said;
  for (size_t i = 0; i < count; ++i) {
    if (TextOf(metadata[i].key) == ":path") operation = TextOf(metadata[i].value);
    if (TextOf(metadata[i].key) == kProtocolKey) said = TextOf(metadata[i].value);
  }
  const absl::Status status = CheckCaller(operation, said);
  const std::string words(status.message());
  done(user_data, nullptr, 0, nullptr, 0, static_cast<grpc_status_code>(status.code()),
       words.c_str());
}

class PlainCredentials final : public grpc::ServerCredentials {
 public:
  PlainCredentials() : core_(grpc_insecure_server_credentials_create()) {
    grpc_server_credentials_set_auth_metadata_processor(core_, {AskForVersion, nullptr, nullptr});
  }
  ~PlainCredentials() override { grpc_server_credentials_release(core_); }
  PlainCredentials(const PlainCredentials&) = delete;
  PlainCredentials& operator=(const PlainCredentials&) = delete;

  // It has its own.
  void SetAuthMetadataProcessor(
      const std::shared_ptr<grpc::AuthMetadataProcessor>& processor) override {
    SHEAF_CHECK(processor == nullptr);
  }

 private:
  int AddPortToServer(const std::string& address, grpc_server* server) override {
    return grpc_server_add_http2_port(server, address.c_str(), core_);
  }

  grpc_server_credentials* const core_;
};

}  // namespace

std::shared_ptr<grpc::ServerCredentials> PlainServerCredentials() {
  return std::make_shared<PlainCredentials>();
}

}  // namespace sheaf
