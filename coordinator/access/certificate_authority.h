// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// CertificateAuthority: issues all certificates of one farm. It is the only root that the farm's
// machines trust. It is stored in a directory of the coordinator's state:
//
//     DIRECTORY/authority.key   DIRECTORY/authority.pem
//     DIRECTORY/server.key      DIRECTORY/server.pem      the coordinator's own certificate
//     DIRECTORY/hosts           the names and addresses in it, a line each
//
// The directory has mode 0700 and its files 0600.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "absl/time/time.h"
#include "common/tls/certificate.h"
#include "common/tls/credential_store.h"
#include "coordinator/access/identity.h"

namespace sheaf::coordinator {

inline constexpr absl::Duration kAuthorityLifetime = absl::Hours(24 * 3652);  // Ten years.
inline constexpr absl::Duration kServerLifetime = absl::Hours(24 * 30);
inline constexpr size_t kServerHostsMax = 100;

// Thread safety: const members may be called concurrently.
class CertificateAuthority {
 public:
  // Whether the directory holds an authority.
  static bool Exists(const std::string& directory);
  // Makes an authority and a server certificate, or adds hosts to those of an existing one.
  // Errors: kInvalidArgument (a host); kResourceExhausted (too many hosts); those of files.
  static absl::Status Create(const std::string& directory, const std::vector<std::string>& hosts,
                             absl::Time now);
  // Errors: kNotFound; kFailedPrecondition, naming the damaged file.
  static absl::StatusOr<std::unique_ptr<CertificateAuthority>> Open(const std::string& directory);

  const std::string& certificate_pem() const { return issuer_.certificate_pem; }
  // The server's certificate and key, and the authority against which it verifies clients.
  CredentialFiles server_files() const;
  // The names and addresses of the server certificate. Errors: those of files.
  absl::StatusOr<std::vector<std::string>> Hosts() const;
  // When the authority's own certificate ends.
  absl::Time Expiry() const;
  // When the server certificate on disk ends; UnixEpoch if it cannot be read.
  absl::Time ServerExpiry() const;

  // Issues the server certificate again if half of its lifetime is over, or if hosts were added.
  // Returns whether it did. Errors: those of files.
  absl::StatusOr<bool> RenewServerCertificate(absl::Time now) const;

  // A client's certificate for the key of the request, valid from now on. Errors:
  // kInvalidArgument (the request).
  absl::StatusOr<std::string> IssueClientCertificate(const Identity& identity,
                                                     const std::string& request_pem, absl::Time now,
                                                     absl::Duration lifetime) const;

 private:
  CertificateAuthority(std::string directory, Issuer issuer)
      : directory_(std::move(directory)), issuer_(std::move(issuer)) {}
  absl::Status IssueServerCertificate(const std::vector<std::string>& hosts, absl::Time now) const;

  const std::string directory_;
  const Issuer issuer_;
};

// The names under which other machines may reach this one: localhost, the host name, and the
// addresses of its network interfaces.
std::vector<std::string> HostsOfThisMachine();

}  // namespace sheaf::coordinator
