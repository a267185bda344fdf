// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// AgingClock: the time by which stored things age. Their stamps come from the wall clock, which can
// be set a month ahead by mistake, and a removal cannot be undone.
#pragma once

#include <algorithm>

#include "absl/time/time.h"

namespace sheaf::coordinator {

class AgingClock {
 public:
  // since_boot: of CLOCK_BOOTTIME, which cannot be set and which runs while a machine sleeps.
  // Requires: the wall clock is right now.
  AgingClock(absl::Time wall, absl::Duration since_boot) : boot_(wall - since_boot) {}

  // The wall clock, but never later than it would be without being set.
  absl::Time At(absl::Time wall, absl::Duration since_boot) const {
    return std::min(wall, boot_ + since_boot);
  }
  // How far the wall clock has been set ahead; negative if it was set back.
  absl::Duration Ahead(absl::Time wall, absl::Duration since_boot) const {
    return wall - boot_ - since_boot;
  }

 private:
  absl::Time boot_;
};

}  // namespace sheaf::coordinator
