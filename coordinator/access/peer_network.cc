// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "coordinator/access/peer_network.h"

#include <arpa/inet.h>
#include <netinet/in.h>

#include <algorithm>
#include <iterator>

#include "absl/strings/str_cat.h"
#include "absl/strings/strip.h"

namespace sheaf::coordinator {
namespace {

constexpr int kMappedOffset = 12;  // Offset of the IPv4 bytes in a mapped IPv6 address.
constexpr int kNetworkBytes = 8;

// Without gRPC's scheme and brackets, which it writes as %5B and %5D, and without a zone (%eth0).
std::string Literal(std::string_view address) {
  absl::string_view text(address.data(), address.size());
  if (!absl::ConsumePrefix(&text, "ipv4:")) absl::ConsumePrefix(&text, "ipv6:");
  if (!absl::ConsumePrefix(&text, "[")) absl::ConsumePrefix(&text, "%5B");
  return std::string(text.substr(0, text.find_first_of("]%")));
}

std::string Text(int family, const void* address) {
  char text[INET6_ADDRSTRLEN] = "";
  ::inet_ntop(family, address, text, sizeof text);
  return text;
}

}  // namespace

std::string PeerNetwork(std::string_view address) {
  const std::string literal = Literal(address);
  in_addr v4{};
  if (::inet_pton(AF_INET, literal.c_str(), &v4) == 1) return Text(AF_INET, &v4);
  in6_addr v6{};
  if (::inet_pton(AF_INET6, literal.c_str(), &v6) != 1) return std::string(address);
  if (IN6_IS_ADDR_V4MAPPED(&v6)) return Text(AF_INET, v6.s6_addr + kMappedOffset);
  std::fill(v6.s6_addr + kNetworkBytes, std::end(v6.s6_addr), uint8_t{0});
  return absl::StrCat(Text(AF_INET6, &v6), "/64");
}

}  // namespace sheaf::coordinator
