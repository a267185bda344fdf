// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// HttpRouter: finds the function that answers a request, after checks against requests forged by
// other web sites. A page of another site can make a browser send requests to a loopback port,
// directly or by DNS rebinding. So the Host header must be one of ours, and requests that change
// something need a header that a page of another site cannot set without a preflight request.
#pragma once

#include <cstdint>
#include <functional>
#include <string>
#include <utility>
#include <vector>

#include "coordinator/service/http/server/http_access.h"
#include "coordinator/service/http/server/http_message.h"
#include "coordinator/service/view/call_times.h"

namespace sheaf::coordinator {

// Maximum bytes of a body on routes with large bodies, from admitted callers.
inline constexpr uint64_t kHttpLargeBodyBytesMax = 2 * 1024 * 1024;

// Answers one request. Runs on the server's handler thread, so it must not block; that of a probe
// runs on another one (http_server.h).
using HttpFunction = std::function<HttpResponse(const HttpRequest&)>;

// One route. A segment of `pattern` is literal text, or "{}" followed by literal text:
// "/api/v1/jobs/{}:cancel" matches "/api/v1/jobs/7:cancel" with the path parameter "7".
struct HttpRoute {
  std::string method;
  std::string pattern;
  HttpFunction answer;
  // Whether a plain form sends it, which cannot set kRequestHeader.
  bool from_form = false;
  // Maximum bytes of a body from admitted callers; 0: kHttpBodyBytesMax from every caller.
  uint64_t body_bytes_max = 0;
  // Answered on a thread of its own: it never waits behind an encoder. No parameters.
  bool is_probe = false;
};

class HttpRouter {
 public:
  // allowed_hosts: names under which clients may reach the server, in addition to "localhost" and
  // numeric addresses (which no DNS answer can forge). access: decides who may use which route;
  // null: every client may use all. times: receives the time of each request; may be null. Both
  // must outlive the router.
  HttpRouter(std::vector<HttpRoute> routes, std::vector<std::string> allowed_hosts,
             const HttpAccess* access = nullptr, CallTimes* times = nullptr);

  // Always returns a response, also for refused requests and unknown paths. Thread safety: const,
  // as long as the functions of the routes are.
  HttpResponse Route(HttpRequest request) const;

  // The checks of Route for a GET request that is answered elsewhere. If they fail, *refusal is the
  // response; otherwise it is not changed. path: the request's, without its query.
  bool AdmitsGet(const std::string& path, HttpRequest* request, HttpResponse* refusal) const;
  // Whether a request may have a body of body_bytes bytes, more than kHttpBodyBytesMax: the checks
  // of Route, for the head alone. If not, *refusal is the response.
  bool AdmitsLargeBody(HttpRequest head, uint64_t body_bytes, HttpResponse* refusal) const;
  // Whether a probe answers the request.
  bool IsProbe(const HttpRequest& request) const;
  const std::vector<HttpRoute>& routes() const { return routes_; }

 private:
  bool HostIsOurs(const std::string& host) const;
  // Each returns whether the request passes the check, and sets *refusal if it does not.
  bool HostIsAllowed(const HttpRequest& request, HttpResponse* refusal) const;
  bool ChangeIsAllowed(const HttpRequest& request, bool from_form, HttpResponse* refusal) const;
  bool CallerIsAllowed(const std::string& operation, HttpRequest* request,
                       HttpResponse* refusal) const;
  HttpResponse Answer(const HttpRoute& route, HttpRequest request) const;
  // *route: the one that answers; unchanged if there is none.
  HttpResponse FindAndAnswer(HttpRequest request, const HttpRoute** route) const;

  std::vector<HttpRoute> routes_;
  std::vector<std::string> allowed_hosts_;
  const HttpAccess* const access_;
  CallTimes* const times_;
};

// The header, with any value, that every changing request must have.
inline constexpr char kRequestHeader[] = "X-Sheaf-Request";

}  // namespace sheaf::coordinator
