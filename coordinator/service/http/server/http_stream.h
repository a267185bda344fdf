// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// HttpStream: a client's socket, plain or with TLS. It is an asynchronous stream of Boost.Beast, so
// the code that reads requests and writes responses is the same for both. Internal to
// http_server.cc.
#pragma once

#include <utility>  // Before asio of Boost 1.74, which uses std::exchange unasked.

#include <boost/asio/ip/tcp.hpp>
#include <boost/asio/ssl/context.hpp>
#include <boost/asio/ssl/stream.hpp>
#include <boost/beast/core/tcp_stream.hpp>
#include <chrono>
#include <memory>

namespace sheaf::coordinator {

class HttpStream {
 public:
  using executor_type = boost::beast::tcp_stream::executor_type;
  using Tls = boost::asio::ssl::stream<boost::beast::tcp_stream&>;

  // tls: null for a plain socket; otherwise the handshake comes before anything else.
  HttpStream(boost::asio::ip::tcp::socket socket, boost::asio::ssl::context* tls)
      : tcp_(std::move(socket)) {
    if (tls != nullptr) tls_ = std::make_unique<Tls>(tcp_, *tls);
  }

  executor_type get_executor() noexcept { return tcp_.get_executor(); }
  boost::asio::ip::tcp::socket& socket() { return tcp_.socket(); }
  Tls* tls() { return tls_.get(); }
  // The time within which all operations that begin from now on must end.
  void expires_after(std::chrono::nanoseconds duration) { tcp_.expires_after(duration); }
  // The next read has no time limit.
  void expires_never() { tcp_.expires_never(); }
  // Operations in progress end with an error.
  void cancel() { tcp_.cancel(); }
  // The same, and closes the connection.
  void close() { tcp_.close(); }

  template <typename Buffers, typename Token>
  auto async_read_some(const Buffers& buffers, Token&& token) {
    if (tls_ != nullptr) return tls_->async_read_some(buffers, std::forward<Token>(token));
    return tcp_.async_read_some(buffers, std::forward<Token>(token));
  }
  template <typename Buffers, typename Token>
  auto async_write_some(const Buffers& buffers, Token&& token) {
    if (tls_ != nullptr) return tls_->async_write_some(buffers, std::forward<Token>(token));
    return tcp_.async_write_some(buffers, std::forward<Token>(token));
  }

 private:
  boost::beast::tcp_stream tcp_;
  std::unique_ptr<Tls> tls_;
};

}  // namespace sheaf::coordinator
