// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// The protobuf library prints lines of its own on standard error. Programs that link this print
// none: the lines go to the debug log, and what matters is said in the error of the call.
#pragma once

#include <string>

namespace sheaf {

// The field, as "CreateJobRequest.title", that this thread last tried to send though its text is
// not UTF-8, which no receiver takes; empty if there was none since the last call.
std::string TakeFieldThatIsNotUtf8();

}  // namespace sheaf
