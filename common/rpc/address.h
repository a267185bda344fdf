// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// "host:port" as people write it.
#pragma once

#include <cstdint>
#include <optional>
#include <string>

#include "absl/status/statusor.h"

namespace sheaf {

struct Address {
  std::string host;   // A name or a literal; IPv6 literals without their brackets.
  uint16_t port = 0;  // 0 asks the system to choose, where one listens.
};

// Where a coordinator listens, and where its clients and workers look for it, unless told
// otherwise.
inline constexpr uint16_t kCoordinatorPort = 7400;
inline constexpr char kCoordinatorAddress[] = "127.0.0.1:7400";

// Reads "host:port" or "[ipv6]:port", and where there is a default port "host" or "[ipv6]" too.
// Errors: kInvalidArgument, saying what is wrong with the text.
absl::StatusOr<Address> ParseAddress(const std::string& text,
                                     std::optional<uint16_t> default_port = std::nullopt);
// Completes the address of a coordinator to call by kCoordinatorPort where it has no port. Returns
// what is wrong with the text, or "": so option readers take it.
std::string CompleteCoordinatorAddress(std::string& text);
// Returns "host:port", with brackets around an IPv6 literal.
std::string FormatAddress(const Address& address);
// Whether only this machine can reach it: "localhost", 127.0.0.0/8 or ::1. Names are not resolved.
bool IsLoopback(const Address& address);

}  // namespace sheaf
