// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Splits the target, matches patterns segment by segment, and refuses requests that another site
// may have sent.
#include "coordinator/service/http/server/http_router.h"

#include <algorithm>
#include <optional>

#include "absl/strings/ascii.h"
#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_split.h"
#include "common/base/steady_time.h"

namespace sheaf::coordinator {
namespace {

int HexValue(char c) {
  if (c >= '0' && c <= '9') return c - '0';
  if (c >= 'a' && c <= 'f') return c - 'a' + 10;
  if (c >= 'A' && c <= 'F') return c - 'A' + 10;
  return -1;
}

// Percent-decodes; none if an escape is incomplete or has no hexadecimal digits.
std::optional<std::string> PercentDecode(const std::string& text) {
  std::string decoded;
  for (size_t i = 0; i < text.size(); ++i) {
    if (text[i] != '%') {
      decoded.push_back(text[i]);
      continue;
    }
    if (i + 2 >= text.size()) return std::nullopt;
    const int high = HexValue(text[i + 1]);
    const int low = HexValue(text[i + 2]);
    if (high < 0 || low < 0) return std::nullopt;
    decoded.push_back(static_cast<char>(high * 16 + low));
    i += 2;
  }
  return decoded;
}

// Splits "a=1&b=2" into pairs. Returns false if an escape is malformed.
bool ParseQuery(const std::string& text, HttpRequest* request) {
  const std::vector<std::string> pairs = absl::StrSplit(text, '&', absl::SkipEmpty());
  for (const std::string& pair : pairs) {
    const size_t equals = pair.find('=');
    const std::optional<std::string> name = PercentDecode(pair.substr(0, equals));
    const std::optional<std::string> value =
        PercentDecode(equals == std::string::npos ? "" : pair.substr(equals + 1));
    if (!name || !value) return false;
    request->query.emplace_back(*name, *value);
  }
  return true;
}

// Whether a segment matches its pattern; a "{}" in the pattern matches any text before the rest of
// the pattern's segment.
bool SegmentMatches(const std::string& pattern, const std::string& segment,
                    std::vector<std::string>* parameters) {
  if (!absl::StartsWith(pattern, "{}")) return pattern == segment;
  const std::string suffix = pattern.substr(2);
  if (segment.size() <= suffix.size() || !absl::EndsWith(segment, suffix)) return false;
  const std::string value = segment.substr(0, segment.size() - suffix.size());
  const std::optional<std::string> decoded = PercentDecode(value);
  if (!decoded) return false;
  parameters->push_back(*decoded);
  return true;
}

bool PathMatches(const std::string& pattern, const std::string& path,
                 std::vector<std::string>* parameters) {
  const std::vector<std::string> want = absl::StrSplit(pattern, '/');
  const std::vector<std::string> have = absl::StrSplit(path, '/');
  if (want.size() != have.size()) return false;
  parameters->clear();
  for (size_t i = 0; i < want.size(); ++i) {
    if (!SegmentMatches(want[i], have[i], parameters)) return false;
  }
  return true;
}

// "localhost:8080" -> "localhost", "[::1]:8080" -> "[::1]", in lower case.
std::string HostName(const std::string& host) {
  const std::string lower = absl::AsciiStrToLower(host);
  if (absl::StartsWith(lower, "[")) return lower.substr(0, lower.find(']') + 1);
  return lower.substr(0, lower.find(':'));
}

// Whether a host is an address written in numbers.
bool IsAddressLiteral(const std::string& name) {
  if (absl::StartsWith(name, "[")) return absl::EndsWith(name, "]");
  const std::vector<std::string> parts = absl::StrSplit(name, '.');
  return parts.size() == 4 && std::all_of(parts.begin(), parts.end(), [](const std::string& part) {
           return !part.empty() && part.size() <= 3 &&
                  std::all_of(part.begin(), part.end(), absl::ascii_isdigit);
         });
}

}  // namespace

HttpRouter::HttpRouter(std::vector<HttpRoute> routes, std::vector<std::string> allowed_hosts,
                       const HttpAccess* access, CallTimes* times)
    : routes_(std::move(routes)),
      allowed_hosts_(std::move(allowed_hosts)),
      access_(access),
      times_(times) {
  for (std::string& host : allowed_hosts_) host = absl::AsciiStrToLower(host);
}

bool HttpRouter::HostIsOurs(const std::string& host) const {
  const std::string name = HostName(host);
  return name == "localhost" || IsAddressLiteral(name) ||
         std::find(allowed_hosts_.begin(), allowed_hosts_.end(), name) != allowed_hosts_.end();
}

bool HttpRouter::HostIsAllowed(const HttpRequest& request, HttpResponse* refusal) const {
  const std::string host = HeaderValue(request, "Host");
  if (!HostIsOurs(host)) {
    *refusal =
        HttpError(403, "PERMISSION_DENIED",
                  absl::StrCat("host \"", host,
                               "\" is not allowed: use localhost or an address, or start the "
                               "coordinator with --allow-host NAME"));
    return false;
  }
  return true;
}

bool HttpRouter::ChangeIsAllowed(const HttpRequest& request, bool from_form,
                                 HttpResponse* refusal) const {
  if (request.method == "GET") return true;
  if (!from_form && HeaderValue(request, kRequestHeader).empty()) {
    *refusal = HttpError(
        403, "PERMISSION_DENIED",
        absl::StrCat("a request that changes something needs the header ", kRequestHeader, ": 1"));
    return false;
  }
  const std::string origin = HeaderValue(request, "Origin");
  const std::string host = HeaderValue(request, "Host");
  if (!origin.empty() && !absl::EqualsIgnoreCase(origin, "http://" + host) &&
      !absl::EqualsIgnoreCase(origin, "https://" + host)) {
    *refusal = HttpError(403, "PERMISSION_DENIED",
                         absl::StrCat("requests from the site ", origin, " are not accepted"));
    return false;
  }
  return true;
}

bool HttpRouter::CallerIsAllowed(const std::string& operation, HttpRequest* request,
                                 HttpResponse* refusal) const {
  request->operation = operation;
  return access_ == nullptr || access_->Admits(operation, request, refusal);
}

bool HttpRouter::AdmitsGet(const std::string& path, HttpRequest* request,
                           HttpResponse* refusal) const {
  return HostIsAllowed(*request, refusal) &&
         CallerIsAllowed(absl::StrCat("GET ", path), request, refusal);
}

bool HttpRouter::AdmitsLargeBody(HttpRequest head, uint64_t body_bytes,
                                 HttpResponse* refusal) const {
  const std::string path = head.target.substr(0, head.target.find('?'));
  for (const HttpRoute& route : routes_) {
    if (route.body_bytes_max < body_bytes || route.method != head.method) continue;
    if (!PathMatches(route.pattern, path, &head.path_parameters)) continue;
    return HostIsAllowed(head, refusal) && ChangeIsAllowed(head, route.from_form, refusal) &&
           CallerIsAllowed(absl::StrCat(route.method, " ", route.pattern), &head, refusal);
  }
  *refusal = HttpError(413, "RESOURCE_EXHAUSTED",
                       absl::StrCat("the request's body of ", body_bytes, " bytes is too long"));
  return false;
}

bool HttpRouter::IsProbe(const HttpRequest& request) const {
  const std::string path = request.target.substr(0, request.target.find('?'));
  return std::ranges::any_of(
      routes_, [&](const HttpRoute& route) { return route.is_probe && route.pattern == path; });
}

HttpResponse HttpRouter::Answer(const HttpRoute& route, HttpRequest request) const {
  HttpResponse refusal;
  const bool allowed =
      ChangeIsAllowed(request, route.from_form, &refusal) &&
      CallerIsAllowed(absl::StrCat(route.method, " ", route.pattern), &request, &refusal);
  return allowed ? route.answer(request) : refusal;
}

HttpResponse HttpRouter::Route(HttpRequest request) const {
  if (times_ == nullptr) {
    const HttpRoute* ignored = nullptr;
    return FindAndAnswer(std::move(request), &ignored);
  }
  const SteadyTime begin = SteadyTime::Now();
  const HttpRoute* route = nullptr;
  HttpResponse response = FindAndAnswer(std::move(request), &route);
  // Unknown paths must not become metric labels.
  const std::string name =
      route == nullptr ? "other" : absl::StrCat(route->method, " ", route->pattern);
  times_->Note(name, absl::StrCat(response.status), SteadyTime::Now() - begin);
  return response;
}

HttpResponse HttpRouter::FindAndAnswer(HttpRequest request, const HttpRoute** answering) const {
  HttpResponse refusal;
  if (!HostIsAllowed(request, &refusal)) return refusal;
  const size_t question = request.target.find('?');
  const std::string path = request.target.substr(0, question);
  if (question != std::string::npos && !ParseQuery(request.target.substr(question + 1), &request)) {
    return HttpError(400, "INVALID_ARGUMENT", "the query holds a malformed percent escape");
  }
  bool path_known = false;
  for (const HttpRoute& route : routes_) {
    if (!PathMatches(route.pattern, path, &request.path_parameters)) continue;
    if (route.method == request.method) {
      *answering = &route;
      return Answer(route, std::move(request));
    }
    path_known = true;
  }
  if (path_known) {
    return HttpError(405, "UNIMPLEMENTED",
                     absl::StrCat(request.method, " is not a method of ", path));
  }
  return HttpError(404, "NOT_FOUND", absl::StrCat("no page or resource at ", path));
}

}  // namespace sheaf::coordinator
