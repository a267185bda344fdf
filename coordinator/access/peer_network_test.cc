// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "coordinator/access/peer_network.h"

#include <gtest/gtest.h>

namespace sheaf::coordinator {
namespace {

TEST(PeerNetworkTest, CountsAddressesOfIpv4AndNetworksOfIpv6) {
  for (const char* text : {"192.0.2.7", "ipv4:192.0.2.7", "::ffff:192.0.2.7",
                           "ipv6:[::ffff:c000:207]", "ipv6:%5B::ffff:192.0.2.7%5D"}) {
    EXPECT_EQ(PeerNetwork(text), "192.0.2.7") << text;
  }
  for (const char* text : {"2001:db8:1:2::1", "2001:DB8:1:2:ffff:ffff:ffff:ffff",
                           "ipv6:[2001:db8:1:2::3]", "ipv6:%5B2001:db8:1:2:4::%5D"}) {
    EXPECT_EQ(PeerNetwork(text), "2001:db8:1:2::/64") << text;
  }
  EXPECT_EQ(PeerNetwork("2001:db8:1:3::1"), "2001:db8:1:3::/64");
  EXPECT_EQ(PeerNetwork("fe80::1%eth0"), "fe80::/64");
  for (const char* text : {"", "unix:/run/sheaf", "other1", "local (user)"}) {
    EXPECT_EQ(PeerNetwork(text), text);
  }
}

}  // namespace
}  // namespace sheaf::coordinator
