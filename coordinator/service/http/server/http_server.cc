// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Each connection is a coroutine on the socket thread that repeats three steps: read a request
// within the limits, let the router answer it on the other thread, and write the response. An event
// stream is a coroutine that sleeps on a timer, which the hub cancels to wake it.
#include "coordinator/service/http/server/http_server.h"

#include <utility>  // Before asio/awaitable.hpp of Boost 1.74, which lacks this include.

#include <algorithm>
#include <atomic>
#include <boost/asio/awaitable.hpp>
#include <boost/asio/co_spawn.hpp>
#include <boost/asio/detached.hpp>
#include <boost/asio/io_context.hpp>
#include <boost/asio/ip/tcp.hpp>
#include <boost/asio/post.hpp>
#include <boost/asio/redirect_error.hpp>
#include <boost/asio/steady_timer.hpp>
#include <boost/asio/thread_pool.hpp>
#include <boost/asio/use_awaitable.hpp>
#include <boost/asio/write.hpp>
#include <boost/beast/core/flat_buffer.hpp>
#include <boost/beast/http.hpp>
#include <optional>
#include <set>
#include <thread>

#include "absl/strings/str_cat.h"
#include "common/base/log.h"
#include "coordinator/service/http/server/http_beast.h"
#include "coordinator/service/http/server/http_connection.h"
#include "coordinator/service/http/server/http_large_body.h"
#include "coordinator/service/http/server/http_tls.h"
#include "coordinator/service/http/server/peer_watch.h"

namespace sheaf::coordinator {
namespace {

// Pause after accept fails, for example for lack of file descriptors.
constexpr std::chrono::milliseconds kAcceptRetryDelay{100};

absl::Status TooManyConnectionsError(const std::string& peer) {
  return absl::ResourceExhaustedError(
      absl::StrCat(peer, " has ", kHttpConnectionsOfAddressMax,
                   " connections, the limit of an address; close some pages or scripts there"));
}

}  // namespace

class HttpServer::Impl {
 public:
  Impl(const HttpServerOptions& options, const HttpRouter& router, EventHub* hub)
      : options_(options),
        router_(router),
        hub_(hub),
        answering_(1),
        probing_(1),
        io_(1),
        acceptor_(io_) {
    if (options.tls) tls_.emplace(*options.tls);
  }
  ~Impl();

  absl::Status Listen();
  void Run();
  uint16_t port() const { return port_; }
  std::string Url() const;

 private:
  asio::awaitable<void> Accept();
  asio::awaitable<void> Serve(tcp::socket socket);
  // Does the TLS handshake, if there is one. Returns whether the connection can continue.
  asio::awaitable<bool> ShakeHands(Connection* connection);
  // Ends TLS properly, so that the client knows that the response is complete.
  asio::awaitable<void> End(HttpStream* stream);
  // Counts the connection as half open, and closes the oldest one if its address has too many.
  void AwaitRequest(Connection* connection);
  // Whether a new connection is within the limit of its address; closes an idle one if necessary.
  bool MakeRoomFor(const Connection& connection);
  // Reads the first request of a connection, or a later one, within its deadlines. Returns the read
  // error, if any; *refusal is then the response, if there is one. *large: as LimitBody.
  asio::awaitable<error_code> ReadRequest(Connection* connection, beast::flat_buffer* buffer,
                                          http::request_parser<http::string_body>* parser,
                                          bool first, std::optional<HttpResponse>* refusal,
                                          std::optional<LargeBody>* large);
  // Returns whether the connection can take another request.
  asio::awaitable<bool> Answer(Connection* connection, http::request<http::string_body> message);
  asio::awaitable<HttpResponse> RouteElsewhere(HttpRequest request);
  asio::awaitable<bool> Send(HttpStream* stream, HttpResponse response, bool keep_alive,
                             bool head_only);
  asio::awaitable<bool> SendFile(HttpStream* stream, HttpResponse response, bool keep_alive);
  asio::awaitable<void> StreamEvents(HttpStream* stream, HttpRequest request);
  // The events for the sender of the request. Errors: as EventHub::Subscribe.
  absl::StatusOr<std::shared_ptr<EventQueue>> Subscribe(const HttpRequest& request);
  // Waits until the queue has events, the heartbeat is due, or the peer is gone.
  asio::awaitable<std::string> NextEvents(EventQueue* queue, PeerWatch* watch);
  asio::awaitable<bool> SendText(HttpStream* stream, std::string text);
  void WakeReaders();

  const HttpServerOptions options_;
  const HttpRouter& router_;
  EventHub* const hub_;
  uint16_t port_ = 0;
  std::optional<HttpTls> tls_;  // Socket thread only, once it serves; as are the next.
  ConnectionCounts counts_;
  int large_bodies_ = 0;
  ConnectionList half_open_;  // Without a complete request so far.
  ConnectionList idle_;       // Between two requests.
  std::set<asio::steady_timer*> sleeping_;
  std::atomic<bool> wake_posted_ = false;
  // Destroyed in reverse order, as the coroutines that io_ owns use all members above it.
  asio::thread_pool answering_;
  asio::thread_pool probing_;  // For probes.
  asio::io_context io_;
  tcp::acceptor acceptor_;
  std::thread thread_;
};

HttpServer::Impl::~Impl() {
  hub_->SetWake({});
  io_.stop();
  if (thread_.joinable()) thread_.join();
  answering_.join();
  probing_.join();
}

absl::Status HttpServer::Impl::Listen() {
  error_code error;
  const asio::ip::address address = asio::ip::make_address(options_.address, error);
  if (error) {
    return absl::InvalidArgumentError(
        absl::StrCat("HTTP address \"", options_.address, "\" is not a numeric IP address"));
  }
  if (!address.is_loopback() && !options_.allow_remote) {
    return absl::FailedPreconditionError(
        absl::StrCat("HTTP address ", options_.address,
                     " can be reached from other machines and the port has no authentication: "
                     "run sheaf-coordinator init, which gives it HTTPS, or use 127.0.0.1"));
  }
  const tcp::endpoint endpoint(address, options_.port);
  acceptor_.open(endpoint.protocol(), error);
  if (!error) acceptor_.set_option(tcp::acceptor::reuse_address(true), error);
  if (!error) acceptor_.bind(endpoint, error);
  if (!error) acceptor_.listen(asio::socket_base::max_listen_connections, error);
  if (error) {
    return absl::UnavailableError(
        absl::StrCat("cannot listen for HTTP on ", options_.address, ":", options_.port, ": ",
                     error.message(), "; choose another port, or stop the program that uses it"));
  }
  port_ = acceptor_.local_endpoint(error).port();
  return tls_ ? tls_->Load() : absl::OkStatus();
}

void HttpServer::Impl::Run() {
  hub_->SetWake([this] {
    if (!wake_posted_.exchange(true)) asio::post(io_, [this] { WakeReaders(); });
  });
  asio::co_spawn(io_, Accept(), asio::detached);
  thread_ = std::thread([this] { io_.run(); });
}

std::string HttpServer::Impl::Url() const {
  const bool is_v6 = options_.address.find(':') != std::string::npos;
  return absl::StrCat(tls_ ? "https://" : "http://", is_v6 ? "[" : "", options_.address,
                      is_v6 ? "]" : "", ":", port_);
}

void HttpServer::Impl::WakeReaders() {
  wake_posted_ = false;
  for (asio::steady_timer* timer : sleeping_) timer->cancel();
}

asio::awaitable<void> HttpServer::Impl::Accept() {
  asio::steady_timer pause(io_);
  for (;;) {
    error_code error;
    tcp::socket socket(io_);
    co_await acceptor_.async_accept(socket, asio::redirect_error(asio::use_awaitable, error));
    if (error) {
      pause.expires_after(kAcceptRetryDelay);
      co_await pause.async_wait(asio::redirect_error(asio::use_awaitable, error));
      continue;
    }
    // At the limit the socket is closed here, as queued clients would only wait longer.
    if (counts_.all >= kHttpConnectionCountMax && !DropOldest(half_open_) && !DropOldest(idle_)) {
      continue;
    }
    asio::co_spawn(io_, Serve(std::move(socket)), [](std::exception_ptr failure) {
      // Exceptions of Beast, except for lack of memory, concern one connection, which is closed by
      // now.
      if (failure) LogWarning("an HTTP connection was closed because of an unexpected error");
    });
  }
}

bool HttpServer::Impl::MakeRoomFor(const Connection& connection) {
  const auto is_of_peer = [&](const Connection* other) { return other->peer == connection.peer; };
  if (counts_.of_peer.at(connection.peer) <= kHttpConnectionsOfAddressMax) return true;
  const auto oldest = std::find_if(idle_.begin(), idle_.end(), is_of_peer);
  if (oldest != idle_.end()) return DropOldest({*oldest});
  if (options_.note_refused) {
    options_.note_refused(connection.peer, TooManyConnectionsError(connection.peer));
  }
  return false;
}

void HttpServer::Impl::AwaitRequest(Connection* connection) {
  connection->MoveTo(&half_open_);
  ConnectionList of_peer;
  for (Connection* other : half_open_) {
    if (other->peer == connection->peer) of_peer.push_back(other);
  }
  if (of_peer.size() > kHttpHalfOpenCountMax) DropOldest(of_peer);
}

asio::awaitable<error_code> HttpServer::Impl::ReadRequest(
    Connection* connection, beast::flat_buffer* buffer,
    http::request_parser<http::string_body>* parser, bool first,
    std::optional<HttpResponse>* refusal, std::optional<LargeBody>* large) {
  error_code error;
  const auto end = [&error] { return asio::redirect_error(asio::use_awaitable, error); };
  HttpStream& stream = connection->stream;
  if (!first && buffer->size() == 0) {
    connection->MoveTo(&idle_);
    stream.expires_after(kHttpIdleTimeout);
    const size_t size =
        co_await stream.async_read_some(buffer->prepare(kHttpHeaderBytesMax), end());
    buffer->commit(size);
  }
  if (!error) {
    AwaitRequest(connection);
    stream.expires_after(kHttpHeadTimeout);
    co_await http::async_read_header(stream, *buffer, *parser, end());
  }
  if (!error && !parser->is_done()) {
    *refusal = LimitBody(router_, connection->address, parser, &large_bodies_, large);
    if (*refusal) error = http::error::body_limit;
  }
  if (!error && !parser->is_done()) {
    stream.expires_after(*large ? kHttpLargeBodyTimeout : kHttpBodyTimeout);
    co_await http::async_read(stream, *buffer, *parser, end());
  }
  connection->MoveTo(nullptr);
  if (error && !*refusal) *refusal = ReadRefusal(error);
  co_return error;
}

asio::awaitable<bool> HttpServer::Impl::ShakeHands(Connection* connection) {
  HttpStream& stream = connection->stream;
  if (stream.tls() == nullptr) co_return true;
  error_code error;
  AwaitRequest(connection);
  stream.expires_after(kHttpHandshakeTimeout);
  co_await stream.tls()->async_handshake(asio::ssl::stream_base::server,
                                         asio::redirect_error(asio::use_awaitable, error));
  co_return !error;
}

asio::awaitable<void> HttpServer::Impl::End(HttpStream* stream) {
  error_code ignored;
  if (stream->tls() != nullptr) {
    stream->expires_after(kHttpGoodbyeTimeout);
    co_await stream->tls()->async_shutdown(asio::redirect_error(asio::use_awaitable, ignored));
  }
  stream->socket().shutdown(tcp::socket::shutdown_send, ignored);
}

asio::awaitable<void> HttpServer::Impl::Serve(tcp::socket socket) {
  Connection connection(std::move(socket), tls_ ? tls_->context() : nullptr, &counts_);
  if (!co_await ShakeHands(&connection)) co_return;
  beast::flat_buffer buffer(kHttpHeaderBytesMax + kHttpBodyBytesMax);
  bool keep_alive = true;
  for (bool first = true; keep_alive; first = false) {
    http::request_parser<http::string_body> parser;
    parser.header_limit(kHttpHeaderBytesMax);
    parser.body_limit(kHttpLargeBodyBytesMax);
    std::optional<HttpResponse> refusal;
    std::optional<LargeBody> large;
    const error_code error =
        co_await ReadRequest(&connection, &buffer, &parser, first, &refusal, &large);
    if (error) {
      if (refusal) co_await Send(&connection.stream, *std::move(refusal), false, false);
      break;
    }
    if (first && !MakeRoomFor(connection)) {
      const absl::Status why = TooManyConnectionsError(connection.peer);
      refusal = HttpError(429, "RESOURCE_EXHAUSTED", std::string(why.message()));
      co_await Send(&connection.stream, *std::move(refusal), false, false);
      break;
    }
    keep_alive = co_await Answer(&connection, parser.release());
  }
  co_await End(&connection.stream);
}

asio::awaitable<bool> HttpServer::Impl::Answer(Connection* connection,
                                               http::request<http::string_body> message) {
  HttpStream* const stream = &connection->stream;
  const bool keep_alive = message.keep_alive();
  const bool head_only = message.method() == http::verb::head;
  HttpRequest request = ToRequest(message);
  request.peer = connection->address;
  if (request.method == "GET" && !head_only && request.target == options_.event_path) {
    HttpResponse refusal;
    if (router_.AdmitsGet(options_.event_path, &request, &refusal)) {
      co_await StreamEvents(stream, std::move(request));
      co_return false;
    }
    co_return co_await Send(stream, std::move(refusal), keep_alive, false);
  }
  const bool is_probe = router_.IsProbe(request);
  HttpResponse response = co_await asio::co_spawn(
      is_probe ? probing_ : answering_, RouteElsewhere(std::move(request)), asio::use_awaitable);
  co_return co_await Send(stream, std::move(response), keep_alive, head_only);
}

asio::awaitable<HttpResponse> HttpServer::Impl::RouteElsewhere(HttpRequest request) {
  co_return router_.Route(std::move(request));
}

asio::awaitable<bool> HttpServer::Impl::Send(HttpStream* stream, HttpResponse response,
                                             bool keep_alive, bool head_only) {
  if (!response.file_path.empty() && !head_only) {
    co_return co_await SendFile(stream, std::move(response), keep_alive);
  }
  stream->expires_after(kHttpWriteTimeout);
  error_code error;
  http::response<http::string_body> message;
  SetHead(response, keep_alive, &message);
  // 204 and 304 have no body and no length; for HEAD the length is that of the omitted body.
  const bool bodiless = response.status == 204 || response.status == 304;
  if (!bodiless && response.file_path.empty()) message.content_length(response.body.size());
  if (!bodiless && !head_only) message.body() = std::move(response.body);
  http::response_serializer<http::string_body> serializer(message);
  if (head_only) {
    co_await http::async_write_header(*stream, serializer,
                                      asio::redirect_error(asio::use_awaitable, error));
  } else {
    co_await http::async_write(*stream, serializer,
                               asio::redirect_error(asio::use_awaitable, error));
  }
  co_return keep_alive && !error;
}

asio::awaitable<bool> HttpServer::Impl::SendFile(HttpStream* stream, HttpResponse response,
                                                 bool keep_alive) {
  error_code error;
  http::response<http::file_body> message;
  message.body().open(response.file_path.c_str(), beast::file_mode::scan, error);
  if (error) {
    LogWarning(absl::StrCat(response.file_path, ": cannot be read: ", error.message()));
    HttpResponse missing = HttpError(404, "NOT_FOUND", "the file no longer exists");
    co_return co_await Send(stream, std::move(missing), keep_alive, false);
  }
  SetHead(response, keep_alive, &message);
  message.prepare_payload();
  http::response_serializer<http::file_body> serializer(message);
  while (!serializer.is_done() && !error) {
    stream->expires_after(kHttpWriteTimeout);
    co_await http::async_write_some(*stream, serializer,
                                    asio::redirect_error(asio::use_awaitable, error));
  }
  co_return keep_alive && !error;
}

asio::awaitable<bool> HttpServer::Impl::SendText(HttpStream* stream, std::string text) {
  error_code error;
  stream->expires_after(kHttpWriteTimeout);
  co_await asio::async_write(*stream, asio::buffer(text),
                             asio::redirect_error(asio::use_awaitable, error));
  co_return !error;
}

absl::StatusOr<std::shared_ptr<EventQueue>> HttpServer::Impl::Subscribe(
    const HttpRequest& request) {
  const bool is_known = request.caller.identity.has_value();
  absl::StatusOr<std::shared_ptr<EventQueue>> queue =
      hub_->Subscribe(is_known ? request.caller.Name() : PeerNetwork(request.peer));
  if (absl::IsResourceExhausted(queue.status()) && options_.note_refused) {
    options_.note_refused(
        is_known ? absl::StrCat(request.caller.Name(), " at ", request.peer) : request.peer,
        queue.status());
  }
  return queue;
}

asio::awaitable<void> HttpServer::Impl::StreamEvents(HttpStream* stream, HttpRequest request) {
  const absl::StatusOr<std::shared_ptr<EventQueue>> queue = Subscribe(request);
  if (!queue.ok()) {
    const bool is_share = absl::IsResourceExhausted(queue.status());
    HttpResponse full = HttpError(is_share ? 429 : 503, "RESOURCE_EXHAUSTED",
                                  std::string(queue.status().message()));
    co_await Send(stream, std::move(full), false, false);
    co_return;
  }
  std::string head =
      "HTTP/1.1 200 OK\r\nContent-Type: text/event-stream\r\nCache-Control: no-store\r\n"
      "X-Accel-Buffering: no\r\nConnection: close\r\n";
  for (const auto& [name, value] : kSecurityHeaders)
    absl::StrAppend(&head, name, ": ", value, "\r\n");
  absl::StrAppend(&head, "\r\nretry: 2000\n\n");
  PeerWatch watch(&io_, stream);
  watch.Begin();
  bool open = co_await SendText(stream, std::move(head));
  while (open) {
    std::string text = co_await NextEvents(queue->get(), &watch);
    HttpResponse refusal;  // A stream does not outlive the permission to read it.
    if (watch.is_gone() || !router_.AdmitsGet(options_.event_path, &request, &refusal)) break;
    open = co_await SendText(stream, std::move(text));
    co_await watch.SleepUntil(std::chrono::steady_clock::now() + kEventInterval);
  }
  co_await watch.End();
}

asio::awaitable<std::string> HttpServer::Impl::NextEvents(EventQueue* queue, PeerWatch* watch) {
  const auto deadline = std::chrono::steady_clock::now() + kEventHeartbeat;
  while (!watch->is_gone()) {
    std::string text = queue->Take();
    if (!text.empty()) co_return text;
    if (std::chrono::steady_clock::now() >= deadline) co_return ": alive\n\n";
    sleeping_.insert(watch->timer());
    co_await watch->SleepUntil(deadline);
    sleeping_.erase(watch->timer());
  }
  co_return "";
}

absl::StatusOr<std::unique_ptr<HttpServer>> HttpServer::Start(const HttpServerOptions& options,
                                                              const HttpRouter& router,
                                                              EventHub* hub) {
  auto impl = std::make_unique<Impl>(options, router, hub);
  const absl::Status status = impl->Listen();
  if (!status.ok()) return status;
  impl->Run();
  return std::unique_ptr<HttpServer>(new HttpServer(std::move(impl)));
}

HttpServer::HttpServer(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}
HttpServer::~HttpServer() = default;
uint16_t HttpServer::port() const { return impl_->port(); }
std::string HttpServer::Url() const { return impl_->Url(); }

}  // namespace sheaf::coordinator
