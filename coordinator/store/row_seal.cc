// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "coordinator/store/row_seal.h"

#include "absl/strings/numbers.h"
#include "common/base/digest.h"

namespace sheaf::coordinator {
namespace {

constexpr size_t kSealHexDigits = 15;  // They fit into a positive number of SQLite.

}  // namespace

int64_t SealOfText(const std::string& text) {
  uint64_t seal = 0;
  // The digits of a digest are a number.
  (void)absl::SimpleHexAtoi(Sha256Hex(text).substr(0, kSealHexDigits), &seal);
  return seal == 0 ? 1 : static_cast<int64_t>(seal);
}

}  // namespace sheaf::coordinator
