// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// The name of this machine.
#pragma once

#include <string>
#include <string_view>

namespace sheaf {

// The name from gethostname(2), made fit for messages by UsableHostName. The first call warns if
// that changed it.
std::string HostName();

// Bytes that are not printable UTF-8 become "_", and an empty name becomes "unnamed-host".
std::string UsableHostName(std::string_view name);

}  // namespace sheaf
