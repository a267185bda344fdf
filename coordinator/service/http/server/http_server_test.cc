// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Uses real loopback sockets through plain POSIX calls, so that the test shares no code with the
// server.
#include "coordinator/service/http/server/http_server.h"

#include <arpa/inet.h>
#include <netinet/in.h>
#include <sys/socket.h>
#include <sys/time.h>
#include <unistd.h>

#include <atomic>
#include <cerrno>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <future>
#include <vector>

#include "absl/strings/str_cat.h"
#include "absl/time/clock.h"
#include "gmock/gmock.h"
#include "gtest/gtest.h"

namespace sheaf::coordinator {
namespace {

using ::testing::HasSubstr;
using ::testing::StartsWith;

// A connection to the server, from 127.0.0.`host`. Reads give up before the server would
// close an idle connection.
class Client {
 public:
  explicit Client(uint16_t port, uint32_t host = 1) : socket_(socket(AF_INET, SOCK_STREAM, 0)) {
    const timeval timeout = {kHttpIdleTimeout.count() - 10, 0};
    setsockopt(socket_, SOL_SOCKET, SO_RCVTIMEO, &timeout, sizeof timeout);
    sockaddr_in address = {};
    address.sin_family = AF_INET;
    address.sin_addr.s_addr = htonl((INADDR_LOOPBACK & 0xffffff00) + host);
    bind(socket_, reinterpret_cast<sockaddr*>(&address), sizeof address);
    address.sin_port = htons(port);
    address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    connected_ = connect(socket_, reinterpret_cast<sockaddr*>(&address), sizeof address) == 0;
  }
  ~Client() { close(socket_); }
  Client(const Client&) = delete;
  Client& operator=(const Client&) = delete;

  bool Send(const std::string& text) {
    return connected_ && send(socket_, text.data(), text.size(), MSG_NOSIGNAL) ==
                             static_cast<ssize_t>(text.size());
  }
  // Reads until the text so far contains `end`, or the connection closes. Ends with "(gave up)" if
  // neither happens.
  std::string ReadUntil(const std::string& end) {
    std::string text;
    char bytes[4096];
    while (text.find(end) == std::string::npos) {
      const ssize_t count = recv(socket_, bytes, sizeof bytes, 0);
      if (count < 0 && (errno == EAGAIN || errno == EWOULDBLOCK)) return text + "(gave up)";
      if (count <= 0) break;
      text.append(bytes, static_cast<size_t>(count));
    }
    return text;
  }
  std::string ReadToClose() { return ReadUntil(std::string(1, '\0') + "never sent"); }

 private:
  int socket_;
  bool connected_ = false;
};

class HttpServerTest : public ::testing::Test {
 protected:
  HttpServerTest() : router_(MakeRoutes(), {}) {
    HttpServerOptions options;
    options.note_refused = [this](const std::string&, const absl::Status&) { ++refusals_; };
    auto server = HttpServer::Start(options, router_, &hub_);
    EXPECT_TRUE(server.ok()) << server.status();
    if (server.ok()) server_ = *std::move(server);
  }

  static std::vector<HttpRoute> MakeRoutes() {
    const auto hello = [](const HttpRequest&) {
      HttpResponse response;
      response.body = "hello";
      return response;
    };
    const auto file = [](const HttpRequest&) {
      HttpResponse response;
      response.file_path = FilePath();
      return response;
    };
    return {{"GET", "/hello", hello}, {"GET", "/file", file}, {"POST", "/hello", hello}};
  }
  static std::string FilePath() {
    return absl::StrCat(::testing::TempDir(), "/http_server_test.bin");
  }

  static std::string Get(const std::string& path) {
    return absl::StrCat("GET ", path, " HTTP/1.1\r\nHost: localhost\r\n\r\n");
  }

  EventHub hub_;
  HttpRouter router_;
  std::atomic<int> refusals_ = 0;
  std::unique_ptr<HttpServer> server_;
};

TEST_F(HttpServerTest, ServesSeveralRequestsPerConnection) {
  Client client(server_->port());
  for (int i = 0; i < 3; ++i) {
    ASSERT_TRUE(client.Send(Get("/hello")));
    const std::string response = client.ReadUntil("hello");
    EXPECT_THAT(response, StartsWith("HTTP/1.1 200 OK\r\n"));
    EXPECT_THAT(response, HasSubstr("Content-Security-Policy: default-src 'none'"));
    EXPECT_THAT(response, HasSubstr("X-Content-Type-Options: nosniff"));
  }
}

// An encoder may take seconds.
TEST_F(HttpServerTest, ProbesDoNotWaitBehindOtherRoutes) {
  std::promise<void> end;
  const auto slow = [done = end.get_future().share()](const HttpRequest&) {
    done.wait();
    return HttpResponse();
  };
  const auto quick = [](const HttpRequest&) {
    HttpResponse response;
    response.body = "here";
    return response;
  };
  HttpRoute probe_route{"GET", "/lives", quick};
  probe_route.is_probe = true;
  const HttpRouter router({{"GET", "/slow", slow}, probe_route}, {});
  auto server = HttpServer::Start({}, router, &hub_);
  ASSERT_TRUE(server.ok());
  Client waiting((*server)->port());
  ASSERT_TRUE(waiting.Send(Get("/slow")));
  for (const char* path : {"/lives", "/lives?x=1"}) {
    Client probe((*server)->port());
    ASSERT_TRUE(probe.Send(Get(path)));
    EXPECT_THAT(probe.ReadUntil("here"), HasSubstr("200 OK")) << path;
  }
  end.set_value();
}

TEST_F(HttpServerTest, HeadSendsOnlyTheLength) {
  Client client(server_->port());
  client.Send("HEAD /hello HTTP/1.1\r\nHost: localhost\r\nConnection: close\r\n\r\n");
  const std::string response = client.ReadToClose();
  EXPECT_THAT(response, HasSubstr("Content-Length: 5\r\n"));
  EXPECT_THAT(response, ::testing::EndsWith("\r\n\r\n"));
}

TEST_F(HttpServerTest, StreamsAFile) {
  std::string bytes(300000, 'x');
  bytes.back() = '!';
  std::ofstream(FilePath(), std::ios::binary) << bytes;
  Client client(server_->port());
  client.Send(Get("/file"));
  const std::string response = client.ReadUntil("!");
  EXPECT_THAT(response, HasSubstr("Content-Length: 300000\r\n"));
  EXPECT_EQ(response.substr(response.find("\r\n\r\n") + 4), bytes);
  std::remove(FilePath().c_str());
  client.Send(Get("/file"));
  EXPECT_THAT(client.ReadUntil("}}"), HasSubstr("404 Not Found"));
}

TEST_F(HttpServerTest, RequestsBeyondALimitAreRefused) {
  Client long_head(server_->port());
  long_head.Send(absl::StrCat("GET /hello HTTP/1.1\r\nHost: localhost\r\nX: ",
                              std::string(kHttpHeaderBytesMax, 'x'), "\r\n\r\n"));
  EXPECT_THAT(long_head.ReadUntil("}}"), StartsWith("HTTP/1.1 431 "));
  Client long_body(server_->port());
  long_body.Send(absl::StrCat("POST /hello HTTP/1.1\r\nHost: localhost\r\nContent-Length: ",
                              kHttpBodyBytesMax + 1, "\r\n\r\n"));
  EXPECT_THAT(long_body.ReadUntil("}}"), StartsWith("HTTP/1.1 413 "));
  Client garbage(server_->port());
  garbage.Send("\x16\x03\x01 garbage\r\n\r\n");
  EXPECT_THAT(garbage.ReadUntil("}}"), StartsWith("HTTP/1.1 400 "));
}

TEST_F(HttpServerTest, EventReadersDoNotBlockRequests) {
  std::vector<std::unique_ptr<Client>> readers;
  for (uint32_t i = 0; i < 60; ++i) {
    readers.push_back(std::make_unique<Client>(server_->port(), 1 + i % 2));
    ASSERT_TRUE(readers.back()->Send(Get("/api/v1/events")));
    EXPECT_THAT(readers.back()->ReadUntil("retry: 2000\n\n"), HasSubstr("text/event-stream"));
  }
  EXPECT_EQ(hub_.ReaderCount(), 60u);
  hub_.Publish({"job", "jobs/1", "{\"n\":1}"});
  for (const auto& reader : readers) {
    EXPECT_EQ(reader->ReadUntil("\n\n"), "event: job\ndata: {\"n\":1}\n\n");
  }
  Client other(server_->port());
  other.Send(Get("/hello"));
  EXPECT_THAT(other.ReadUntil("hello"), StartsWith("HTTP/1.1 200 OK"));
}

TEST_F(HttpServerTest, HalfOpenRequestsDoNotBlockOthers) {
  Client reader(server_->port()), idle(server_->port());
  reader.Send(Get("/api/v1/events"));
  reader.ReadUntil("retry: 2000\n\n");
  idle.Send(Get("/hello"));
  idle.ReadUntil("hello");
  std::vector<std::unique_ptr<Client>> half_open;
  for (int i = 0; i < 600; ++i) {
    half_open.push_back(std::make_unique<Client>(server_->port()));
    half_open.back()->Send(i % 2 == 0 ? "GET /hel" : "");
  }
  const absl::Time start = absl::Now();
  Client other(server_->port());
  other.Send(Get("/hello"));
  EXPECT_THAT(other.ReadUntil("hello"), StartsWith("HTTP/1.1 200 OK"));
  EXPECT_LT(absl::Now() - start, absl::FromChrono(kHttpHeadTimeout)) << "they still wait";
  // Earlier connections have kept their places.
  idle.Send(Get("/hello"));
  EXPECT_THAT(idle.ReadUntil("hello"), StartsWith("HTTP/1.1 200 OK"));
  hub_.Publish({"job", "jobs/1", "{}"});
  EXPECT_EQ(reader.ReadUntil("\n\n"), "event: job\ndata: {}\n\n");
  // Half-open connections end, the newest by its deadline.
  EXPECT_EQ(half_open.front()->ReadToClose(), "");
  EXPECT_EQ(half_open.back()->ReadToClose(), "");
}

TEST_F(HttpServerTest, IdleConnectionsAreClosedForNewOnes) {
  std::vector<std::unique_ptr<Client>> idle;
  for (size_t i = 0; i < kHttpConnectionCountMax + 20; ++i) {
    const auto host = static_cast<uint32_t>(1 + i % 8);
    idle.push_back(std::make_unique<Client>(server_->port(), host));
    ASSERT_TRUE(idle.back()->Send(Get("/hello")));
    EXPECT_THAT(idle.back()->ReadUntil("hello"), StartsWith("HTTP/1.1 200 OK")) << i;
  }
  EXPECT_EQ(idle.front()->ReadToClose(), "");
}

TEST_F(HttpServerTest, AnAddressClosesItsOwnIdleConnectionsForNewOnes) {
  Client other(server_->port(), 2);
  other.Send(Get("/hello"));
  other.ReadUntil("hello");
  std::vector<std::unique_ptr<Client>> idle;
  for (size_t i = 0; i < kHttpConnectionsOfAddressMax + 1; ++i) {
    idle.push_back(std::make_unique<Client>(server_->port()));
    ASSERT_TRUE(idle.back()->Send(Get("/hello")));
    EXPECT_THAT(idle.back()->ReadUntil("hello"), StartsWith("HTTP/1.1 200 OK")) << i;
  }
  EXPECT_EQ(idle.front()->ReadToClose(), "");
  other.Send(Get("/hello"));
  EXPECT_THAT(other.ReadUntil("hello"), StartsWith("HTTP/1.1 200 OK"));
}

TEST_F(HttpServerTest, AnAddressWithTooManyBusyConnectionsIsRefused) {
  std::ofstream(FilePath(), std::ios::binary) << "more than sockets buffer";
  std::filesystem::resize_file(FilePath(), uint64_t{1} << 30);
  std::vector<std::unique_ptr<Client>> busy;
  for (size_t i = 0; i < kHttpConnectionsOfAddressMax; ++i) {
    busy.push_back(std::make_unique<Client>(server_->port()));
    const bool is_reader = i < kEventReadersOfOneMax;
    ASSERT_TRUE(busy.back()->Send(Get(is_reader ? "/api/v1/events" : "/file")));
    EXPECT_THAT(busy.back()->ReadUntil("\r\n\r\n"), StartsWith("HTTP/1.1 200 OK"));
  }
  Client one_more(server_->port()), other(server_->port(), 2);
  one_more.Send(Get("/hello"));
  const std::string refusal = one_more.ReadToClose();
  EXPECT_THAT(refusal, StartsWith("HTTP/1.1 429 "));
  EXPECT_THAT(refusal, HasSubstr("127.0.0.1 has 128 connections"));
  EXPECT_EQ(refusals_, 1);
  other.Send(Get("/hello"));
  EXPECT_THAT(other.ReadUntil("hello"), StartsWith("HTTP/1.1 200 OK"));
  busy.erase(busy.begin());  // A reader, whose end is noticed without an event.
  const absl::Time deadline = absl::Now() + absl::Seconds(100);
  std::string answer;
  while (absl::Now() < deadline && answer.find("200 OK") == std::string::npos) {
    Client again(server_->port());
    again.Send(Get("/hello"));
    answer = again.ReadUntil("hello");
    if (answer.find("429") != std::string::npos) answer.clear();
  }
  EXPECT_THAT(answer, StartsWith("HTTP/1.1 200 OK"));
  std::remove(FilePath().c_str());
}

// Nothing is published: only the end of the connection tells that the reader has gone.
TEST_F(HttpServerTest, AClosedEventStreamIsNoticedAtOnce) {
  std::vector<std::unique_ptr<Client>> readers;
  for (size_t i = 0; i < kEventReadersOfOneMax; ++i) {
    readers.push_back(std::make_unique<Client>(server_->port()));
    ASSERT_TRUE(readers.back()->Send(Get("/api/v1/events")));
    readers.back()->ReadUntil("retry: 2000\n\n");
  }
  Client one_more(server_->port());
  one_more.Send(Get("/api/v1/events"));
  const std::string refusal = one_more.ReadToClose();
  EXPECT_THAT(refusal, StartsWith("HTTP/1.1 429 "));
  EXPECT_THAT(refusal, HasSubstr("127.0.0.1 has 32 event streams open"));
  EXPECT_EQ(refusals_, 1);
  const absl::Time begin = absl::Now();
  readers.clear();
  while (hub_.ReaderCount() > 0 && absl::Now() - begin < absl::Seconds(100)) {
    absl::SleepFor(absl::Milliseconds(1));
  }
  EXPECT_EQ(hub_.ReaderCount(), 0u);
  EXPECT_LT(absl::Now() - begin, absl::FromChrono(kEventHeartbeat)) << "a heartbeat told it";
  Client again(server_->port());
  again.Send(Get("/api/v1/events"));
  EXPECT_THAT(again.ReadUntil("retry: 2000\n\n"), HasSubstr("text/event-stream"));
}

TEST_F(HttpServerTest, MissingBodiesTimeOut) {
  Client client(server_->port());
  client.Send("POST /hello HTTP/1.1\r\nHost: localhost\r\nContent-Length: 9\r\n\r\nhalf");
  Client other(server_->port());
  other.Send(Get("/hello"));
  EXPECT_THAT(other.ReadUntil("hello"), StartsWith("HTTP/1.1 200 OK"));
  EXPECT_EQ(client.ReadToClose(), "");
}

TEST_F(HttpServerTest, EventsNeedAllowedHosts) {
  Client client(server_->port());
  client.Send("GET /api/v1/events HTTP/1.1\r\nHost: evil.example\r\n\r\n");
  EXPECT_THAT(client.ReadUntil("}}"), StartsWith("HTTP/1.1 403 "));
}

TEST_F(HttpServerTest, PortInUseIsAClearError) {
  HttpServerOptions options;
  options.port = server_->port();
  const auto second = HttpServer::Start(options, router_, &hub_);
  EXPECT_EQ(second.status().code(), absl::StatusCode::kUnavailable);
  EXPECT_THAT(std::string(second.status().message()), HasSubstr("Address already in use"));
}

TEST_F(HttpServerTest, RemoteAddressesNeedPermission) {
  HttpServerOptions options;
  options.address = "0.0.0.0";
  EXPECT_EQ(HttpServer::Start(options, router_, &hub_).status().code(),
            absl::StatusCode::kFailedPrecondition);
  options.address = "everywhere";
  EXPECT_EQ(HttpServer::Start(options, router_, &hub_).status().code(),
            absl::StatusCode::kInvalidArgument);
}

TEST_F(HttpServerTest, StopsWithOpenStreams) {
  Client reader(server_->port());
  reader.Send(Get("/api/v1/events"));
  reader.ReadUntil("retry: 2000\n\n");
  server_.reset();
  EXPECT_EQ(reader.ReadToClose(), "");
  EXPECT_EQ(hub_.ReaderCount(), 0u);
}

}  // namespace
}  // namespace sheaf::coordinator
