// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// CredentialStore: the directory in which a machine or a user keeps the keys and certificates of
// the coordinators that have enrolled it. Each coordinator has a folder, named by the digest of its
// authority's certificate:
//
//     DIRECTORY/FOLDER/key.pem          the private key; made here, never sent
//     DIRECTORY/FOLDER/certificate.pem  replaced as a whole when it is renewed
//     DIRECTORY/FOLDER/authority.pem    the only root against which the coordinator is verified
//     DIRECTORY/FOLDER/addresses        "host:port" lines: where the coordinator was reached
//
// Folders have mode 0700 and files 0600.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "absl/time/time.h"
#include "common/tls/certificate.h"

namespace sheaf {

inline constexpr int kCoordinatorsMax = 1000;           // Folders that are looked at.
inline constexpr int kAddressesOfCoordinatorMax = 100;  // The latest ones are kept.

// Where the credentials for one coordinator are.
struct CredentialFiles {
  std::string key_path, certificate_path, authority_path;
};

// The key and certificate of a machine, and the authority that it trusts.
struct Credentials {
  std::string key_pem, certificate_pem, authority_pem;
};

// The elapsed fraction of a certificate's lifetime: 0 at its beginning, 1 at its end. Negative
// before.
double LifeFraction(const CertificateTerms& certificate, absl::Time now);
// Says so, and what to do, if the clock is so far behind that by it the certificate has yet to
// begin; otherwise empty. Calls of programs with such a clock fail.
std::string WhyNotYetValid(const CertificateTerms& certificate, absl::Time now);

// Thread safety: all members may be called concurrently, also by several processes.
class CredentialStore {
 public:
  // An empty directory holds no credentials and takes none.
  explicit CredentialStore(std::string directory) : directory_(std::move(directory)) {}

  // "$XDG_CONFIG_HOME/sheaf/coordinators" or "~/.config/sheaf/coordinators": a user's. Empty
  // without a home directory.
  static std::string PersonalDirectory();
  // "$XDG_STATE_HOME/sheaf/worker" or "~/.local/state/sheaf/worker": a machine's. Empty
  // likewise.
  static std::string WorkerDirectory();

  // The files for the coordinator at "host:port"; none without an enrolment there.
  std::optional<CredentialFiles> Find(const std::string& address) const;
  // Stores credentials, and that the coordinator is at these addresses. Another coordinator that
  // was there before loses the addresses.
  absl::StatusOr<CredentialFiles> Put(const Credentials& credentials,
                                      const std::vector<std::string>& addresses) const;

 private:
  std::vector<std::string> Folders() const;
  absl::Status RemoveAddresses(const std::string& folder,
                               const std::vector<std::string>& addresses) const;

  const std::string directory_;
};

}  // namespace sheaf
