// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "common/scene/pbrt/statements/supported_names.h"

#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "common/base/check.h"
#include "common/base/nearest_name.h"

namespace sheaf {

std::string SupportedNamesHint(std::string_view name, const std::vector<std::string>& names) {
  SHEAF_CHECK(!names.empty());
  const std::string last = names.size() > 1 ? absl::StrCat(" and ", names.back()) : "";
  const auto end = names.size() > 1 ? names.end() - 1 : names.end();
  return absl::StrCat(NearestNameHint(name, names),
                      "; supported: ", absl::StrJoin(names.begin(), end, ", "), last);
}

}  // namespace sheaf
