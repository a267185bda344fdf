// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "common/rpc/protocol_calls.h"

#include <optional>
#include <string>
#include <utility>

#include "common/rpc/grpc_status.h"

namespace sheaf {
namespace {

namespace experimental = grpc::experimental;
using Hook = experimental::InterceptionHookPoints;

constexpr std::string_view kSheafServices = "/sheaf.";

// The value of kProtocolKey; nothing without it.
std::optional<std::string> SaidIn(const CallMetadata& metadata) {
  const auto found = metadata.find(kProtocolKey);
  if (found == metadata.end()) return std::nullopt;
  return std::string(found->second.data(), found->second.size());
}

// Lives as long as a call of a client.
class ClientProtocol final : public experimental::Interceptor {
 public:
  ClientProtocol(experimental::ClientRpcInfo* info, const ProtocolRange& ours)
      : info_(info), ours_(ours) {}

  void Intercept(experimental::InterceptorBatchMethods* methods) override {
    if (methods->QueryInterceptionHookPoint(Hook::PRE_SEND_INITIAL_METADATA)) {
      methods->GetSendInitialMetadata()->emplace(kProtocolKey, FormatProtocol(ours_));
    }
    if (methods->QueryInterceptionHookPoint(Hook::POST_RECV_INITIAL_METADATA)) {
      TakeAnswer(*methods->GetRecvInitialMetadata());
    }
    if (methods->QueryInterceptionHookPoint(Hook::POST_RECV_STATUS)) {
      grpc::Status* const status = methods->GetRecvStatus();
      // A refusal, or the end of a connection, may come without the server's metadata.
      if (!has_answer_ && status->ok()) agreed_ = Agree("");
      if (!agreed_.ok()) *status = ToGrpcStatus(agreed_);
    }
    methods->Proceed();
  }

 private:
  absl::Status Agree(std::string_view theirs) const {
    const absl::StatusOr<ProtocolRange> range = ParseProtocol(theirs);
    return range.ok() ? AgreeOnProtocol(ours_, *range).status() : range.status();
  }
  void TakeAnswer(const CallMetadata& metadata) {
    const std::optional<std::string> said = SaidIn(metadata);
    if (!said) return;
    has_answer_ = true;
    agreed_ = Agree(*said);
    // A stream would continue otherwise.
    if (!agreed_.ok()) info_->client_context()->TryCancel();
  }

  experimental::ClientRpcInfo* const info_;
  const ProtocolRange ours_;
  bool has_answer_ = false;
  absl::Status agreed_;
};

class ClientProtocolFactory final : public experimental::ClientInterceptorFactoryInterface {
 public:
  explicit ClientProtocolFactory(const ProtocolRange& ours) : ours_(ours) {}
  experimental::Interceptor* CreateClientInterceptor(experimental::ClientRpcInfo* info) override {
    return new ClientProtocol(info, ours_);
  }

 private:
  const ProtocolRange ours_;
};

class ServerProtocol final : public experimental::Interceptor {
 public:
  explicit ServerProtocol(const std::string& ours) : ours_(ours) {}

  void Intercept(experimental::InterceptorBatchMethods* methods) override {
    if (methods->QueryInterceptionHookPoint(Hook::PRE_SEND_INITIAL_METADATA)) {
      methods->GetSendInitialMetadata()->emplace(kProtocolKey, ours_);
    }
    methods->Proceed();
  }

 private:
  const std::string& ours_;
};

class ServerProtocolFactory final : public experimental::ServerInterceptorFactoryInterface {
 public:
  explicit ServerProtocolFactory(const ProtocolRange& ours) : ours_(FormatProtocol(ours)) {}
  experimental::Interceptor* CreateServerInterceptor(
      experimental::ServerRpcInfo* /*info*/) override {
    return new ServerProtocol(ours_);
  }

 private:
  const std::string ours_;
};

}  // namespace

std::vector<std::unique_ptr<experimental::ClientInterceptorFactoryInterface>> ProtocolOfClient(
    const ProtocolRange& ours) {
  std::vector<std::unique_ptr<experimental::ClientInterceptorFactoryInterface>> factories;
  factories.push_back(std::make_unique<ClientProtocolFactory>(ours));
  return factories;
}

std::unique_ptr<experimental::ServerInterceptorFactoryInterface> ProtocolOfServer(
    const ProtocolRange& ours) {
  return std::make_unique<ServerProtocolFactory>(ours);
}

absl::StatusOr<int> ProtocolOfCaller(const CallMetadata& metadata, const ProtocolRange& ours) {
  const absl::StatusOr<ProtocolRange> range = ParseProtocol(SaidIn(metadata).value_or(""));
  if (!range.ok()) return range.status();
  return AgreeOnProtocol(*range, ours);
}

absl::Status CheckCaller(std::string_view operation, std::string_view said,
                         const ProtocolRange& ours) {
  if (!operation.starts_with(kSheafServices)) return absl::OkStatus();
  const absl::StatusOr<ProtocolRange> range = ParseProtocol(said);
  if (!range.ok()) return range.status();
  return AgreeOnProtocol(*range, ours).status();
}

}  // namespace sheaf
