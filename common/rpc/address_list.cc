// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "common/rpc/address_list.h"

#include <arpa/inet.h>
#include <netdb.h>
#include <netinet/in.h>
#include <sys/socket.h>

#include <algorithm>
#include <array>
#include <memory>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "absl/strings/str_split.h"
#include "common/base/log.h"
#include "common/rpc/address.h"

namespace sheaf {
namespace {

// The first numeric addresses of a host; empty where it has none of that family.
struct ResolvedHost {
  std::string ipv4, ipv6;
  uint16_t port = 0;
};

std::string Numeric(const sockaddr* address, socklen_t length) {
  std::array<char, NI_MAXHOST> host{};
  const int error =
      ::getnameinfo(address, length, host.data(), host.size(), nullptr, 0, NI_NUMERICHOST);
  return error == 0 ? host.data() : "";
}

ResolvedHost Resolve(const Address& address) {
  ResolvedHost resolved;
  resolved.port = address.port;
  addrinfo hints{};
  hints.ai_socktype = SOCK_STREAM;
  addrinfo* found = nullptr;
  if (::getaddrinfo(address.host.c_str(), nullptr, &hints, &found) != 0) return resolved;
  const std::unique_ptr<addrinfo, decltype(&::freeaddrinfo)> freed(found, ::freeaddrinfo);
  for (const addrinfo* each = found; each != nullptr; each = each->ai_next) {
    std::string* const text = each->ai_family == AF_INET    ? &resolved.ipv4
                              : each->ai_family == AF_INET6 ? &resolved.ipv6
                                                            : nullptr;
    if (text != nullptr && text->empty()) *text = Numeric(each->ai_addr, each->ai_addrlen);
  }
  return resolved;
}

}  // namespace

std::vector<std::string> SplitAddresses(const std::string& addresses) {
  return absl::StrSplit(addresses, ',');
}

bool HasSeveralAddresses(const std::string& addresses) {
  return addresses.find(',') != std::string::npos;
}

std::string ChannelTarget(const std::string& addresses) {
  if (!HasSeveralAddresses(addresses)) return addresses;
  std::vector<ResolvedHost> hosts;
  for (const std::string& text : SplitAddresses(addresses)) {
    const absl::StatusOr<Address> address = ParseAddress(text);
    ResolvedHost host = address.ok() ? Resolve(*address) : ResolvedHost();
    if (host.ipv4.empty() && host.ipv6.empty()) {
      LogWarning(absl::StrCat(text,
                              ": this coordinator's name cannot be resolved; the others are "
                              "asked without it"));
      continue;
    }
    hosts.push_back(std::move(host));
  }
  if (hosts.empty()) return SplitAddresses(addresses).front();  // gRPC says what is wrong.
  // A list is of one family. An IPv4 address can be written as one of IPv6.
  const bool all_ipv4 = std::ranges::all_of(hosts, [](const auto& h) { return !h.ipv4.empty(); });
  return absl::StrCat(
      all_ipv4 ? "ipv4:" : "ipv6:",
      absl::StrJoin(hosts, ",", [all_ipv4](std::string* text, const ResolvedHost& host) {
        if (all_ipv4) {
          absl::StrAppend(text, host.ipv4, ":", host.port);
        } else {
          absl::StrAppend(text, "[", host.ipv6.empty() ? "::ffff:" + host.ipv4 : host.ipv6,
                          "]:", host.port);
        }
      }));
}

std::string AnsweringAddress(const std::string& addresses, const std::string& peer) {
  const std::vector<std::string> list = SplitAddresses(addresses);
  if (list.size() == 1) return addresses;
  for (const std::string& text : list) {
    const absl::StatusOr<Address> address = ParseAddress(text);
    if (!address.ok()) continue;
    const ResolvedHost host = Resolve(*address);
    if (peer == absl::StrCat("ipv4:", host.ipv4, ":", host.port) ||
        peer == absl::StrCat("ipv6:%5B", host.ipv6, "%5D:", host.port)) {
      return text;
    }
  }
  return list.front();
}

}  // namespace sheaf
