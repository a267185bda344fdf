// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "cli/interruption.h"

#include <unistd.h>

#include "cli/exit_code.h"

namespace sheaf::cli {

Interruption::Interruption()
    : signals_([this](int, int count) {
        if (count > 1) ::_exit(static_cast<int>(ExitCode::kInterrupted));
        stop_.request_stop();
      }) {}

}  // namespace sheaf::cli
