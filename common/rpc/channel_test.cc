// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "common/rpc/channel.h"

#include <netinet/in.h>
#include <sys/socket.h>
#include <unistd.h>

#include <memory>
#include <string>
#include <thread>
#include <vector>

#include "absl/strings/str_cat.h"
#include "absl/time/clock.h"
#include "common/base/check.h"
#include "gtest/gtest.h"

namespace sheaf {
namespace {

// Looks take longer where other programs slow this one down, and so do tries of the channel.
constexpr absl::Duration kLookInterval = absl::Milliseconds(10);
constexpr int kLooksMax = 400;

// A peer that begins HTTP/2 and then is silent. It is not a gRPC server, whose threads would read
// the sockets of this process's channels as well.
class Peer {
 public:
  Peer() : socket_(::socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0)) {
    sockaddr_in address{};
    address.sin_family = AF_INET;
    address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    socklen_t size = sizeof address;
    auto* const generic = reinterpret_cast<sockaddr*>(&address);
    SHEAF_CHECK(::bind(socket_, generic, size) == 0);
    SHEAF_CHECK(::getsockname(socket_, generic, &size) == 0);
    port_ = ntohs(address.sin_port);
  }
  ~Peer() {
    ::shutdown(socket_, SHUT_RDWR);  // Ends accept.
    if (thread_.joinable()) thread_.join();
    ::close(socket_);
  }
  Peer(const Peer&) = delete;
  Peer& operator=(const Peer&) = delete;

  int port() const { return port_; }
  // Connections are refused before.
  void Listen() {
    SHEAF_CHECK(::listen(socket_, 16) == 0);
    thread_ = std::thread([this] { Greet(); });
  }

 private:
  void Greet() {
    std::vector<int> connections;
    for (int peer = 0; (peer = ::accept(socket_, nullptr, nullptr)) >= 0;) {
      connections.push_back(peer);
      constexpr char kEmptySettings[] = {0, 0, 0, 4, 0, 0, 0, 0, 0};  // RFC 9113, 6.5.
      SHEAF_CHECK(::write(peer, kEmptySettings, sizeof kEmptySettings) == sizeof kEmptySettings);
    }
    for (const int peer : connections) ::close(peer);
  }

  const int socket_;
  int port_ = 0;
  std::thread thread_;
};

// Without a call that waits, as between the tries of a worker.
TEST(ChannelTest, ConnectsSoonToAServerThatStarts) {
  Peer peer;
  const std::shared_ptr<grpc::Channel> channel =
      MakeChannel(absl::StrCat("127.0.0.1:", peer.port()));
  channel->GetState(/*try_to_connect=*/true);
  absl::SleepFor(absl::Milliseconds(300));
  EXPECT_NE(channel->GetState(/*try_to_connect=*/true), GRPC_CHANNEL_READY);
  peer.Listen();
  int looks = 0;
  while (channel->GetState(/*try_to_connect=*/true) != GRPC_CHANNEL_READY && looks < kLooksMax) {
    ++looks;
    absl::SleepFor(kLookInterval);
  }
  EXPECT_LT(looks, kLooksMax);
}

}  // namespace
}  // namespace sheaf
