// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// The client's side of AccessService: enrolling a machine or a user with a one-time token, and
// renewing certificates.
#pragma once

#include <optional>
#include <string>

#include "absl/status/statusor.h"
#include "common/tls/credential_store.h"
#include "common/tls/enrolment_token.h"

namespace sheaf {

struct Enrolment {
  std::string identity;  // "user:anna", "worker:node7".
  std::string role;      // "work", "view", "submit", "operate" or "administer".
  absl::Time not_after;  // When the certificate ends, by the coordinator's clock.
  CredentialFiles files;
};

// Enrols at the coordinator at "host:port" and stores the credentials. Waits for a coordinator that
// is just starting. Errors: kUnauthenticated (the token); kUnavailable (no coordinator that the
// token's authority has certified answers under this name); those of writing files.
absl::StatusOr<Enrolment> Enroll(const std::string& address, const EnrolmentToken& token,
                                 const CredentialStore& store);

// Renews the certificate at the coordinator at "host:port", with the same key, if more than this
// fraction of its lifetime is over. Returns whether it did. Errors: kUnauthenticated, saying what
// to do (the certificate has ended, or its holder is revoked); kUnavailable; those of files.
absl::StatusOr<bool> RenewCertificate(const std::string& address, const CredentialFiles& files,
                                      double life_fraction);

// Logs WhyNotYetValid of a certificate.
void WarnOfClock(const std::string& certificate_pem);

// Whether the files hold a certificate whose time has not ended.
bool HasValidCertificate(const std::optional<CredentialFiles>& files);

// The token in a file, or on standard input if path is "-".
absl::StatusOr<EnrolmentToken> ReadTokenFile(const std::string& path);

}  // namespace sheaf
