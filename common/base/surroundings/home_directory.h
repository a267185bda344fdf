// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// The folder where a user's files begin.
#pragma once

#include <string>

namespace sheaf {

// $HOME, or otherwise the home directory in the list of users, as services and cron jobs may lack
// the variable. Empty if neither is an absolute path: a path below the working directory would
// differ from start to start.
std::string HomeDirectory();

}  // namespace sheaf
