// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Network addresses, written "host:port".
#pragma once

#include <cstdint>
#include <optional>
#include <string>

#include "absl/status/statusor.h"

namespace sheaf {

struct Address {
  std::string host;   // A name or a literal; IPv6 literals without their brackets.
  uint16_t port = 0;  // 0 lets the system choose, when listening.
};

// The default port on which a coordinator listens and its clients and workers connect.
inline constexpr uint16_t kCoordinatorPort = 7400;
inline constexpr char kCoordinatorAddress[] = "127.0.0.1:7400";

// Parses "host:port" or "[ipv6]:port", and with a default port also "host" or "[ipv6]".
// Errors: kInvalidArgument, describing what is wrong with the text.
absl::StatusOr<Address> ParseAddress(const std::string& text,
                                     std::optional<uint16_t> default_port = std::nullopt);
// Adds kCoordinatorPort to the address of a coordinator that has no port. Returns an error text, or
// "", as option readers expect.
std::string CompleteCoordinatorAddress(std::string& text);
// Returns "host:port", with brackets around an IPv6 literal.
std::string FormatAddress(const Address& address);
// Whether the address is reachable from this machine only: "localhost", 127.0.0.0/8 or ::1. Names
// are not resolved.
bool IsLoopback(const Address& address);

}  // namespace sheaf
