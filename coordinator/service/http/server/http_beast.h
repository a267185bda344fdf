// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Requests and responses in the form of Boost.Beast. Internal to http_server.cc.
#pragma once

#include <utility>  // Before asio of Boost 1.74, which uses std::exchange unasked.

#include <boost/beast/http.hpp>
#include <optional>
#include <string>

#include "absl/strings/str_cat.h"
#include "coordinator/service/http/server/http_connection.h"
#include "coordinator/service/http/server/http_message.h"
#include "coordinator/service/http/server/http_server.h"

namespace sheaf::coordinator {

namespace http = boost::beast::http;

// Sent with every response: content types are not guessed, the page may not be framed, and it loads
// nothing from other origins.
inline constexpr std::pair<const char*, const char*> kSecurityHeaders[] = {
    {"X-Content-Type-Options", "nosniff"},
    {"X-Frame-Options", "DENY"},
    {"Referrer-Policy", "no-referrer"},
    {"Cross-Origin-Resource-Policy", "same-origin"},
    {"Content-Security-Policy",
     "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' blob:; "
     "connect-src 'self'; base-uri 'none'; form-action 'none'; frame-ancestors 'none'"},
};

inline HttpRequest ToRequest(const http::request<http::string_body>& message) {
  HttpRequest request;
  request.method =
      message.method() == http::verb::head ? "GET" : std::string(message.method_string());
  request.target = std::string(message.target());
  for (const auto& field : message) {
    request.headers.emplace_back(std::string(field.name_string()), std::string(field.value()));
  }
  request.body = message.body();
  return request;
}

// The response without its body.
template <class Body>
void SetHead(const HttpResponse& response, bool keep_alive, http::response<Body>* message) {
  message->version(11);
  message->result(static_cast<unsigned>(response.status));
  message->set(http::field::content_type, response.content_type);
  for (const auto& [name, value] : kSecurityHeaders) message->set(name, value);
  for (const auto& [name, value] : response.headers) message->set(name, value);
  message->keep_alive(keep_alive);
}

// The response to a request that could not be read; none if the client closed the connection.
inline std::optional<HttpResponse> ReadRefusal(const error_code& error) {
  if (error == http::error::header_limit || error == http::error::buffer_overflow) {
    return HttpError(
        431, "RESOURCE_EXHAUSTED",
        absl::StrCat("the request's head is longer than ", kHttpHeaderBytesMax, " bytes"));
  }
  if (error == http::error::body_limit) {
    return HttpError(
        413, "RESOURCE_EXHAUSTED",
        absl::StrCat("the request's body is longer than ", kHttpBodyBytesMax, " bytes"));
  }
  const bool malformed = error.category() == make_error_code(http::error::bad_method).category() &&
                         error != http::error::end_of_stream &&
                         error != http::error::partial_message;
  if (malformed) return HttpError(400, "INVALID_ARGUMENT", "malformed request: " + error.message());
  return std::nullopt;
}

}  // namespace sheaf::coordinator
