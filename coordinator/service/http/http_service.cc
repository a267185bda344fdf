// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Combines the parts of the HTTP port.
#include "coordinator/service/http/http_service.h"

#include "absl/strings/str_cat.h"
#include "absl/time/clock.h"
#include "coordinator/service/http/server/http_page.h"

namespace sheaf::coordinator {
namespace {

std::optional<HttpAccess> AccessOf(AccessControl* access) {
  return access == nullptr ? std::nullopt : std::make_optional<HttpAccess>(access);
}

const HttpAccess* PointerTo(const std::optional<HttpAccess>& access) {
  return access ? &*access : nullptr;
}

std::vector<HttpRoute> AllRoutes(HttpApi* api, const HttpSubmissions& submissions,
                                 const HttpAccess* access) {
  std::vector<HttpRoute> routes = api->Routes();
  for (HttpRoute& route : submissions.Routes()) routes.push_back(std::move(route));
  if (access != nullptr) {
    for (HttpRoute& route : access->Routes()) routes.push_back(std::move(route));
  }
  for (HttpRoute& route : PageRoutes()) routes.push_back(std::move(route));
  return routes;
}

}  // namespace

HttpService::HttpService(const HttpServiceOptions& options, const FarmView& farm,
                         FarmActions actions)
    : access_(AccessOf(options.access)),
      api_(farm, std::move(actions), absl::StrCat(absl::ToUnixMicros(absl::Now())),
           PointerTo(access_), options.metrics),
      submissions_(options.submissions),
      router_(AllRoutes(&api_, submissions_, PointerTo(access_)), options.allowed_hosts,
              PointerTo(access_),
              options.metrics == nullptr ? nullptr : &options.metrics->http_requests),
      watcher_(farm, &hub_) {}

absl::StatusOr<std::unique_ptr<HttpService>> HttpService::Start(const HttpServiceOptions& options,
                                                                const FarmView& farm,
                                                                FarmActions actions) {
  std::unique_ptr<HttpService> service(new HttpService(options, farm, std::move(actions)));
  HttpServerOptions server_options = options.server;
  if (AccessControl* const access = options.access; access != nullptr) {
    server_options.note_refused = [access](const std::string& address, const absl::Status& why) {
      access->use().NoteRefused(IdentityLimit::kConnections);
      access->NoteRefused(address, "connect", why, absl::Now());
    };
  }
  absl::StatusOr<std::unique_ptr<HttpServer>> server =
      HttpServer::Start(server_options, service->router_, &service->hub_);
  if (!server.ok()) return server.status();
  service->server_ = *std::move(server);
  return service;
}

}  // namespace sheaf::coordinator
