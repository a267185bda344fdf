// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "coordinator/store/farm_secret.h"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <cstdio>

#include "absl/strings/str_cat.h"
#include "common/base/file.h"
#include "common/base/secret.h"
#include "common/base/status.h"

namespace sheaf::coordinator {
namespace {

constexpr size_t kSecretBytes = 32;
constexpr mode_t kOwnerOnly = 0600;

// Nobody may read the file at any time, and it is whole or not there.
absl::Status WriteSecret(const std::string& path, const std::string& secret) {
  const std::string unfinished = path + ".new";
  ::unlink(unfinished.c_str());
  const int fd = ::open(unfinished.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, kOwnerOnly);
  if (fd < 0) return StatusFromErrno(errno, unfinished);
  const bool written =
      ::write(fd, secret.data(), secret.size()) == static_cast<ssize_t>(secret.size()) &&
      ::fsync(fd) == 0;
  const int error = errno;
  ::close(fd);
  if (!written) return StatusFromErrno(error, unfinished);
  if (std::rename(unfinished.c_str(), path.c_str()) != 0) return StatusFromErrno(errno, path);
  return absl::OkStatus();
}

}  // namespace

absl::StatusOr<std::string> LoadOrMakeSecret(const std::string& directory) {
  const std::string path = directory + "/lease.key";
  struct stat properties {};
  if (::stat(path.c_str(), &properties) != 0) {
    if (errno != ENOENT) return StatusFromErrno(errno, path);
    const std::string secret = RandomBytes(kSecretBytes);
    if (absl::Status written = WriteSecret(path, secret); !written.ok()) return written;
    return secret;
  }
  if ((properties.st_mode & 077) != 0) {
    return absl::FailedPreconditionError(
        absl::StrCat(path, ": other users may read or write the secret that proves leases; run ",
                     "chmod 600 on it, or remove it and leases of now are rendered again"));
  }
  absl::StatusOr<std::string> secret = ReadWholeFile(path, kSecretBytes + 1);
  if (secret.ok() && secret->size() == kSecretBytes) return secret;
  if (!secret.ok() && !absl::IsResourceExhausted(secret.status())) return secret;
  return absl::FailedPreconditionError(
      absl::StrCat(path, ": not a secret of ", kSecretBytes,
                   " bytes; remove it, and leases of now are rendered again"));
}

}  // namespace sheaf::coordinator
