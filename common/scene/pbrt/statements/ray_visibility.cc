// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "common/scene/pbrt/statements/ray_visibility.h"

#include <algorithm>
#include <iterator>
#include <string>
#include <vector>

#include "absl/strings/str_cat.h"
#include "common/scene/pbrt/statements/supported_names.h"

namespace sheaf {

RayKinds GetInvisible(ParameterList& parameters) {
  RayKinds invisible = 0;
  for (const std::string& word : parameters.GetStrings("invisible")) {
    const auto* known = std::ranges::find(kRayKindNames, word, &RayKindName::name);
    if (known == std::end(kRayKindNames)) {
      std::vector<std::string> names;
      for (const RayKindName& kind : kRayKindNames) names.emplace_back(kind.name);
      parameters.ErrorAt(*parameters.Find("invisible"),
                         absl::StrCat("has \"", word, "\", which is no kind of ray",
                                      SupportedNamesHint(word, names)));
    } else if ((invisible & BitOf(known->kind)) != 0) {
      parameters.ErrorAt(*parameters.Find("invisible"),
                         absl::StrCat("has \"", word, "\" twice; give it once"));
    } else {
      invisible |= BitOf(known->kind);
    }
  }
  return invisible;
}

}  // namespace sheaf
