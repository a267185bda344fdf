// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// The HTTP port: sockets in, HttpRequest to the router, HttpResponse out, and server-sent events
// for as many readers as like to watch. One thread does all sockets, so a reader costs memory, not
// a thread; the router's functions run on one other thread, so that encoding an image stops no
// stream. The only door to Boost.Beast and Boost.Asio (in http_server.cc and http_connection.h).
#pragma once

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <string>

#include "absl/status/statusor.h"
#include "coordinator/service/http/event_stream.h"
#include "coordinator/service/http/http_router.h"

namespace sheaf::coordinator {

// Limits of the port. A request or client beyond one is refused, never queued.
inline constexpr size_t kHttpConnectionCountMax = 512;
// Connections of one address that have not sent a whole request. One more costs the oldest of them
// its place; so does a new connection that finds all places taken, if need be that of one that is
// idle between requests. A connection with a request in progress keeps its place.
inline constexpr size_t kHttpHalfOpenCountMax = 64;
inline constexpr uint32_t kHttpHeaderBytesMax = 16 * 1024;
inline constexpr uint64_t kHttpBodyBytesMax = 64 * 1024;
// From the end of one request to the first byte of the next.
inline constexpr std::chrono::seconds kHttpIdleTimeout{60};
// From a connection's begin, or a later request's first byte, to the end of the request's head; and
// from there to its last byte.
inline constexpr std::chrono::seconds kHttpHeadTimeout{5};
inline constexpr std::chrono::seconds kHttpBodyTimeout{10};
// In which a client must take some bytes of what is sent to it.
inline constexpr std::chrono::seconds kHttpWriteTimeout{30};
// A comment line keeps an event stream open and finds readers that went away.
inline constexpr std::chrono::seconds kEventHeartbeat{15};
// Between two batches of events to one reader; what changes faster is coalesced.
inline constexpr std::chrono::milliseconds kEventInterval{100};

struct HttpServerOptions {
  // An address in numbers.
  std::string address = "127.0.0.1";
  // 0 takes any free port.
  uint16_t port = 0;
  // Listening on an address that other machines can reach must be asked for: the port has no
  // authentication.
  bool allow_remote = false;
  // Where the event stream is found.
  std::string event_path = "/api/v1/events";
};

class HttpServer {
 public:
  // Listens and serves until destroyed. `router` and `hub` must outlive the server.
  // Errors: kInvalidArgument (malformed address), kFailedPrecondition (not loopback and not
  // allowed), kUnavailable (the address cannot be listened on, for example because the port is
  // taken).
  static absl::StatusOr<std::unique_ptr<HttpServer>> Start(const HttpServerOptions& options,
                                                           const HttpRouter& router, EventHub* hub);
  // Closes every connection and waits for both threads.
  ~HttpServer();

  // The port that is listened on.
  uint16_t port() const;
  // "http://127.0.0.1:8080".
  std::string Url() const;

 private:
  class Impl;
  explicit HttpServer(std::unique_ptr<Impl> impl);
  std::unique_ptr<Impl> impl_;
};

}  // namespace sheaf::coordinator
