// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Names of the grids of a file, each of which names one grid.
#pragma once

#include <map>
#include <string>
#include <vector>

#include "absl/strings/str_cat.h"

namespace sheaf::volume {

// The name of the n-th grid, from 0, of those that a file gives one name. Source: OpenVDB's
// GridDescriptor::nameAsString.
inline std::string NumberedName(const std::string& name, int n) {
  return n == 0 ? name : absl::StrCat(name, "[", n, "]");
}

// Entry: has a name. Numbers the names that the file gives to several grids, in its order.
template <typename Entry>
void NumberSharedNames(std::vector<Entry>* entries) {
  std::map<std::string, int> count;
  for (Entry& entry : *entries) entry.name = NumberedName(entry.name, count[entry.name]++);
}

}  // namespace sheaf::volume
