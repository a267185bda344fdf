// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// PrintJob: a job with its frames as text on standard output, as `sheaf show` prints it.
#pragma once

#include "cli/job/farm_client.h"

namespace sheaf::cli {

void PrintJob(const v1::Job& job);

}  // namespace sheaf::cli
