// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// HttpRouter: finds the function that answers a request, after checks against other web sites. A
// page of another site can make a browser send requests to a loopback port, directly or by DNS
// rebinding. So the Host header must be one of ours, and requests that change something need a
// header that a page of another site cannot set without a preflight request.
#pragma once

#include <functional>
#include <string>
#include <utility>
#include <vector>

#include "coordinator/service/http/http_message.h"

namespace sheaf::coordinator {

// Answers one request. Runs on the server's only handler thread, so it must not block.
using HttpFunction = std::function<HttpResponse(const HttpRequest&)>;

// One route. A segment of `pattern` is literal text, or "{}" followed by literal text:
// "/api/v1/jobs/{}:cancel" matches "/api/v1/jobs/7:cancel" with the path parameter "7".
struct HttpRoute {
  std::string method;
  std::string pattern;
  HttpFunction answer;
};

class HttpRouter {
 public:
  // allowed_hosts: names under which clients may reach the server, in addition to "localhost" and
  // numeric addresses (which no DNS answer can forge).
  HttpRouter(std::vector<HttpRoute> routes, std::vector<std::string> allowed_hosts);

  // Always returns a response, also for refused requests and unknown paths. Thread safety: const,
  // as long as the functions of the routes are.
  HttpResponse Route(HttpRequest request) const;

  // Returns whether the Host, Origin and kRequestHeader headers permit the request. If not,
  // *refusal is the response; otherwise it is not changed.
  bool Admits(const HttpRequest& request, HttpResponse* refusal) const;

 private:
  bool HostIsOurs(const std::string& host) const;

  std::vector<HttpRoute> routes_;
  std::vector<std::string> allowed_hosts_;
};

// The header, with any value, that every changing request must have.
inline constexpr char kRequestHeader[] = "X-Sheaf-Request";

}  // namespace sheaf::coordinator
