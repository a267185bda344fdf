// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// PeerWatch: notices that the client of an event stream closes its connection. A pending read
// detects this at once; a write would detect it only when there is something to send. Internal to
// http_server.cc.
#pragma once

#include <utility>  // Before asio of Boost 1.74, which uses std::exchange unasked.

#include <array>
#include <boost/asio/awaitable.hpp>
#include <boost/asio/buffer.hpp>
#include <boost/asio/co_spawn.hpp>
#include <boost/asio/detached.hpp>
#include <boost/asio/io_context.hpp>
#include <boost/asio/redirect_error.hpp>
#include <boost/asio/steady_timer.hpp>
#include <boost/asio/use_awaitable.hpp>

#include "coordinator/service/http/server/http_stream.h"

namespace sheaf::coordinator {

// Socket thread only. Requires: End is awaited before the watch and its stream are destroyed,
// unless the io_context ends first.
class PeerWatch {
 public:
  PeerWatch(boost::asio::io_context* io, HttpStream* stream)
      : io_(*io), stream_(*stream), sleep_(*io), ended_(*io) {
    ended_.expires_at(boost::asio::steady_timer::time_point::max());
  }
  PeerWatch(const PeerWatch&) = delete;
  PeerWatch& operator=(const PeerWatch&) = delete;

  void Begin() {
    stream_.expires_never();  // For the read; writes have a time of their own.
    boost::asio::co_spawn(io_, Read(), boost::asio::detached);
  }
  bool is_gone() const { return is_gone_; }
  // The time at which SleepUntil returns at the latest; cancelling it wakes the stream.
  boost::asio::steady_timer* timer() { return &sleep_; }
  // Returns when the timer is cancelled or the peer is gone, too.
  boost::asio::awaitable<void> SleepUntil(boost::asio::steady_timer::time_point time) {
    if (is_gone_) co_return;
    boost::system::error_code ignored;
    sleep_.expires_at(time);
    co_await sleep_.async_wait(boost::asio::redirect_error(boost::asio::use_awaitable, ignored));
  }
  boost::asio::awaitable<void> End() {
    boost::system::error_code ignored;
    if (!has_ended_) stream_.cancel();
    while (!has_ended_) {
      co_await ended_.async_wait(boost::asio::redirect_error(boost::asio::use_awaitable, ignored));
    }
  }

 private:
  boost::asio::awaitable<void> Read() {
    std::array<char, 256> bytes{};  // A client sends nothing more that matters.
    boost::system::error_code error;
    while (!error) {
      co_await stream_.async_read_some(
          boost::asio::buffer(bytes),
          boost::asio::redirect_error(boost::asio::use_awaitable, error));
    }
    is_gone_ = has_ended_ = true;
    stream_.cancel();  // A write would wait for its time to pass.
    sleep_.cancel();
    ended_.cancel();
  }

  boost::asio::io_context& io_;
  HttpStream& stream_;
  boost::asio::steady_timer sleep_;
  boost::asio::steady_timer ended_;  // Cancelled when Read returns.
  bool is_gone_ = false;
  bool has_ended_ = false;
};

}  // namespace sheaf::coordinator
