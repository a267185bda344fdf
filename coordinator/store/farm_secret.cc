// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "coordinator/store/farm_secret.h"

#include <sys/stat.h>

#include <cerrno>

#include "absl/strings/str_cat.h"
#include "common/base/file.h"
#include "common/base/secret.h"
#include "common/base/status.h"

namespace sheaf::coordinator {
namespace {

constexpr size_t kSecretBytes = 32;

}  // namespace

absl::StatusOr<std::string> LoadOrMakeSecret(const std::string& directory) {
  const std::string path = directory + "/lease.key";
  struct stat properties {};
  if (::stat(path.c_str(), &properties) != 0) {
    if (errno != ENOENT) return StatusFromErrno(errno, path);
    const std::string secret = RandomBytes(kSecretBytes);
    if (absl::Status written = WriteSecretAtomically(path, secret); !written.ok()) return written;
    return secret;
  }
  if ((properties.st_mode & 077) != 0) {
    return absl::FailedPreconditionError(
        absl::StrCat(path, ": other users may read or write the secret that proves leases; run ",
                     "chmod 600 on it, or remove it, and open leases are rendered again"));
  }
  const absl::StatusOr<std::string> secret = ReadWholeFile(path, kSecretBytes + 1);
  if (secret.ok() && secret->size() == kSecretBytes) return *secret;
  if (!secret.ok() && !absl::IsResourceExhausted(secret.status())) return secret.status();
  return absl::FailedPreconditionError(
      absl::StrCat(path, ": not a secret of ", kSecretBytes,
                   " bytes; remove it, and open leases are rendered again"));
}

}  // namespace sheaf::coordinator
