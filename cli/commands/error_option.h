// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Errors on the command line.
#pragma once

#include "common/command_line/command_line.h"

namespace sheaf::cli {

// A transformation of an option's text: "5%", the typical error of a pixel (cli/error_text.h),
// becomes its relMSE, 0.0025. Other text stays as it is.
CLI::Validator PercentAsRelativeMse();

}  // namespace sheaf::cli
