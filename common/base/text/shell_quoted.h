// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Text for a command that users may copy into a shell.
#pragma once

#include <string>

namespace sheaf {

// In single quotes if a shell would interpret the text otherwise.
std::string ShellQuoted(const std::string& text);

}  // namespace sheaf
