// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Makes untrusted text (scene files, titles, file names) safe for terminals and logs: no byte of it
// can be a terminal command, and none can end a line of the log.
#pragma once

#include <cstddef>
#include <string>
#include <string_view>

namespace sheaf {

// The offset of the first byte that is not part of a printable UTF-8 character; npos if there is
// none.
size_t FindUnprintable(std::string_view text);
// Printable UTF-8 characters stay; every other byte becomes \xNN, a newline \n and a tab a space.
// Text beyond shown_bytes_max is replaced by "...".
std::string Printable(std::string_view text, size_t shown_bytes_max = std::string_view::npos);
// The same, line by line: newlines stay.
std::string PrintableLines(std::string_view text);

}  // namespace sheaf
