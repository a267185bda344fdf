// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// The HTTP port: reads requests from sockets, passes them to the router, writes its responses, and
// sends server-sent events to many readers. One thread handles all sockets, so a reader costs
// memory but no thread. The router's functions run on a second thread, so that encoding an image
// does not block a stream, and those of the probes and of metrics on a third one. Only
// http_server.cc and the headers http_beast.h, http_connection.h, http_stream.h, http_tls.h and
// submitting/http_large_body.h use Boost.Beast and Boost.Asio.
#pragma once

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>

#include "absl/status/statusor.h"
#include "common/tls/credential_store.h"
#include "coordinator/service/http/server/event_stream.h"
#include "coordinator/service/http/server/http_router.h"

namespace sheaf::coordinator {

// Limits of the port. Requests and clients beyond a limit are refused, never queued.
inline constexpr size_t kHttpConnectionCountMax = 512;
// Maximum number of connections from one address that have not sent a complete request. One more
// closes the oldest of them. A new connection when all places are taken also closes the oldest of
// them, or else the connection that has been idle between requests for longest. A connection with a
// request in progress is never closed for this reason.
inline constexpr size_t kHttpHalfOpenCountMax = 64;
// Connections of one address. One more closes the address's connection that has been idle for
// longest; if there is none, its first request is answered with 429 and it ends.
inline constexpr size_t kHttpConnectionsOfAddressMax = 128;
inline constexpr uint32_t kHttpHeaderBytesMax = 16 * 1024;
inline constexpr uint64_t kHttpBodyBytesMax = 64 * 1024;
// Larger ones, up to kHttpLargeBodyBytesMax, that are in memory at once.
inline constexpr int kHttpLargeBodiesMax = 32;
// From the end of one request to the first byte of the next one.
inline constexpr std::chrono::seconds kHttpIdleTimeout{60};
// From the start of a connection, or from the first byte of a later request, to the end of the
// request's head; and from there to the end of its body.
inline constexpr std::chrono::seconds kHttpHeadTimeout{5};
inline constexpr std::chrono::seconds kHttpBodyTimeout{10};
// The same for a larger body: 2 MiB at 140 kbit/s.
inline constexpr std::chrono::seconds kHttpLargeBodyTimeout{120};
// From the start of a connection to the end of its TLS handshake; the request's head has its own
// time after that. Meanwhile the connection is half open.
inline constexpr std::chrono::seconds kHttpHandshakeTimeout{5};
// How long the end of a TLS connection may take.
inline constexpr std::chrono::seconds kHttpGoodbyeTimeout{1};
// How often the certificate's file is checked.
inline constexpr std::chrono::seconds kHttpCertificateInterval{10};
// Maximum time in which a client must accept some of the bytes sent to it.
inline constexpr std::chrono::seconds kHttpWriteTimeout{30};
// Interval of comment lines that keep an event stream open and detect closed connections.
inline constexpr std::chrono::seconds kEventHeartbeat{15};
// Minimum time between two batches of events to a reader; changes in between are combined.
inline constexpr std::chrono::milliseconds kEventInterval{100};

struct HttpServerOptions {
  // A numeric address.
  std::string address = "127.0.0.1";
  // 0: any free port.
  uint16_t port = 0;
  // Whether an address that other machines can reach is permitted.
  bool allow_remote = false;
  // The key and certificate of HTTPS, read again when they change; none: plain HTTP.
  std::optional<CredentialFiles> tls;
  // Called for each connection that is refused for kHttpConnectionsOfAddressMax. May be empty.
  std::function<void(const std::string& address, const absl::Status& why)> note_refused;
  // Path of the event stream.
  std::string event_path = "/api/v1/events";
};

class HttpServer {
 public:
  // Listens and serves until destroyed. `router` and `hub` must outlive the server. Errors:
  // kInvalidArgument (malformed address), kFailedPrecondition (not a loopback address, and
  // !allow_remote), kUnavailable (the server cannot listen on the address, for example because the
  // port is in use; its certificate cannot be read).
  static absl::StatusOr<std::unique_ptr<HttpServer>> Start(const HttpServerOptions& options,
                                                           const HttpRouter& router, EventHub* hub);
  // Closes every connection and waits for its threads.
  ~HttpServer();

  // The port on which the server listens.
  uint16_t port() const;
  // "http://127.0.0.1:8080", or "https://...".
  std::string Url() const;

 private:
  class Impl;
  explicit HttpServer(std::unique_ptr<Impl> impl);
  std::unique_ptr<Impl> impl_;
};

}  // namespace sheaf::coordinator
