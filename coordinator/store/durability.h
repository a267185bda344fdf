// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Durability: how long what a store has lasts. Also when the machine loses its power, or, where
// nobody will come back for it (a farm of one in a temporary folder), as long as the process, which
// spares what disks wait for.
#pragma once

namespace sheaf::coordinator {

enum class Durability { kPowerLoss, kProcess };

}  // namespace sheaf::coordinator
