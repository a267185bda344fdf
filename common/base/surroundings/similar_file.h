// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Finds files whose names look like one that does not exist: in another case, or with accents that
// are characters of their own, as macOS writes them (Unicode normalization form D).
#pragma once

#include <string>
#include <string_view>

namespace sheaf {

// "; there is \"Room.pbrt\", in other case" if a folder on the path holds a file or folder of such
// a name, otherwise "". Requires: nothing exists at path.
std::string SimilarFileHint(const std::string& path);

// Equal for names that differ in the case of letters or in Unicode normalization: Latin letters of
// most languages, basic Greek and Cyrillic, kana and Hangul. Other names may have equal ones, too.
std::string NameSkeleton(std::string_view name);

}  // namespace sheaf
