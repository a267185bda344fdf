// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "cli/commands/error_option.h"

#include <string>

#include "absl/strings/numbers.h"
#include "absl/strings/str_format.h"

namespace sheaf::cli {

CLI::Validator PercentAsRelativeMse() {
  return CLI::Validator(
      [](std::string& text) -> std::string {
        double percent = 0;
        if (text.ends_with('%') && absl::SimpleAtod(text.substr(0, text.size() - 1), &percent)) {
          text = absl::StrFormat("%.9g", percent * percent * 1e-4);
        }
        return "";
      },
      "");
}

}  // namespace sheaf::cli
