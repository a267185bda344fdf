// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "common/rpc/certificate_renewal.h"

#include <stop_token>
#include <utility>

#include "absl/strings/str_cat.h"
#include "common/base/log.h"
#include "common/base/mutex.h"
#include "common/rpc/enrolment.h"

namespace sheaf {
namespace {

void RenewUntil(const std::stop_token& stop, const std::string& address,
                const CredentialFiles& files, absl::Duration interval) {
  bool failing = false;
  do {
    const absl::StatusOr<bool> renewed = RenewCertificate(address, files, kRenewalFraction);
    if (renewed.ok() && *renewed) LogInfo("the certificate is renewed");
    if (!renewed.ok() && !failing) {
      LogWarning(absl::StrCat("the certificate cannot be renewed: ",
                              std::string(renewed.status().message()), "; trying again"));
    }
    failing = !renewed.ok();
  } while (SleepUnlessStopped(interval, stop));
}

}  // namespace

CertificateRenewal::CertificateRenewal(std::string address, CredentialFiles files,
                                       absl::Duration interval)
    : thread_([address = std::move(address), files = std::move(files), interval](
                  const std::stop_token& stop) { RenewUntil(stop, address, files, interval); }) {}

}  // namespace sheaf
