// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Look-ups in a request, and the format of errors.
#include "coordinator/service/http/server/http_message.h"

#include <nlohmann/json.hpp>

#include "absl/strings/match.h"

namespace sheaf::coordinator {

std::string HeaderValue(const HttpRequest& request, const std::string& name) {
  for (const auto& [key, value] : request.headers) {
    if (absl::EqualsIgnoreCase(key, name)) return value;
  }
  return "";
}

std::string QueryValue(const HttpRequest& request, const std::string& name) {
  for (const auto& [key, value] : request.query) {
    if (key == name) return value;
  }
  return "";
}

HttpResponse HttpError(int status, const std::string& code, const std::string& message) {
  const nlohmann::json error = {{"error", {{"code", code}, {"message", message}}}};
  HttpResponse response;
  response.status = status;
  response.content_type = "application/json";
  response.headers = {{"Cache-Control", "no-store"}};
  // Text from a client may not be valid UTF-8; invalid bytes are replaced, as dump would throw.
  response.body = error.dump(-1, ' ', false, nlohmann::json::error_handler_t::replace) + "\n";
  return response;
}

}  // namespace sheaf::coordinator
