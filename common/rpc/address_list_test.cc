// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "common/rpc/address_list.h"

#include <grpcpp/generic/async_generic_service.h>
#include <grpcpp/grpcpp.h>

#include <memory>
#include <string>

#include "absl/strings/str_cat.h"
#include "common/rpc/address.h"
#include "common/rpc/channel.h"
#include "gtest/gtest.h"

namespace sheaf {
namespace {

TEST(AddressListTest, OneAddressStaysAsItIs) {
  EXPECT_EQ(ChannelTarget("farm.example.org:7400"), "farm.example.org:7400");
  EXPECT_FALSE(HasSeveralAddresses("farm.example.org:7400"));
}

TEST(AddressListTest, SeveralAreOneListOfNumericAddresses) {
  EXPECT_EQ(ChannelTarget("127.0.0.1:7400,10.0.0.2:7401"), "ipv4:127.0.0.1:7400,10.0.0.2:7401");
  EXPECT_EQ(ChannelTarget("[::1]:7400,[fe80::2]:7401"), "ipv6:[::1]:7400,[fe80::2]:7401");
  EXPECT_EQ(ChannelTarget("[::1]:7400,10.0.0.2:7401"), "ipv6:[::1]:7400,[::ffff:10.0.0.2]:7401");
  EXPECT_EQ(ChannelTarget("localhost:7400,127.0.0.2:7401"), "ipv4:127.0.0.1:7400,127.0.0.2:7401");
}

TEST(AddressListTest, NamesWithoutAddressAreLeftOut) {
  EXPECT_EQ(ChannelTarget("nowhere.invalid:7400,127.0.0.1:7401"), "ipv4:127.0.0.1:7401");
  EXPECT_EQ(ChannelTarget("nowhere.invalid:7400,either.invalid:7401"), "nowhere.invalid:7400");
}

TEST(AddressListTest, EachAddressGetsTheDefaultPort) {
  std::string addresses = "a.example.org,b.example.org:7500";
  EXPECT_EQ(CompleteCoordinatorAddress(addresses), "");
  EXPECT_EQ(addresses, "a.example.org:7400,b.example.org:7500");
  std::string wrong = "a.example.org,,b.example.org";
  EXPECT_NE(CompleteCoordinatorAddress(wrong), "");
  std::string many = "a,b,c,d,e,f,g,h,i";
  EXPECT_NE(CompleteCoordinatorAddress(many), "");
}

TEST(AddressListTest, TheAddressThatAnsweredIsKnown) {
  const std::string both = "127.0.0.1:7400,localhost:7401";
  EXPECT_EQ(AnsweringAddress(both, "ipv4:127.0.0.1:7401"), "localhost:7401");
  EXPECT_EQ(AnsweringAddress(both, "ipv4:10.0.0.1:7401"), "127.0.0.1:7400");
  EXPECT_EQ(AnsweringAddress("[::1]:7400,[::1]:7401", "ipv6:%5B::1%5D:7401"), "[::1]:7401");
  EXPECT_EQ(AnsweringAddress("farm:7400", "ipv4:10.0.0.1:7400"), "farm:7400");
}

// A server that has a port, and answers calls with "unimplemented".
struct Server {
  explicit Server(int wanted = 0) {
    grpc::ServerBuilder builder;
    ApplyServerLimits(&builder);
    builder.AddListeningPort(absl::StrCat("127.0.0.1:", wanted), grpc::InsecureServerCredentials(),
                             &port);
    builder.RegisterCallbackGenericService(&service);
    server = builder.BuildAndStart();
  }
  grpc::CallbackGenericService service;
  int port = 0;
  std::unique_ptr<grpc::Server> server;
};

bool Connects(grpc::Channel* channel) {
  return channel->WaitForConnected(std::chrono::system_clock::now() + std::chrono::seconds(100));
}

TEST(AddressListTest, AChannelFollowsToTheServerThatIsThere) {
  auto first = std::make_unique<Server>(), second = std::make_unique<Server>();
  const int first_port = first->port;
  const auto channel =
      MakeChannel(absl::StrCat("127.0.0.1:", first_port, ",127.0.0.1:", second->port));
  second->server->Shutdown();
  ASSERT_TRUE(Connects(channel.get()));
  const int second_port = second->port;
  second = std::make_unique<Server>(second_port);
  ASSERT_EQ(second->port, second_port);
  first->server->Shutdown(std::chrono::system_clock::now());
  first.reset();
  const auto deadline = std::chrono::system_clock::now() + std::chrono::seconds(100);
  channel->WaitForStateChange(GRPC_CHANNEL_READY, deadline);
  EXPECT_TRUE(Connects(channel.get())) << "it connects to the second one";
}

}  // namespace
}  // namespace sheaf
