// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// AccessControl: decides whether a caller may make a call, and issues certificates. It joins the
// authority, the identities, the role table and the audit log. A coordinator whose state directory
// has no authority has no AccessControl, and permits every call.
#pragma once

#include <array>
#include <atomic>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <unordered_map>

#include "absl/status/statusor.h"
#include "absl/time/time.h"
#include "common/base/mutex.h"
#include "coordinator/access/audit_log.h"
#include "coordinator/access/certificate_authority.h"
#include "coordinator/access/identity_limits.h"
#include "coordinator/access/identity_store.h"
#include "coordinator/access/page_sessions.h"
#include "coordinator/access/role_table.h"

namespace sheaf::coordinator {

// How long certificates are valid. They are renewed long before their end; the lifetime limits the
// use of a stolen key whose theft is not noticed. A user's survives a week without a call.
struct CertificateLifetimes {
  absl::Duration worker = absl::Hours(24);
  absl::Duration user = absl::Hours(24 * 7);
};
// Why calls are refused; each has a counter.
enum class RefusalReason {
  kRole,         // The caller may not do it.
  kCertificate,  // The caller shows no valid certificate, session or token.
  kLimit,        // A limit of IdentityUse, or of the farm.
};
inline constexpr size_t kRefusalReasonCount = 3;
// Returns "role", "certificate" or "limit".
const char* RefusalReasonName(RefusalReason reason);

inline constexpr size_t kVerifiedCertificatesMax = 10'000;  // Remembered as valid.

// Thread safety: all members may be called concurrently.
class AccessControl {
 public:
  // The directory of everything below, in a state directory.
  static std::string Directory(const std::string& state_directory);
  // Whether sheaf-coordinator init was run for the state directory.
  static bool Exists(const std::string& state_directory);
  // Errors: those of CertificateAuthority::Open and IdentityStore::Open.
  static absl::StatusOr<std::unique_ptr<AccessControl>> Open(
      const std::string& state_directory, const CertificateLifetimes& lifetimes = {},
      const IdentityLimits& limits = {});

  const CertificateAuthority& authority() const { return *authority_; }
  IdentityStore& identities() { return *identities_; }
  AuditLog& audit() { return audit_; }
  IdentityUse& use() { return use_; }
  // Records a refusal that a limit of IdentityUse decided.
  void NoteRefused(const std::string& who, std::string_view operation, const absl::Status& why,
                   absl::Time now);

  // How many were recorded since the start, by RefusalReason.
  std::array<uint64_t, kRefusalReasonCount> RefusedByReason() const;

  // The owner of this certificate. Without a certificate: a caller without an identity. Errors:
  // kUnauthenticated: of another authority, expired, revoked, or of an earlier enrolment.
  absl::StatusOr<Caller> Authenticate(const std::string& certificate_pem, absl::Time now);
  // Errors: kUnauthenticated (no certificate), kPermissionDenied (another role is needed); an
  // unknown operation is refused.
  static absl::Status Authorize(const Caller& caller, std::string_view operation);
  // Authenticate and Authorize, within the limits of the identity or, without one, of the address
  // `peer`. Records refusals. `peer` is the source of the call. Errors: also kResourceExhausted.
  absl::Status Admit(const std::string& certificate_pem, std::string_view operation,
                     const std::string& peer, absl::Time now);
  // The same for a browser's session instead of a certificate; returns the caller.
  absl::StatusOr<Caller> AdmitSession(const std::string& session, std::string_view operation,
                                      const std::string& peer, absl::Time now);
  // The same for a scrape token, which permits only operations that require kScrape.
  absl::StatusOr<Caller> AdmitScraper(const std::string& token, std::string_view operation,
                                      const std::string& peer, absl::Time now);
  // The user whose accounts the caller may see; "": all users', as with the role operate or without
  // certificates.
  static std::string UsageOwnerOf(const Caller& caller);
  // Whether the caller may change a job of the owner. Errors: kPermissionDenied.
  static absl::Status AuthorizeJob(const Caller& caller, const std::string& owner);

  struct IssuedCertificate {
    std::string certificate_pem;
    Identity identity;
  };
  // address: the caller's, without its port. Errors: kUnauthenticated (the token),
  // kInvalidArgument (the request for a certificate), kResourceExhausted (the address calls too
  // often).
  absl::StatusOr<IssuedCertificate> Enroll(const std::string& token_secret,
                                           const std::string& request_pem,
                                           const std::string& address, absl::Time now);
  // Requires: the caller has an identity. Errors: kInvalidArgument.
  absl::StatusOr<IssuedCertificate> Renew(const Caller& caller, const std::string& request_pem,
                                          absl::Time now);

  // A token with which a browser signs in as the caller, once. Requires: the caller has an
  // identity.
  std::string IssuePageToken(const Caller& caller, absl::Time now);
  // Returns the secret of a new session. Errors: kUnauthenticated (the token). Recorded.
  absl::StatusOr<std::string> SignIn(const std::string& token, const std::string& peer,
                                     absl::Time now);
  // Ends the session, if there is one. Recorded.
  void SignOut(const std::string& session, const std::string& peer, absl::Time now);

 private:
  AccessControl(std::string audit_path, std::unique_ptr<CertificateAuthority> authority,
                std::unique_ptr<IdentityStore> identities, const CertificateLifetimes& lifetimes,
                const IdentityLimits& limits)
      : authority_(std::move(authority)),
        identities_(std::move(identities)),
        audit_(std::move(audit_path)),
        use_(limits),
        lifetimes_(lifetimes) {}
  // The terms of a certificate of this authority, even if it is no longer valid.
  absl::StatusOr<CertificateTerms> Verify(const std::string& certificate_pem, absl::Time now);
  // The identity, if it is not revoked and still in this generation. Errors: kUnauthenticated.
  absl::StatusOr<Caller> Current(const IdentityId& id, uint64_t generation);
  // The owner of a scrape token. Errors: kUnauthenticated, kPermissionDenied.
  absl::StatusOr<Caller> AuthenticateScraper(const std::string& token, std::string_view operation,
                                             absl::Time now);
  // The owner of a session. An unknown secret: a caller without an identity.
  absl::StatusOr<Caller> AuthenticateSession(const std::string& session, absl::Time now);
  // Decides on an authenticated caller, or on the error of authentication, and records refusals.
  absl::StatusOr<Caller> Decide(absl::StatusOr<Caller> caller, std::string_view operation,
                                const std::string& peer, absl::Time now);
  absl::StatusOr<IssuedCertificate> Issue(const Identity& identity, const std::string& request_pem,
                                          absl::Time now) const;

  const std::unique_ptr<CertificateAuthority> authority_;
  const std::unique_ptr<IdentityStore> identities_;
  AuditLog audit_;
  std::array<std::atomic<uint64_t>, kRefusalReasonCount> refused_{};
  PageSessions page_;
  IdentityUse use_;
  const CertificateLifetimes lifetimes_;
  Mutex mutex_;
  // Certificates whose signatures were verified, so that each call does not do it again.
  std::unordered_map<std::string, CertificateTerms> verified_ ABSL_GUARDED_BY(mutex_);
};

}  // namespace sheaf::coordinator
