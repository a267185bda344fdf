// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "worker/sandbox/protections.h"

#include <vector>

#include "absl/strings/str_join.h"

namespace sheaf::worker {

Protections Protections::All() {
  Protections all;
  for (const Protection protection : kAllProtections) all.Add(protection);
  return all;
}

const char* NameOf(Protection protection) {
  switch (protection) {
    case Protection::kNamespaces:
      return "namespaces";
    case Protection::kFileAccess:
      return "file access rules";
    case Protection::kSystemCalls:
      return "system call filter";
  }
  return "unknown";
}

std::string NamesOf(Protections protections) {
  std::vector<std::string> names;
  for (const Protection protection : kAllProtections) {
    if (protections.Has(protection)) names.emplace_back(NameOf(protection));
  }
  return names.empty() ? "none" : absl::StrJoin(names, ", ");
}

std::optional<SandboxMode> SandboxModeFromName(std::string_view name) {
  if (name == "required") return SandboxMode::kRequired;
  if (name == "best") return SandboxMode::kBest;
  if (name == "none") return SandboxMode::kNone;
  return std::nullopt;
}

}  // namespace sheaf::worker
