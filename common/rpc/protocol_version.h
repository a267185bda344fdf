// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// The version of the protocol between Sheaf's programs: the calls of proto/sheaf/v1 and what they
// mean. Each side of a call says which versions it understands; both speak the newest that both
// understand, or none (docs/operations.md, Upgrades). protocol_calls.h sends and compares them.
#pragma once

#include <string>
#include <string_view>

#include "absl/status/statusor.h"

namespace sheaf {

// The version that these programs speak. It grows by one with a change that programs of the version
// before must know of. Fields that they may ignore need none.
inline constexpr int kProtocolVersion = 1;
// The oldest version that these programs still understand.
inline constexpr int kOldestProtocolVersion = 1;
// A version beyond is malformed.
inline constexpr int kProtocolVersionMax = 999'999;

// The versions that a program understands, from oldest to newest.
struct ProtocolRange {
  int oldest = 1, newest = 1;
  friend bool operator==(const ProtocolRange&, const ProtocolRange&) = default;
};
inline constexpr ProtocolRange kProtocol{kOldestProtocolVersion, kProtocolVersion};

// The key of the range in the metadata of calls, and of their answers.
inline constexpr char kProtocolKey[] = "sheaf-protocol";

// Returns "1-2": oldest and newest.
std::string FormatProtocol(const ProtocolRange& range);
// The reverse. An empty text is the range 1-1: a tool that says no version speaks the first.
// Errors: kFailedPrecondition.
absl::StatusOr<ProtocolRange> ParseProtocol(std::string_view text);

// The version that a client and a coordinator speak with each other. Errors: kFailedPrecondition,
// with a message for the client's user: the versions of each side, the older program, and what to
// do.
absl::StatusOr<int> AgreeOnProtocol(const ProtocolRange& client, const ProtocolRange& coordinator);

// Returns "protocol 1, understands 1 to 1", for --version.
std::string DescribeProtocol();

}  // namespace sheaf
