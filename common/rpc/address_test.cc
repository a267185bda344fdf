// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "common/rpc/address.h"

#include <string>

#include "gtest/gtest.h"

namespace sheaf {
namespace {

TEST(AddressTest, ReadsHostAndPort) {
  const auto address = ParseAddress("farm.example:7400");
  ASSERT_TRUE(address.ok());
  EXPECT_EQ(address->host, "farm.example");
  EXPECT_EQ(address->port, 7400);
  EXPECT_EQ(FormatAddress(*address), "farm.example:7400");
}

TEST(AddressTest, ReadsBracketedIpv6) {
  const auto address = ParseAddress("[::1]:80");
  ASSERT_TRUE(address.ok());
  EXPECT_EQ(address->host, "::1");
  EXPECT_EQ(FormatAddress(*address), "[::1]:80");
}

TEST(AddressTest, RejectsInvalidAddresses) {
  for (const std::string text : {"", "host", "host:", ":80", "host:70000", "host:-1", "host:8 0",
                                 "::1:80", "host:+80", "host:99999999999999999999", "[[::1]]:80"}) {
    EXPECT_EQ(ParseAddress(text).status().code(), absl::StatusCode::kInvalidArgument) << text;
  }
}

TEST(AddressTest, AddressesOfPagesAreNamedAsSuch) {
  for (const std::string text :
       {"http://farm:7480", "https://farm.example", "http://[::1]:7480/"}) {
    const std::string why(ParseAddress(text, kCoordinatorPort).status().message());
    EXPECT_NE(why.find(text.substr(0, text.find("://") + 3) + " and give the port of gRPC, 7400"),
              std::string::npos)
        << why;
  }
}

TEST(AddressTest, AddsTheDefaultCoordinatorPort) {
  const auto complete = [](std::string text) {
    const std::string wrong = CompleteCoordinatorAddress(text);
    return wrong.empty() ? text : "wrong: " + wrong;
  };
  EXPECT_EQ(complete("localhost"), "localhost:7400");
  EXPECT_EQ(complete("10.0.0.1"), "10.0.0.1:7400");
  EXPECT_EQ(complete("[::1]"), "[::1]:7400");
  EXPECT_EQ(complete("[fe80::1]:80"), "[fe80::1]:80");
  EXPECT_EQ(complete("farm.example:7401"), "farm.example:7401");
  for (const std::string text :
       {"", "[]", "::1", "fe80::1:7400", "host:", ":7400", "host:0", "host:http", "[::1", "::1]"}) {
    EXPECT_TRUE(complete(text).starts_with("wrong: ")) << text << ": " << complete(text);
  }
}

TEST(AddressTest, RecognizesLoopback) {
  EXPECT_TRUE(IsLoopback({"127.0.0.1", 1}));
  EXPECT_TRUE(IsLoopback({"127.8.9.1", 1}));
  EXPECT_TRUE(IsLoopback({"localhost", 1}));
  EXPECT_TRUE(IsLoopback({"::1", 1}));
  EXPECT_FALSE(IsLoopback({"0.0.0.0", 1}));
  EXPECT_FALSE(IsLoopback({"::", 1}));
  EXPECT_FALSE(IsLoopback({"127.farm.example", 1}));
  EXPECT_FALSE(IsLoopback({"10.0.0.1", 1}));
}

}  // namespace
}  // namespace sheaf
