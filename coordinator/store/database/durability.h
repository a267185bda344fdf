// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Durability: whether a store's data survives a loss of power, or only lasts as long as the
// process. The latter avoids waiting for disk flushes where the data is not needed later, as in a
// single-machine farm in a temporary folder.
#pragma once

namespace sheaf::coordinator {

enum class Durability { kPowerLoss, kProcess };

}  // namespace sheaf::coordinator
