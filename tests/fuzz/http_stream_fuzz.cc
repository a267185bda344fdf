// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Feeds arbitrary bytes to the HTTP port, as a client that sends them and then falls silent. The
// server answers or closes, and serves the next client.
#include <arpa/inet.h>
#include <netinet/in.h>
#include <sys/socket.h>
#include <unistd.h>

#include <memory>
#include <string>

#include "coordinator/service/http/server/http_server.h"
#include "tests/fuzz/fuzz_target.h"

namespace sheaf::coordinator {
namespace {

struct Server {
  Server() : router({{"GET", "/{}", &Echo}, {"POST", "/{}", &Echo}}, {}) {
    absl::StatusOr<std::unique_ptr<HttpServer>> started = HttpServer::Start({}, router, &hub);
    SHEAF_CHECK(started.ok());
    server = *std::move(started);
  }
  static HttpResponse Echo(const HttpRequest& request) {
    SHEAF_CHECK(request.body.size() <= kHttpBodyBytesMax);
    HttpResponse response;
    response.body = request.body;
    return response;
  }

  HttpRouter router;
  EventHub hub;
  std::unique_ptr<HttpServer> server;
};

// Returns the bytes that the server sends before it closes.
std::string Exchange(uint16_t port, std::string_view bytes) {
  const int client = ::socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0);
  SHEAF_CHECK(client >= 0);
  // Leaves no closed connection behind, of which there may be few.
  const linger reset{.l_onoff = 1, .l_linger = 0};
  ::setsockopt(client, SOL_SOCKET, SO_LINGER, &reset, sizeof reset);
  sockaddr_in address{};
  address.sin_family = AF_INET;
  address.sin_port = htons(port);
  address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  SHEAF_CHECK(::connect(client, reinterpret_cast<sockaddr*>(&address), sizeof address) == 0);
  while (!bytes.empty()) {
    const ssize_t sent = ::send(client, bytes.data(), bytes.size(), MSG_NOSIGNAL);
    if (sent <= 0) break;  // Refused early.
    bytes.remove_prefix(static_cast<size_t>(sent));
  }
  ::shutdown(client, SHUT_WR);
  std::string answer;
  char buffer[4096];
  for (ssize_t got = 0; (got = ::recv(client, buffer, sizeof buffer, 0)) > 0;) {
    answer.append(buffer, static_cast<size_t>(got));
  }
  ::close(client);
  return answer;
}

}  // namespace

SHEAF_FUZZ_TARGET(http_stream) {
  static const Server* const server = new Server;
  if (bytes.find("/api/v1/events") != std::string_view::npos) return;  // Never ends.
  const std::string answer = Exchange(server->server->port(), bytes);
  if (!answer.empty()) SHEAF_CHECK(answer.starts_with("HTTP/1."));
}

}  // namespace sheaf::coordinator
