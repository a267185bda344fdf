// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Requests and responses as plain values. The socket side (http_server) reads and writes them; the
// code that answers them (http_router, http_api) depends on nothing else and is tested without
// sockets.
#pragma once

#include <string>
#include <utility>
#include <vector>

#include "coordinator/access/identity.h"

namespace sheaf::coordinator {

struct HttpRequest {
  // "GET", "POST" and so on. HEAD reaches the router as "GET"; the server omits the body.
  std::string method;
  // Path and query as sent by the client: "/api/v1/jobs?page_size=10".
  std::string target;
  // In the order sent. Use HeaderValue to find one.
  std::vector<std::pair<std::string, std::string>> headers;
  std::string body;
  std::string peer;  // The client's address.

  // Filled by the router. operation: the route, "GET /api/v1/jobs/{}"; caller: who sends the
  // request, without an identity where the coordinator has no certificates.
  std::string operation;
  Caller caller;
  // Filled by the router from target and the matched pattern, percent-decoded.
  std::vector<std::string> path_parameters;
  std::vector<std::pair<std::string, std::string>> query;
};

struct HttpResponse {
  int status = 200;
  std::string content_type = "text/plain; charset=utf-8";
  // In addition to Content-Type, Content-Length and the security headers, which the server adds.
  std::vector<std::pair<std::string, std::string>> headers;
  std::string body;
  // If not empty, the body is this file, sent in pieces, and `body` is ignored.
  std::string file_path;
};

// The value of a header, ignoring case in its name; "" if it is absent.
std::string HeaderValue(const HttpRequest& request, const std::string& name);

// The value of a query parameter; "" if it is absent.
std::string QueryValue(const HttpRequest& request, const std::string& name);

// A JSON error: {"error": {"code": "NOT_FOUND", "message": "..."}}.
// `code` is the canonical name of the status code as gRPC spells it.
HttpResponse HttpError(int status, const std::string& code, const std::string& message);

}  // namespace sheaf::coordinator
