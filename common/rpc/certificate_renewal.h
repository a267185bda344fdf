// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// CertificateRenewal: a thread that renews a program's certificate for as long as the program runs.
#pragma once

#include <string>
#include <thread>

#include "absl/time/time.h"
#include "common/tls/credential_store.h"

namespace sheaf {

// A certificate is renewed when this fraction of its lifetime is over. The rest is a margin for
// coordinators that are down.
inline constexpr double kRenewalFraction = 2.0 / 3.0;

class CertificateRenewal {
 public:
  // Looks at the certificate at once and every `interval`, renews it when it is due, and logs
  // failures once.
  CertificateRenewal(std::string address, CredentialFiles files,
                     absl::Duration interval = absl::Minutes(1));
  // Stops at once, except for a call in progress.
  ~CertificateRenewal() = default;

 private:
  std::jthread thread_;
};

}  // namespace sheaf
