// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Text in UTF-8, whatever its characters: newlines, controls and unassigned ones too. Printable
// (common/base/printable.h) is for what people read.
#pragma once

#include <cstddef>
#include <string>
#include <string_view>

namespace sheaf {

// Whether messages can carry the text: protocol buffers refuse all else, and so do JSON readers.
bool IsUtf8(std::string_view text);
// The front of the text, of at most bytes_max bytes, that ends with a whole character.
std::string Utf8Prefix(std::string_view text, size_t bytes_max);

}  // namespace sheaf
