// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Addresses that limits count as one peer. A machine with IPv6 has 2^64 addresses of its own.
#pragma once

#include <string>
#include <string_view>

namespace sheaf::coordinator {

// "192.0.2.7" for this address, also in the form of IPv6 (::ffff:192.0.2.7); "2001:db8:1:2::/64"
// for all of its addresses. address: in the form of sockets or gRPC ("ipv6:[2001:db8::1]"), without
// a port. Other texts are returned unchanged.
std::string PeerNetwork(std::string_view address);

}  // namespace sheaf::coordinator
