// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "coordinator/service/http/server/http_access.h"

#include <array>
#include <utility>

#include "absl/strings/ascii.h"
#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_split.h"
#include "absl/strings/strip.h"
#include "absl/time/clock.h"
#include "coordinator/service/http/server/http_page.h"
#include "coordinator/service/http/server/http_router.h"

namespace sheaf::coordinator {
namespace {

constexpr char kLoginPage[] = "/login";
constexpr char kTokenField[] = "token=";
constexpr char kBearer[] = "Bearer ";
// The login page shows the message that the address names.
constexpr char kRefusedPage[] = "/login#refused";

std::string CookieOf(const HttpRequest& request) {
  const std::string header = HeaderValue(request, "Cookie");
  const std::string prefix = absl::StrCat(kSessionCookie, "=");
  for (absl::string_view cookie : absl::StrSplit(header, ';')) {
    cookie = absl::StripAsciiWhitespace(cookie);
    if (absl::ConsumePrefix(&cookie, prefix)) return std::string(cookie);
  }
  return "";
}

// The token of "Authorization: Bearer TOKEN", as Prometheus sends it; "" if there is none.
std::string ScrapeTokenOf(const HttpRequest& request) {
  const std::string header = HeaderValue(request, "Authorization");
  absl::string_view text = absl::StripAsciiWhitespace(header);
  if (!absl::StartsWithIgnoreCase(text, kBearer)) return "";
  return std::string(absl::StripAsciiWhitespace(text.substr(sizeof kBearer - 1)));
}

HttpResponse SeeOther(const std::string& location) {
  HttpResponse response;
  response.status = 303;
  response.headers = {{"Location", location}, {"Cache-Control", "no-store"}};
  return response;
}

std::string SetCookie(const std::string& session, absl::Duration age) {
  return absl::StrCat(kSessionCookie, "=", session, "; Path=/; Max-Age=", absl::ToInt64Seconds(age),
                      "; Secure; HttpOnly; SameSite=Strict");
}

// The login form. Browsers may send it only to this origin, and name the page that it comes from.
HttpResponse LoginPage() {
  HttpResponse response;
  for (const PageFile& file : PageFiles()) {
    if (file.name != "login.html") continue;
    response.content_type = std::string(file.content_type);
    response.body = std::string(file.bytes);
  }
  response.headers = {{"Cache-Control", "no-cache"},
                      {"Referrer-Policy", "same-origin"},
                      {"Content-Security-Policy",
                       "default-src 'none'; style-src 'self'; img-src 'self'; base-uri 'none'; "
                       "form-action 'self'; frame-ancestors 'none'"}};
  return response;
}

int RefusalCode(const absl::Status& why) {
  if (absl::IsPermissionDenied(why)) return 403;
  return absl::IsResourceExhausted(why) ? 429 : 401;
}

// Whether the request comes from a user at a browser, not from a script.
bool IsPage(const std::string& operation) {
  return operation == "GET /" || operation == "GET /index.html";
}

}  // namespace

bool HttpAccess::Admits(const std::string& operation, HttpRequest* request,
                        HttpResponse* refusal) const {
  const absl::Time now = absl::Now();
  const std::string token = ScrapeTokenOf(*request);
  absl::StatusOr<Caller> caller =
      token.empty() ? access_->AdmitSession(CookieOf(*request), operation, request->peer, now)
                    : access_->AdmitScraper(token, operation, request->peer, now);
  if (caller.ok()) {
    request->caller = *std::move(caller);
    return true;
  }
  if (absl::IsUnauthenticated(caller.status()) && IsPage(operation)) {
    *refusal = SeeOther(kLoginPage);
  } else {
    *refusal =
        HttpError(RefusalCode(caller.status()), absl::StatusCodeToString(caller.status().code()),
                  std::string(caller.status().message()));
  }
  return false;
}

absl::Status HttpAccess::CheckCertificates(absl::Time now) const {
  for (const auto& [name, expiry] : {std::pair("authority", access_->authority().Expiry()),
                                     std::pair("server", access_->authority().ServerExpiry())}) {
    if (now < expiry) continue;
    return absl::UnavailableError(
        absl::StrCat("the certificate of the ", name, " ended at ",
                     absl::FormatTime("%Y-%m-%dT%H:%M:%SZ", expiry, absl::UTCTimeZone()),
                     ": clients cannot connect; the coordinator's log says why it is not renewed"));
  }
  return absl::OkStatus();
}

std::vector<MetricView> HttpAccess::Metrics() const {
  std::vector<MetricView> metrics;
  const std::array<uint64_t, kIdentityLimitCount> refused = access_->use().Refused();
  for (size_t limit = 0; limit < refused.size(); ++limit) {
    metrics.push_back({"sheaf_refused_total", "Calls and connections beyond a limit, by limit.",
                       MetricView::Kind::kCounter, "limit",
                       IdentityLimitName(static_cast<IdentityLimit>(limit)),
                       static_cast<double>(refused[limit])});
  }
  const std::array<uint64_t, kRefusalReasonCount> reasons = access_->RefusedByReason();
  for (size_t reason = 0; reason < reasons.size(); ++reason) {
    metrics.push_back({"sheaf_calls_refused_total", "Calls that were refused, by reason.",
                       MetricView::Kind::kCounter, "reason",
                       RefusalReasonName(static_cast<RefusalReason>(reason)),
                       static_cast<double>(reasons[reason])});
  }
  for (const auto& [name, expiry] : {std::pair("authority", access_->authority().Expiry()),
                                     std::pair("server", access_->authority().ServerExpiry())}) {
    metrics.push_back({"sheaf_certificate_expiry_time_seconds",
                       "Expiry of a certificate of the coordinator, in Unix time.",
                       MetricView::Kind::kGauge, "certificate", name,
                       absl::ToDoubleSeconds(expiry - absl::UnixEpoch())});
  }
  return metrics;
}

void HttpAccess::NoteInAudit(const HttpRequest& request, const std::string& job_id,
                             const absl::Status& outcome) const {
  NoteActInAudit(request, absl::StrCat("jobs/", job_id), outcome);
}

void HttpAccess::NoteActInAudit(const HttpRequest& request, const std::string& what,
                                const absl::Status& outcome) const {
  access_->audit().Note(absl::StrCat(request.caller.Name(), " at ", request.peer),
                        request.operation, what, outcome);
}

HttpResponse HttpAccess::SignIn(const HttpRequest& request) const {
  const absl::Time now = absl::Now();
  absl::string_view token = request.body;
  if (!absl::ConsumePrefix(&token, kTokenField)) return SeeOther(kRefusedPage);
  const absl::StatusOr<std::string> session =
      access_->SignIn(std::string(absl::StripAsciiWhitespace(token)), request.peer, now);
  if (!session.ok()) return SeeOther(kRefusedPage);
  HttpResponse response = SeeOther("/");
  response.headers.emplace_back("Set-Cookie", SetCookie(*session, kPageSessionLifetime));
  return response;
}

HttpResponse HttpAccess::SignOut(const HttpRequest& request) const {
  access_->SignOut(CookieOf(request), request.peer, absl::Now());
  HttpResponse response = SeeOther(kLoginPage);
  response.headers.emplace_back("Set-Cookie", SetCookie("", absl::ZeroDuration()));
  return response;
}

std::vector<HttpRoute> HttpAccess::Routes() const {
  HttpRoute sign_in{"POST", kLoginPage, [this](const HttpRequest& r) { return SignIn(r); }};
  sign_in.from_form = true;
  return {{"GET", kLoginPage, [](const HttpRequest&) { return LoginPage(); }},
          sign_in,
          {"POST", "/logout", [this](const HttpRequest& r) { return SignOut(r); }}};
}

}  // namespace sheaf::coordinator
