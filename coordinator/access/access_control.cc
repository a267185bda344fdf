// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "coordinator/access/access_control.h"

#include <utility>

#include "absl/strings/str_cat.h"
#include "common/base/check.h"

namespace sheaf::coordinator {
namespace {

// The last part of an operation's name, for users: "GetJob".
std::string ShortName(std::string_view operation) {
  return std::string(operation.front() == '/' ? operation.substr(operation.rfind('/') + 1)
                                              : operation);
}

absl::Status RevokedError(const IdentityId& id) {
  return absl::UnauthenticatedError(
      absl::StrCat(FormatIdentity(id), " is revoked; ask an administrator of the farm"));
}

}  // namespace

const char* RefusalReasonName(RefusalReason reason) {
  switch (reason) {
    case RefusalReason::kRole:
      return "role";
    case RefusalReason::kCertificate:
      return "certificate";
    case RefusalReason::kLimit:
      return "limit";
  }
  return "unknown";
}

std::string AccessControl::Directory(const std::string& state_directory) {
  return state_directory + "/access";
}

bool AccessControl::Exists(const std::string& state_directory) {
  return CertificateAuthority::Exists(Directory(state_directory));
}

absl::StatusOr<std::unique_ptr<AccessControl>> AccessControl::Open(
    const std::string& state_directory, const CertificateLifetimes& lifetimes,
    const IdentityLimits& limits) {
  const std::string directory = Directory(state_directory);
  absl::StatusOr<std::unique_ptr<CertificateAuthority>> authority =
      CertificateAuthority::Open(directory);
  if (!authority.ok()) return authority.status();
  absl::StatusOr<std::unique_ptr<IdentityStore>> identities =
      IdentityStore::Open(directory + "/access.db");
  if (!identities.ok()) return identities.status();
  return std::unique_ptr<AccessControl>(
      new AccessControl(state_directory + "/audit.log", *std::move(authority),
                        *std::move(identities), lifetimes, limits));
}

absl::StatusOr<CertificateTerms> AccessControl::Verify(const std::string& certificate_pem,
                                                       absl::Time now) {
  {
    const MutexLock lock(&mutex_);
    const auto known = verified_.find(certificate_pem);
    if (known != verified_.end()) return known->second;
  }
  absl::StatusOr<CertificateTerms> terms = ReadCertificate(certificate_pem);
  if (!terms.ok()) return terms.status();
  const absl::Status verified = VerifyCertificate(certificate_pem, CertificateUse::kClient,
                                                  authority_->certificate_pem(), now);
  if (!verified.ok()) return verified;
  const MutexLock lock(&mutex_);
  // Rare, and each costs one verification, so ages are not tracked.
  if (verified_.size() >= kVerifiedCertificatesMax) verified_.clear();
  verified_.emplace(certificate_pem, *terms);
  return terms;
}

absl::StatusOr<Caller> AccessControl::Authenticate(const std::string& certificate_pem,
                                                   absl::Time now) {
  if (certificate_pem.empty()) return Caller{};
  const absl::StatusOr<CertificateTerms> terms = Verify(certificate_pem, now);
  if (!terms.ok()) return absl::UnauthenticatedError(terms.status().message());
  if (now > terms->not_after) {
    return absl::UnauthenticatedError(
        absl::StrCat("the certificate of ", terms->common_name, " has expired; enrol again"));
  }
  const absl::StatusOr<IdentityId> id = ParseIdentity(terms->common_name);
  if (!id.ok()) return absl::UnauthenticatedError(id.status().message());
  return Current(*id, terms->generation);
}

absl::StatusOr<Caller> AccessControl::Current(const IdentityId& id, uint64_t generation) {
  absl::StatusOr<std::optional<Identity>> identity = identities_->Find(id);
  if (!identity.ok()) return identity.status();
  const bool current =
      identity->has_value() && !(*identity)->revoked() && (*identity)->generation == generation;
  if (!current) return RevokedError(id);
  return Caller{**std::move(identity)};
}

absl::StatusOr<Caller> AccessControl::AuthenticateSession(const std::string& session,
                                                          absl::Time now) {
  const std::optional<PageUser> user = page_.sessions.Find(session, now);
  if (!user) return Caller{};
  return Current(user->id, user->generation);
}

absl::Status AccessControl::Authorize(const Caller& caller, std::string_view operation) {
  const std::optional<Requirement> requirement = RequirementOf(operation);
  if (!requirement) {
    return absl::PermissionDeniedError(
        absl::StrCat(ShortName(operation), " is not an operation of this coordinator"));
  }
  if (Permits(*requirement, caller.role())) return absl::OkStatus();
  if (!caller.identity) {
    return absl::UnauthenticatedError(absl::StrCat(
        ShortName(operation), " needs ",
        operation.front() == '/' ? "a certificate; log in first: sheaf login ADDRESS"
                                 : "a session; sign in at /login with a token of sheaf page"));
  }
  return absl::PermissionDeniedError(
      absl::StrCat(caller.Name(), " has the role ", RoleName(caller.identity->role), "; ",
                   ShortName(operation), " needs ", Describe(*requirement)));
}

absl::Status AccessControl::Admit(const std::string& certificate_pem, std::string_view operation,
                                  const std::string& peer, absl::Time now) {
  return Decide(Authenticate(certificate_pem, now), operation, peer, now).status();
}

absl::StatusOr<Caller> AccessControl::AdmitSession(const std::string& session,
                                                   std::string_view operation,
                                                   const std::string& peer, absl::Time now) {
  return Decide(AuthenticateSession(session, now), operation, peer, now);
}

absl::StatusOr<Caller> AccessControl::AuthenticateScraper(const std::string& token,
                                                          std::string_view operation,
                                                          absl::Time now) {
  absl::StatusOr<Identity> identity = identities_->FindScrapeToken(token, now);
  if (!identity.ok()) return identity.status();
  if (RequirementOf(operation) != Requirement::kScrape) {
    return absl::PermissionDeniedError(absl::StrCat(
        "a scrape token of ", FormatIdentity(identity->id), " reads /metrics and nothing else"));
  }
  return Caller{*std::move(identity)};
}

absl::StatusOr<Caller> AccessControl::AdmitScraper(const std::string& token,
                                                   std::string_view operation,
                                                   const std::string& peer, absl::Time now) {
  return Decide(AuthenticateScraper(token, operation, now), operation, peer, now);
}

absl::StatusOr<Caller> AccessControl::Decide(absl::StatusOr<Caller> caller,
                                             std::string_view operation, const std::string& peer,
                                             absl::Time now) {
  // Without a valid certificate, operations that need none are still permitted: an expired worker
  // enrols again.
  const bool needs_none = RequirementOf(operation) == Requirement::kNothing;
  if (!caller.ok() && needs_none) caller = Caller{};
  absl::Status admitted = caller.ok() ? Authorize(*caller, operation) : caller.status();
  const std::string name = caller.ok() ? caller->Name() : "";
  if (!name.empty()) {
    if (admitted.ok()) admitted = use_.NoteCall(caller->identity->id, now);
  } else if (operation.front() != '/') {
    // The gate does not know the address of gRPC's strangers; Enroll counts their calls.
    absl::Status counted = use_.NoteStrangerCall(peer, now);
    if (!counted.ok()) admitted = std::move(counted);
  }
  if (admitted.ok()) return caller;
  NoteRefused(name.empty() ? peer : absl::StrCat(name, " at ", peer), operation, admitted, now);
  return admitted;
}

void AccessControl::NoteRefused(const std::string& who, std::string_view operation,
                                const absl::Status& why, absl::Time now) {
  const RefusalReason reason = absl::IsUnauthenticated(why)    ? RefusalReason::kCertificate
                               : absl::IsPermissionDenied(why) ? RefusalReason::kRole
                                                               : RefusalReason::kLimit;
  refused_[static_cast<size_t>(reason)].fetch_add(1, std::memory_order_relaxed);
  audit_.NoteRefused(who, ShortName(operation), why, now);
}

std::array<uint64_t, kRefusalReasonCount> AccessControl::RefusedByReason() const {
  std::array<uint64_t, kRefusalReasonCount> counts{};
  for (size_t i = 0; i < counts.size(); ++i) {
    counts[i] = refused_[i].load(std::memory_order_relaxed);
  }
  return counts;
}

std::string AccessControl::UsageOwnerOf(const Caller& caller) {
  const std::optional<Role> role = caller.role();
  return !role || *role >= Role::kOperate ? "" : caller.identity->id.name;
}

absl::Status AccessControl::AuthorizeJob(const Caller& caller, const std::string& owner) {
  const std::optional<Role> role = caller.role();
  if (role && *role >= Role::kOperate) return absl::OkStatus();
  if (role && *role == Role::kSubmit && caller.identity->id.name == owner) return absl::OkStatus();
  return absl::PermissionDeniedError(absl::StrCat("the job belongs to ", owner, "; ", caller.Name(),
                                                  " may control it only with the role ",
                                                  RoleName(Role::kOperate)));
}

absl::StatusOr<AccessControl::IssuedCertificate> AccessControl::Issue(
    const Identity& identity, const std::string& request_pem, absl::Time now) const {
  const absl::Duration lifetime =
      identity.id.kind == IdentityKind::kWorker ? lifetimes_.worker : lifetimes_.user;
  absl::StatusOr<std::string> certificate =
      authority_->IssueClientCertificate(identity, request_pem, now, lifetime);
  if (!certificate.ok()) return certificate.status();
  return IssuedCertificate{*std::move(certificate), identity};
}

absl::StatusOr<AccessControl::IssuedCertificate> AccessControl::Enroll(
    const std::string& token_secret, const std::string& request_pem, const std::string& address,
    absl::Time now) {
  if (absl::Status status = use_.NoteStrangerCall(address, now); !status.ok()) return status;
  // First, so that a malformed request does not consume the token.
  const absl::StatusOr<std::string> key = CheckCertificateRequest(request_pem);
  if (!key.ok()) return key.status();
  const absl::StatusOr<Identity> identity = identities_->UseToken(token_secret, *key, now);
  if (!identity.ok()) return identity.status();
  return Issue(*identity, request_pem, now);
}

absl::StatusOr<AccessControl::IssuedCertificate> AccessControl::Renew(
    const Caller& caller, const std::string& request_pem, absl::Time now) {
  SHEAF_CHECK(caller.identity.has_value());
  return Issue(*caller.identity, request_pem, now);
}

std::string AccessControl::IssuePageToken(const Caller& caller, absl::Time now) {
  SHEAF_CHECK(caller.identity.has_value());
  return page_.tokens.Make({caller.identity->id, caller.identity->generation}, now);
}

absl::StatusOr<std::string> AccessControl::SignIn(const std::string& token, const std::string& peer,
                                                  absl::Time now) {
  const std::optional<PageUser> user = page_.tokens.Take(token, now);
  const absl::StatusOr<Caller> caller = user ? Current(user->id, user->generation)
                                             : absl::StatusOr<Caller>(absl::UnauthenticatedError(
                                                   "the page's token is unknown, used or expired"));
  if (!caller.ok()) {
    NoteRefused(peer, "sign in", caller.status(), now);
    return caller.status();
  }
  audit_.Note(absl::StrCat(caller->Name(), " at ", peer), "sign in", "page", absl::OkStatus());
  return page_.sessions.Make(*user, now);
}

void AccessControl::SignOut(const std::string& session, const std::string& peer, absl::Time now) {
  const std::optional<PageUser> user = page_.sessions.Take(session, now);
  if (!user) return;
  audit_.Note(absl::StrCat(FormatIdentity(user->id), " at ", peer), "sign out", "page",
              absl::OkStatus());
}

}  // namespace sheaf::coordinator
