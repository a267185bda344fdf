// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// SkippedParts: what a file has that has no effect, or another one, as one note for each kind, with
// the first place and the count of the others.
#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <string_view>
#include <vector>

#include "common/scene/pbrt/syntax/diagnostics.h"

namespace sheaf::gltf {

class SkippedParts {
 public:
  // what: the place, such as "material 3"; problem: the kind, with what to do.
  void Add(const std::string& what, const std::string& problem);
  void Report(Diagnostics* diagnostics) const;

 private:
  struct Kind {
    std::string problem, first;
    uint64_t count = 0;
  };
  std::map<std::string, size_t, std::less<>> index_of_;  // In kinds_, by problem.
  std::vector<Kind> kinds_;                              // In the order of the file.
};

}  // namespace sheaf::gltf
