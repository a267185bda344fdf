// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// The requirements of the coordinator's operations on their callers, in one table: every gRPC
// method and every HTTP route. An operation that is not in it is always refused; tests compare the
// table with the existing services and routes.
#pragma once

#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "coordinator/access/identity.h"

namespace sheaf::coordinator {

// The callers that an operation admits.
enum class Requirement {
  kNothing,   // Every caller, even without a certificate.
  kIdentity,  // Every user and worker.
  kWork,      // Workers.
  kWorkOrOperate,
  kScrape,  // Scrape tokens, and users with the role view or a higher one.
  kView,    // Users with this role or a higher one; the same below.
  kSubmit,
  kOperate,
  kAdminister,
};

struct OperationRule {
  const char* operation;  // "/sheaf.v1.JobService/GetJob", "GET /api/v1/jobs".
  Requirement requirement;
};

// All rules.
const std::vector<OperationRule>& RoleTable();
// None for an operation that is not in the table.
std::optional<Requirement> RequirementOf(std::string_view operation);
// role: none for a caller without an identity.
bool Permits(Requirement requirement, std::optional<Role> role);
// "the role submit", "a worker": the permitted callers, for messages.
std::string Describe(Requirement requirement);

}  // namespace sheaf::coordinator
