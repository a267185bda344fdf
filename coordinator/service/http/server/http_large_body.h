// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// The permission to send a body of more than kHttpBodyBytesMax, which is decided by the head of a
// request. Internal to http_server.cc.
#pragma once

#include <utility>  // Before asio of Boost 1.74, which uses std::exchange unasked.

#include <boost/beast/http.hpp>
#include <optional>
#include <string>

#include "coordinator/service/http/server/http_beast.h"
#include "coordinator/service/http/server/http_message.h"
#include "coordinator/service/http/server/http_router.h"
#include "coordinator/service/http/server/http_server.h"

namespace sheaf::coordinator {

// One of the large bodies that are in memory; it counts until it is destroyed. Socket thread only.
class LargeBody {
 public:
  explicit LargeBody(int* count) : count_(count) { ++*count_; }
  ~LargeBody() { --*count_; }
  LargeBody(const LargeBody&) = delete;
  LargeBody& operator=(const LargeBody&) = delete;

 private:
  int* const count_;
};

// Limits the body whose head was read. *large: set if it is a large one that may come. Returns the
// response if it may not. peer: the client's address; count: of large bodies.
inline std::optional<HttpResponse> LimitBody(const HttpRouter& router, const std::string& peer,
                                             http::request_parser<http::string_body>* parser,
                                             int* count, std::optional<LargeBody>* large) {
  const auto length = parser->content_length();
  if (!length || *length <= kHttpBodyBytesMax) {
    parser->body_limit(kHttpBodyBytesMax);  // Where no length is stated, too.
    return std::nullopt;
  }
  HttpRequest head = ToRequest(parser->get());
  head.peer = peer;
  HttpResponse refusal;
  if (!router.AdmitsLargeBody(std::move(head), *length, &refusal)) return refusal;
  if (*count >= kHttpLargeBodiesMax) {
    return HttpError(503, "UNAVAILABLE", "too many files are being sent at once; try again");
  }
  large->emplace(count);
  return std::nullopt;
}

}  // namespace sheaf::coordinator
