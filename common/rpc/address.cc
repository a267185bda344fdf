// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "common/rpc/address.h"

#include <arpa/inet.h>

#include <algorithm>
#include <vector>

#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "common/rpc/address_list.h"

namespace sheaf {
namespace {

absl::Status Malformed(const std::string& text, const std::string& why) {
  return absl::InvalidArgumentError(absl::StrCat("address \"", text, "\": ", why,
                                                 "; write host:port, for example 127.0.0.1:7400"));
}

}  // namespace

absl::StatusOr<Address> ParseAddress(const std::string& text,
                                     std::optional<uint16_t> default_port) {
  if (const size_t scheme = text.find("://"); scheme != std::string::npos) {
    return Malformed(text, absl::StrCat("is an address of the page or of a web server; leave out ",
                                        text.substr(0, scheme + 3), " and give the port of gRPC, ",
                                        kCoordinatorPort, " unless --listen names another"));
  }
  size_t colon = text.rfind(':');
  // The colons inside "[::1]" do not start a port.
  if (colon != std::string::npos && text.find(']', colon) != std::string::npos) {
    colon = std::string::npos;
  }
  if (colon == std::string::npos && !default_port) return Malformed(text, "has no port");
  Address address;
  address.host = text.substr(0, colon);
  if (address.host.size() >= 2 && address.host.front() == '[' && address.host.back() == ']') {
    address.host = address.host.substr(1, address.host.size() - 2);
  } else if (address.host.find(':') != std::string::npos) {
    return Malformed(text, "an IPv6 host needs brackets");
  }
  if (address.host.empty()) return Malformed(text, "has no host");
  if (address.host.find_first_of("[]") != std::string::npos) {
    return Malformed(text, "the brackets do not enclose an IPv6 host");
  }
  if (colon == std::string::npos) {
    address.port = *default_port;
    return address;
  }
  const std::string port_text = text.substr(colon + 1);
  const bool digits =
      !port_text.empty() && port_text.size() <= 5 &&
      std::all_of(port_text.begin(), port_text.end(), [](char c) { return c >= '0' && c <= '9'; });
  uint32_t port = 0;
  if (!digits || !absl::SimpleAtoi(port_text, &port) || port > 65535) {
    return Malformed(text, "the port is not a number from 0 to 65535");
  }
  address.port = static_cast<uint16_t>(port);
  return address;
}

std::string CompleteCoordinatorAddress(std::string& text) {
  std::vector<std::string> addresses = SplitAddresses(text);
  if (addresses.size() > kCoordinatorAddressesMax) {
    return absl::StrCat("\"", text, "\": a farm has at most ", kCoordinatorAddressesMax,
                        " coordinators");
  }
  for (std::string& each : addresses) {
    const absl::StatusOr<Address> address = ParseAddress(each, kCoordinatorPort);
    if (!address.ok()) return std::string(address.status().message());
    if (address->port == 0) return std::string(Malformed(each, "the port is 0").message());
    each = FormatAddress(*address);
  }
  text = absl::StrJoin(addresses, ",");
  return "";
}

std::string FormatAddress(const Address& address) {
  const bool ipv6 = address.host.find(':') != std::string::npos;
  return ipv6 ? absl::StrCat("[", address.host, "]:", address.port)
              : absl::StrCat(address.host, ":", address.port);
}

bool IsLoopback(const Address& address) {
  if (address.host == "localhost") return true;
  in_addr ipv4{};
  if (::inet_pton(AF_INET, address.host.c_str(), &ipv4) == 1) {
    return (ntohl(ipv4.s_addr) >> 24) == 127;
  }
  in6_addr ipv6{};
  return ::inet_pton(AF_INET6, address.host.c_str(), &ipv6) == 1 && IN6_IS_ADDR_LOOPBACK(&ipv6);
}

}  // namespace sheaf
