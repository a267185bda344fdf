// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// A request and a response as plain values. The socket side (http_server) fills and sends them;
// what answers them (http_router, http_api) sees nothing else and is tested without a socket.
#pragma once

#include <string>
#include <utility>
#include <vector>

namespace sheaf::coordinator {

struct HttpRequest {
  // "GET", "POST" and so on. HEAD reaches the router as "GET"; the server leaves out the body.
  std::string method;
  // Path and query as the client sent them: "/api/v1/jobs?page_size=10".
  std::string target;
  // In the order sent. Look them up with HeaderValue.
  std::vector<std::pair<std::string, std::string>> headers;
  std::string body;

  // Filled by the router from target and the matched pattern, percent-decoded.
  std::vector<std::string> path_parameters;
  std::vector<std::pair<std::string, std::string>> query;
};

struct HttpResponse {
  int status = 200;
  std::string content_type = "text/plain; charset=utf-8";
  // Beside Content-Type, Content-Length and the security headers that the server adds itself.
  std::vector<std::pair<std::string, std::string>> headers;
  std::string body;
  // Where not empty, the body is this file, streamed in pieces, and `body` is ignored.
  std::string file_path;
};

// The value of a header, matched without regard to case, or "" where it is absent.
std::string HeaderValue(const HttpRequest& request, const std::string& name);

// The value of a query parameter, or "" where it is absent.
std::string QueryValue(const HttpRequest& request, const std::string& name);

// A JSON error: {"error": {"code": "NOT_FOUND", "message": "..."}}.
// `code` is the canonical name of the status code as gRPC spells it.
HttpResponse HttpError(int status, const std::string& code, const std::string& message);

}  // namespace sheaf::coordinator
