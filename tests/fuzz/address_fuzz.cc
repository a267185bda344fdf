// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Feeds arbitrary text to the parser of addresses. An address that it accepts is written and read
// back as the same address.
#include "common/rpc/address.h"

#include <optional>
#include <string>

#include "common/rpc/address_list.h"
#include "tests/fuzz/fuzz_target.h"

namespace sheaf {

SHEAF_FUZZ_TARGET(address) {
  std::string text(bytes);
  for (const std::optional<uint16_t> default_port :
       {std::optional<uint16_t>(), std::optional(kCoordinatorPort)}) {
    const absl::StatusOr<Address> address = ParseAddress(text, default_port);
    if (!address.ok()) continue;
    IsLoopback(*address);
    const absl::StatusOr<Address> again = ParseAddress(FormatAddress(*address));
    SHEAF_CHECK(again.ok() && again->host == address->host && again->port == address->port);
  }
  if (!CompleteCoordinatorAddress(text).empty()) return;
  for (const std::string& each : SplitAddresses(text)) SHEAF_CHECK(ParseAddress(each).ok());
}

}  // namespace sheaf
