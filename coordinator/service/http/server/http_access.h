// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// HttpAccess: identifies the sender of a request to a coordinator with certificates. A browser
// signs in with a token of `sheaf page` and then sends a session cookie:
//
//   GET  /login     the form
//   POST /login     token=TOKEN, sent by the form: sets the cookie, and redirects to the page
//   POST /logout    ends the session
//
// Prometheus sends a scrape token instead, as Authorization: Bearer TOKEN. The role table
// (role_table.h) has the requirements of each route, beside the gRPC methods.
#pragma once

#include <string>
#include <vector>

#include "coordinator/access/access_control.h"
#include "coordinator/service/http/server/http_message.h"
#include "coordinator/service/view/farm_view.h"

namespace sheaf::coordinator {

struct HttpRoute;

// The prefix makes browsers refuse the cookie unless it is Secure, of this host, and for all paths.
inline constexpr char kSessionCookie[] = "__Host-sheaf-session";

// Thread safety: all members may be called concurrently.
class HttpAccess {
 public:
  // `access` must outlive the object.
  explicit HttpAccess(AccessControl* access) : access_(access) {}

  // Sets the caller in the request, if its session may do the operation ("GET /api/v1/jobs").
  // Otherwise returns false, and *refusal is the response.
  bool Admits(const std::string& operation, HttpRequest* request, HttpResponse* refusal) const;
  // Records in the audit log that the request changed a job, or why it did not.
  void NoteInAudit(const HttpRequest& request, const std::string& job_id,
                   const absl::Status& outcome) const;
  // The same for another act. what: its subject, for administrators.
  void NoteActInAudit(const HttpRequest& request, const std::string& what,
                      const absl::Status& outcome) const;
  // Checks that the certificates of the server and its authority have not expired. Errors:
  // kUnavailable, naming the certificate and what to do.
  absl::Status CheckCertificates(absl::Time now) const;
  // Counts of refusals by limit and by reason, and the expiry of certificates, in the form of
  // FarmView's metrics.
  std::vector<MetricView> Metrics() const;
  // The routes above. They refer to this object.
  std::vector<HttpRoute> Routes() const;

 private:
  HttpResponse SignIn(const HttpRequest& request) const;
  HttpResponse SignOut(const HttpRequest& request) const;

  AccessControl* const access_;
};

}  // namespace sheaf::coordinator
