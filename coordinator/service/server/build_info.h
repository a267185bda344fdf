// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// The build of this program: its version, the revision of its sources if they are a repository, its
// compiler and its numeric profile.
#pragma once

#include "coordinator/service/view/server_metrics.h"

namespace sheaf::coordinator {

BuildInfo CoordinatorBuild();

}  // namespace sheaf::coordinator
