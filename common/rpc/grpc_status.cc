// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "common/rpc/grpc_status.h"

#include <string>
#include <utility>

#include "absl/strings/str_cat.h"
#include "common/rpc/protobuf_log.h"

namespace sheaf {
namespace {

// Fragments of gRPC's messages, most specific first, and their plain words.
constexpr std::pair<const char*, const char*> kPlainDescriptions[] = {
    {"Connection refused", "the connection was refused"},
    {"No route to host", "it is unreachable"},
    {"Network is unreachable", "it is unreachable"},
    {"DNS resolution failed", "its name is unknown"},
    {"http1.x server", "the port is not the gRPC port of a coordinator"},
    {"handshaker shutdown", "it does not answer"},
    {"before receiving SETTINGS", "it does not answer"},
    {"Connection timed out", "it does not answer"},
    {"watchdog timeout", "it does not answer any more"},
    {"Deadline Exceeded", "no answer in time"},
    {"Connection reset", "the connection was lost"},
    {"Broken pipe", "the connection was lost"},
    {"Socket closed", "the connection was lost"},
    {"GOAWAY", "the connection was closed"},
    {"failed to connect to all addresses", "there is no connection"},
};

std::string DescribePlainly(const grpc::Status& status) {
  if (status.error_message().empty() && status.error_code() == grpc::StatusCode::INTERNAL) {
    const std::string field = TakeFieldThatIsNotUtf8();
    return field.empty()
               ? "the call failed without a reason; the log of the coordinator may have it"
               : absl::StrCat(field, ": is not UTF-8; write it in UTF-8");
  }
  const bool of_the_connection = status.error_code() == grpc::StatusCode::UNAVAILABLE ||
                                 status.error_code() == grpc::StatusCode::DEADLINE_EXCEEDED;
  for (const auto& [part, words] : kPlainDescriptions) {
    if (of_the_connection && status.error_message().find(part) != std::string::npos) return words;
  }
  return status.error_message();
}

}  // namespace

grpc::Status ToGrpcStatus(const absl::Status& status) {
  if (status.ok()) return grpc::Status::OK;
  // Both enumerations hold the canonical codes 1 to 16 with equal numbers.
  return {static_cast<grpc::StatusCode>(static_cast<int>(status.code())),
          std::string(status.message())};
}

absl::Status FromGrpcStatus(const grpc::Status& status) {
  if (status.ok()) return absl::OkStatus();
  const int code = static_cast<int>(status.error_code());
  const bool canonical = code >= 1 && code <= 16;
  return {canonical ? static_cast<absl::StatusCode>(code) : absl::StatusCode::kUnknown,
          DescribePlainly(status)};
}

absl::Status NoCoordinatorAnswers(const std::string& address, const absl::Status& status) {
  if (!absl::IsUnavailable(status) && !absl::IsDeadlineExceeded(status)) return status;
  return {status.code(),
          absl::StrCat("no coordinator answers at ", address, ": ", status.message(),
                       "; start one with sheaf-coordinator, or name another with --coordinator "
                       "HOST:PORT")};
}

}  // namespace sheaf
