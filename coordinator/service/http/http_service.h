// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// The complete HTTP port in one object: API, page, events and server, for a FarmView.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "coordinator/service/http/api/http_api.h"
#include "coordinator/service/http/api/http_submissions.h"
#include "coordinator/service/http/api/http_watch.h"
#include "coordinator/service/http/server/http_access.h"
#include "coordinator/service/http/server/http_server.h"
#include "coordinator/service/view/farm_view.h"
#include "coordinator/service/view/submission_desk.h"

namespace sheaf::coordinator {

struct HttpServiceOptions {
  // Address and port.
  HttpServerOptions server;
  // Names under which clients reach the port, in addition to localhost and numeric addresses.
  std::vector<std::string> allowed_hosts;
  // Decides who may use the port; null: every client that reaches it. It must outlive the service.
  AccessControl* access = nullptr;
  // Gets the times of requests, and is shown in /metrics; null: none. It must outlive the service.
  ServerMetrics* metrics = nullptr;
  // Takes scenes that are dropped on the page; null: takes none. It must outlive the service.
  SubmissionDesk* submissions = nullptr;
};

class HttpService {
 public:
  // Serves until destroyed. `farm` must outlive the service. Errors: as for HttpServer::Start.
  static absl::StatusOr<std::unique_ptr<HttpService>> Start(const HttpServiceOptions& options,
                                                            const FarmView& farm,
                                                            FarmActions actions);
  // The address of the page: "http://127.0.0.1:8080".
  std::string Url() const { return server_->Url(); }
  uint16_t port() const { return server_->port(); }
  // Answers requests, without sockets.
  const HttpRouter& router() const { return router_; }

 private:
  HttpService(const HttpServiceOptions& options, const FarmView& farm, FarmActions actions);

  // Each member uses those above it; they are destroyed from the server up.
  EventHub hub_;
  std::optional<HttpAccess> access_;
  HttpApi api_;
  HttpSubmissions submissions_;
  HttpRouter router_;
  FarmWatcher watcher_;
  std::unique_ptr<HttpServer> server_;
};

}  // namespace sheaf::coordinator
