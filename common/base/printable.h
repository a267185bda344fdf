// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Text of strangers (scene files, titles, file names) for terminals and logs: no byte of it is a
// command to them, and no line of it ends before ours does.
#pragma once

#include <cstddef>
#include <string>
#include <string_view>

namespace sheaf {

// The offset of the first byte that is no printable character of UTF-8; npos where there is none.
size_t FindUnprintable(std::string_view text);
// Printable characters of UTF-8 stay; every other byte becomes \xNN, a newline \n and a tab a
// space. Beyond shown_bytes_max of text, "..." stands for the rest.
std::string Printable(std::string_view text, size_t shown_bytes_max = std::string_view::npos);
// The same, line by line: newlines stay.
std::string PrintableLines(std::string_view text);

}  // namespace sheaf
