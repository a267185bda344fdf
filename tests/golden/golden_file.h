// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Golden files: what users and programs see, as text in tests/golden/files.
#pragma once

#include <string>

namespace sheaf::testing {

// Whether the program was called with --renew: golden files are then written instead of compared.
void SetRenewal(bool renews);
// Fails where the text is not that of the file, and writes the text beside it as NAME.actual. name:
// from the repository's root.
void ExpectGoldenAt(const std::string& name, const std::string& text);
// The same for a file of tests/golden/files.
void ExpectGolden(const std::string& name, const std::string& text);

}  // namespace sheaf::testing
