// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Identities: the users and workers of a farm, and what they may do.
#pragma once

#include <cstdint>
#include <optional>
#include <string>

#include "absl/status/statusor.h"
#include "absl/time/time.h"

namespace sheaf::coordinator {

// Both are stored as numbers: append new ones.
enum class IdentityKind { kUser, kWorker };

// The rights of an identity. A worker may only work. The roles of users are ordered: each includes
// those before it.
//   view        see jobs, images and workers
//   submit      submit jobs, and control one's own
//   operate     control all jobs
//   administer  everything
enum class Role { kWork, kView, kSubmit, kOperate, kAdminister };

// "work", "view", "submit", "operate" or "administer".
const char* RoleName(Role role);
// A user's role by its name; none for other texts, "work" among them.
std::optional<Role> UserRoleFromName(const std::string& name);

struct IdentityId {
  IdentityKind kind = IdentityKind::kUser;
  std::string name;
  friend auto operator<=>(const IdentityId&, const IdentityId&) = default;
};

// "user:anna", "worker:node7": the common name of the identity's certificates.
std::string FormatIdentity(const IdentityId& id);
// Errors: kInvalidArgument.
absl::StatusOr<IdentityId> ParseIdentity(const std::string& text);
// A name is 1 to 40 letters, digits, ".", "-", "_" and "@"; "local" is reserved for callers of a
// coordinator without certificates. Errors: kInvalidArgument.
absl::Status CheckIdentityName(const std::string& name);

struct Identity {
  IdentityId id;
  Role role = Role::kWork;
  // Certificates state the generation in which they were issued; those of an earlier one are
  // refused. A revoked identity that is enrolled again begins a new one.
  uint64_t generation = 1;
  absl::Time revoked_time = absl::InfiniteFuture();  // InfiniteFuture unless it is revoked.
  bool revoked() const { return revoked_time != absl::InfiniteFuture(); }
};

// The origin of a call.
struct Caller {
  std::optional<Identity> identity;  // None: shows no certificate.
  std::optional<Role> role() const {
    return identity ? std::optional(identity->role) : std::nullopt;
  }
  // "user:anna", "worker:node7" or "" for messages and the audit log.
  std::string Name() const { return identity ? FormatIdentity(identity->id) : ""; }
};

}  // namespace sheaf::coordinator
