// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// "host:port" as people write it.
#pragma once

#include <cstdint>
#include <string>

#include "absl/status/statusor.h"

namespace sheaf {

struct Address {
  std::string host;   // A name or a literal; IPv6 literals without their brackets.
  uint16_t port = 0;  // 0 asks the system to choose, where one listens.
};

// Reads "host:port" or "[ipv6]:port".
// Errors: kInvalidArgument, saying what is wrong with the text.
absl::StatusOr<Address> ParseAddress(const std::string& text);
// Returns "host:port", with brackets around an IPv6 literal.
std::string FormatAddress(const Address& address);
// Whether only this machine can reach it: "localhost", 127.0.0.0/8 or ::1. Names are not resolved.
bool IsLoopback(const Address& address);

}  // namespace sheaf
