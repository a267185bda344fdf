// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Finds the function that answers a request, after the checks that keep other web sites out. A page
// of another site can make a browser send requests to a loopback port, by DNS rebinding or plainly;
// so the Host must be one of ours, and whatever changes something needs a header that a foreign
// page cannot set without asking first.
#pragma once

#include <functional>
#include <string>
#include <utility>
#include <vector>

#include "coordinator/service/http/http_message.h"

namespace sheaf::coordinator {

// Answers one request. Runs on the server's only thread: it must not wait.
using HttpFunction = std::function<HttpResponse(const HttpRequest&)>;

// One row of the table. A segment of `pattern` is literal text, or "{}" with literal text after it:
// "/api/v1/jobs/{}:cancel" matches "/api/v1/jobs/7:cancel" with the path parameter "7".
struct HttpRoute {
  std::string method;
  std::string pattern;
  HttpFunction answer;
};

class HttpRouter {
 public:
  // `allowed_hosts` are names under which clients may reach the server, beside "localhost" and
  // addresses written as numbers (which no DNS answer can forge).
  HttpRouter(std::vector<HttpRoute> routes, std::vector<std::string> allowed_hosts);

  // Never fails: refusals and unknown paths are responses.
  // Thread safety: const, as long as the functions of the table are.
  HttpResponse Route(HttpRequest request) const;

  // The refusal where Host, Origin or the header for changing requests forbid an answer.
  // Returns: true and leaves `refusal` alone where the request may be answered.
  bool Admits(const HttpRequest& request, HttpResponse* refusal) const;

 private:
  bool HostIsOurs(const std::string& host) const;

  std::vector<HttpRoute> routes_;
  std::vector<std::string> allowed_hosts_;
};

// The header that every changing request must carry, with any value.
inline constexpr char kRequestHeader[] = "X-Sheaf-Request";

}  // namespace sheaf::coordinator
