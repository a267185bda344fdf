// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "coordinator/access/identity.h"

#include <algorithm>

#include "absl/strings/ascii.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/strip.h"

namespace sheaf::coordinator {
namespace {

constexpr size_t kNameBytesMax = 40;  // With "worker:", within the 64 of a common name.
constexpr char kUserPrefix[] = "user:";
constexpr char kWorkerPrefix[] = "worker:";

}  // namespace

const char* RoleName(Role role) {
  switch (role) {
    case Role::kWork:
      return "work";
    case Role::kView:
      return "view";
    case Role::kSubmit:
      return "submit";
    case Role::kOperate:
      return "operate";
    case Role::kAdminister:
      return "administer";
  }
  return "unknown";
}

std::optional<Role> UserRoleFromName(const std::string& name) {
  for (const Role role : {Role::kView, Role::kSubmit, Role::kOperate, Role::kAdminister}) {
    if (name == RoleName(role)) return role;
  }
  return std::nullopt;
}

std::string FormatIdentity(const IdentityId& id) {
  return absl::StrCat(id.kind == IdentityKind::kUser ? kUserPrefix : kWorkerPrefix, id.name);
}

absl::StatusOr<IdentityId> ParseIdentity(const std::string& text) {
  absl::string_view name = text;
  IdentityId id;
  if (absl::ConsumePrefix(&name, kWorkerPrefix)) {
    id.kind = IdentityKind::kWorker;
  } else if (!absl::ConsumePrefix(&name, kUserPrefix)) {
    return absl::InvalidArgumentError(absl::StrCat("\"", text, "\" names no user or worker"));
  }
  id.name = std::string(name);
  if (absl::Status status = CheckIdentityName(id.name); !status.ok()) return status;
  return id;
}

absl::Status CheckIdentityName(const std::string& name) {
  const bool allowed = std::all_of(name.begin(), name.end(), [](unsigned char c) {
    return absl::ascii_isalnum(c) || c == '.' || c == '-' || c == '_' || c == '@';
  });
  if (!name.empty() && name.size() <= kNameBytesMax && allowed && name != "local") {
    return absl::OkStatus();
  }
  return absl::InvalidArgumentError(absl::StrCat(
      "\"", name, "\" is not a name of a user or worker: it needs 1 to ", kNameBytesMax,
      " letters, digits, '.', '-', '_' or '@', and \"local\" is reserved"));
}

}  // namespace sheaf::coordinator
