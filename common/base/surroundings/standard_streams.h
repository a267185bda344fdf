// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Standard input, output and error of a program: they are open from its start, and it notices at
// its end when its output was not written.
//
// A program that links this module opens /dev/null for those of the descriptors 0 to 2 that are
// closed, so that no file, socket or lock takes their numbers. Reading input or writing output that
// was closed remains an error. It does so before the initializers of its libraries, some of which
// open descriptors: gRPC's have an eventfd.
#pragma once

#include <functional>
#include <string>

namespace sheaf {

// "A file cannot be read or written", in the exit codes of sheaf --help.
inline constexpr int kOutputExitCode = 6;

// Flushes standard output at the end of a program. If the output could not be written, passes the
// reason to on_error and returns kOutputExitCode in place of 0; any other code remains. A reader
// that has closed its pipe is not an error: it has read enough.
int CodeAfterOutput(int code, const std::function<void(const std::string&)>& on_error);

}  // namespace sheaf
