// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "coordinator/access/role_table.h"

#include <map>

#include "absl/strings/str_cat.h"
#include "common/base/check.h"
#include "coordinator/core/job/job_verbs.h"

namespace sheaf::coordinator {
namespace {

// The lowest user role that a requirement names; none if it does not name one.
std::optional<Role> LeastRole(Requirement requirement) {
  switch (requirement) {
    case Requirement::kScrape:
    case Requirement::kView:
      return Role::kView;
    case Requirement::kSubmit:
      return Role::kSubmit;
    case Requirement::kOperate:
    case Requirement::kWorkOrOperate:
      return Role::kOperate;
    case Requirement::kAdminister:
      return Role::kAdminister;
    case Requirement::kNothing:
    case Requirement::kIdentity:
    case Requirement::kWork:
      break;
  }
  return std::nullopt;
}

using enum Requirement;
constexpr OperationRule kRules[] = {
    {"/sheaf.v1.AccessService/Enroll", kNothing},
    {"/sheaf.v1.AccessService/RenewCertificate", kIdentity},
    {"/sheaf.v1.AccessService/IssuePageToken", kView},

    {"/sheaf.v1.JobService/GetJob", kView},
    {"/sheaf.v1.JobService/ListJobs", kView},
    {"/sheaf.v1.JobService/WatchJob", kView},
    {"/sheaf.v1.JobService/ListJobEvents", kView},
    {"/sheaf.v1.JobService/ReadFrameOutput", kView},
    {"/sheaf.v1.JobService/PriceRefinement", kView},
    {"/sheaf.v1.JobService/LiftQuarantine", kOperate},
    {"/sheaf.v1.JobService/ListWorkers", kView},
    // Below the role operate, only the caller's own (AccessControl::UsageOwnerOf).
    {"/sheaf.v1.JobService/ListUsage", kView},
    // With the role submit, only the caller's own jobs (AccessControl::AuthorizeJob). The methods
    // and routes of kJobVerbs come from kVerbRules.
    {"/sheaf.v1.JobService/CreateJob", kSubmit},
    {"/sheaf.v1.JobService/ReadTaskBundle", kSubmit},
    {"/sheaf.v1.JobService/CollectGarbage", kOperate},
    {"/sheaf.v1.JobService/SetShare", kOperate},
    {"/sheaf.v1.JobService/ResetShare", kOperate},
    {"/sheaf.v1.JobService/ListShares", kView},
    {"/sheaf.v1.JobService/DrainWorkers", kOperate},
    {"/sheaf.v1.JobService/UndrainWorkers", kOperate},

    {"/sheaf.v1.ContentService/FindMissing", kSubmit},
    {"/sheaf.v1.ContentService/GetWriteStatus", kSubmit},
    {"/sheaf.v1.ContentService/WriteBlob", kSubmit},
    {"/sheaf.v1.ContentService/ReadBlob", kWorkOrOperate},

    {"/sheaf.v1.TransferService/WriteSmallBlobs", kSubmit},
    {"/sheaf.v1.TransferService/PlanWrite", kSubmit},
    {"/sheaf.v1.TransferService/WriteChunks", kSubmit},
    {"/sheaf.v1.TransferService/LocateBlob", kWork},
    {"/sheaf.v1.TransferService/ReportContent", kWork},

    {"/sheaf.v1.WorkerService/Synchronize", kWork},
    {"/sheaf.v1.WorkerService/UploadResults", kWork},
    {"/sheaf.v1.WorkerService/DeliverResults", kWork},
    {"/sheaf.v1.WorkerService/PlanUploads", kWork},
    {"/sheaf.v1.WorkerService/ReadGuidingField", kWork},

    {"/grpc.health.v1.Health/Check", kIdentity},
    {"/grpc.health.v1.Health/Watch", kIdentity},
    {"/grpc.reflection.v1alpha.ServerReflection/ServerReflectionInfo", kView},

    {"GET /login", kNothing},
    {"POST /login", kNothing},
    {"POST /logout", kNothing},
    {"GET /login.html", kNothing},
    {"GET /style.css", kNothing},
    {"GET /favicon.svg", kNothing},
    {"GET /licences.txt", kNothing},
    {"GET /", kView},
    {"GET /index.html", kView},
    {"GET /app.js", kView},
    {"GET /error_chart.js", kView},
    {"GET /exposure_worker.js", kView},
    {"GET /usd_worker.js", kView},

    {"GET /healthz", kNothing},
    {"GET /readyz", kNothing},
    {"GET /metrics", kScrape},
    {"GET /api/v1/session", kView},
    {"GET /api/v1/events", kView},
    {"GET /api/v1/jobs", kView},
    {"GET /api/v1/jobs/{}", kView},
    {"GET /api/v1/jobs/{}/failures", kView},
    {"GET /api/v1/jobs/{}/log", kView},
    {"GET /api/v1/jobs/{}/refine-price", kView},
    {"GET /api/v1/jobs/{}/frames/{}", kView},
    {"GET /api/v1/jobs/{}/frames/{}/preview.png", kView},
    {"GET /api/v1/jobs/{}/frames/{}/output.exr", kView},
    {"GET /api/v1/jobs/{}/frames/{}/layers", kView},
    {"GET /api/v1/jobs/{}/frames/{}/pixel", kView},
    {"GET /api/v1/farm", kView},
    {"GET /api/v1/false-color.png", kView},
    {"GET /api/v1/workers", kView},
    {"GET /api/v1/counters", kView},
    {"GET /api/v1/usage", kView},
    {"POST /api/v1/gc", kOperate},
    {"POST /api/v1/workers/{}:drain", kOperate},
    {"POST /api/v1/workers/{}:undrain", kOperate},
    // Only the caller's own submissions, whose jobs are also the caller's.
    {"GET /api/v1/submissions", kView},
    {"GET /api/v1/submissions/{}", kSubmit},
    {"POST /api/v1/submissions", kSubmit},
    {"POST /api/v1/submissions/{}/files", kSubmit},
    {"POST /api/v1/submissions/{}:read", kSubmit},
    {"POST /api/v1/submissions/{}:discard", kSubmit},
};

#define SHEAF_METHOD(call, word, takes) {"/sheaf.v1.JobService/" #call, kSubmit},
#define SHEAF_ROUTE(call, word, takes) {"POST /api/v1/jobs/{}:" word, kSubmit},
constexpr OperationRule kVerbRules[] = {SHEAF_JOB_VERBS(SHEAF_METHOD) SHEAF_JOB_VERBS(SHEAF_ROUTE)};
#undef SHEAF_METHOD
#undef SHEAF_ROUTE

}  // namespace

const std::vector<OperationRule>& RoleTable() {
  static const auto* const kTable = [] {
    auto* table = new std::vector<OperationRule>(std::begin(kRules), std::end(kRules));
    table->insert(table->end(), std::begin(kVerbRules), std::end(kVerbRules));
    return table;
  }();
  return *kTable;
}

std::optional<Requirement> RequirementOf(std::string_view operation) {
  static const auto* const kByOperation = [] {
    auto* map = new std::map<std::string_view, Requirement>;
    for (const OperationRule& rule : RoleTable()) {
      SHEAF_CHECK(map->emplace(rule.operation, rule.requirement).second);
    }
    return map;
  }();
  const auto found = kByOperation->find(operation);
  if (found == kByOperation->end()) return std::nullopt;
  return found->second;
}

bool Permits(Requirement requirement, std::optional<Role> role) {
  if (requirement == Requirement::kNothing) return true;
  if (!role) return false;
  if (requirement == Requirement::kIdentity) return true;
  const bool for_workers =
      requirement == Requirement::kWork || requirement == Requirement::kWorkOrOperate;
  if (*role == Role::kWork) return for_workers;
  const std::optional<Role> least = LeastRole(requirement);
  return least && *role >= *least;
}

std::string Describe(Requirement requirement) {
  if (requirement == Requirement::kNothing) return "no role required";
  if (requirement == Requirement::kIdentity) return "a user or a worker";
  if (requirement == Requirement::kWork) return "a worker";
  const std::string user = absl::StrCat("the role ", RoleName(*LeastRole(requirement)));
  if (requirement == Requirement::kWorkOrOperate) return absl::StrCat("a worker, or ", user);
  return requirement == Requirement::kScrape ? absl::StrCat("a scrape token, or ", user) : user;
}

}  // namespace sheaf::coordinator
