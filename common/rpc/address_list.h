// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// The addresses of the coordinators that share a farm, written "a:7400,b:7400". One of them serves
// at a time: the others refuse connections until they take over.
#pragma once

#include <string>
#include <vector>

#include "absl/time/time.h"

namespace sheaf {

inline constexpr size_t kCoordinatorAddressesMax = 8;
// How long to wait at most between two attempts to reach one of several coordinators: a takeover
// lasts some seconds.
inline constexpr absl::Duration kFollowInterval = absl::Milliseconds(500);

// At least one; they are not checked.
std::vector<std::string> SplitAddresses(const std::string& addresses);
bool HasSeveralAddresses(const std::string& addresses);

// What a gRPC channel connects to, in the order of the list. One address stays as it is. Names of
// several are resolved now, since gRPC takes lists of numeric addresses alone; those that cannot be
// resolved are left out with a warning.
std::string ChannelTarget(const std::string& addresses);

// Which of the addresses answered a call; peer: grpc::ClientContext::peer of the call. The first
// one where that cannot be told.
std::string AnsweringAddress(const std::string& addresses, const std::string& peer);

}  // namespace sheaf
