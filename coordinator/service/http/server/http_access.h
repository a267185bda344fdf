// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// HttpAccess: who sends a request to a coordinator with certificates. A browser signs in with a
// token of `sheaf page` and shows a session cookie from then on:
//
//   GET  /login     the form
//   POST /login     token=TOKEN, sent by the form: sets the cookie, and goes to the page
//   POST /logout    ends the session
//
// Prometheus shows a scrape token instead, as Authorization: Bearer TOKEN.
// The requirements of each route stand in the role table (role_table.h), beside the gRPC methods.
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

  // Notes the caller in the request, if its session may do the operation ("GET /api/v1/jobs").
  // Otherwise returns false, and *refusal is the response.
  bool Admits(const std::string& operation, HttpRequest* request, HttpResponse* refusal) const;
  // Records in the audit log that the request changed a job, or why it did not.
  void NoteInAudit(const HttpRequest& request, const std::string& job_id,
                   const absl::Status& outcome) const;
  // The same of another act. what: what it concerned, for people.
  void NoteActInAudit(const HttpRequest& request, const std::string& what,
                      const absl::Status& outcome) const;
  // Whether the certificates of the server and its authority have not ended. Errors:
  // kUnavailable, naming the one and what to do.
  absl::Status CheckCertificates(absl::Time now) const;
  // Counts of refusals by limit and by reason, and the ends of certificates, as FarmView has
  // metrics.
  std::vector<MetricView> Metrics() const;
  // The routes above. They refer to this object.
  std::vector<HttpRoute> Routes() const;

 private:
  HttpResponse SignIn(const HttpRequest& request) const;
  HttpResponse SignOut(const HttpRequest& request) const;

  AccessControl* const access_;
};

}  // namespace sheaf::coordinator
