// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "coordinator/service/server/farm_objects.h"

#include <utility>

#include "absl/strings/str_cat.h"
#include "common/base/digest.h"
#include "common/base/file.h"
#include "common/base/log.h"
#include "coordinator/store/farm_secret.h"

namespace sheaf::coordinator {
namespace {

constexpr char kClaimName[] = "coordinator";
constexpr uint64_t kClaimBytesMax = 256;

}  // namespace

absl::Status ClaimObjects(const std::string& state_directory, ObjectStore* objects) {
  if (absl::Status made = MakeDirectories(state_directory); !made.ok()) return made;
  const absl::StatusOr<std::string> secret = LoadOrMakeSecret(state_directory);
  if (!secret.ok()) return secret.status();
  const std::string id = Sha256Hex("owner of objects: " + *secret);
  absl::StatusOr<std::string> owner = objects->GetRange(kClaimName, 0, kClaimBytesMax);
  if (absl::IsNotFound(owner.status())) {
    absl::Status put = objects->Put(kClaimName, id, PutMode::kIfAbsent);
    if (put.ok()) put = objects->Sync();
    if (!put.ok() && !absl::IsAlreadyExists(put)) return put;
    owner = objects->GetRange(kClaimName, 0, kClaimBytesMax);
  }
  if (!owner.ok()) return owner.status();
  if (*owner == id) return absl::OkStatus();
  return absl::FailedPreconditionError(
      absl::StrCat(objects->Name(),
                   ": belongs to the coordinator of another state directory; name "
                   "another prefix. If that one is gone, remove the object \"",
                   kClaimName, "\" there: parts of its jobs are then removed"));
}

absl::StatusOr<FarmObjects> OpenFarmObjects(const std::string& url,
                                            const std::string& state_directory,
                                            const Environment& environment) {
  absl::StatusOr<S3Options> options = ReadS3Options(url, environment);
  if (!options.ok()) return options.status();
  FarmObjects objects;
  objects.server = std::make_unique<S3Server>(*std::move(options));
  objects.parts = std::make_unique<S3Objects>(objects.server.get(), "parts");
  objects.content = std::make_unique<S3Objects>(objects.server.get(), "content");
  if (absl::Status status = objects.parts->Check(); !status.ok()) return status;
  if (absl::Status status = ClaimObjects(state_directory, objects.parts.get()); !status.ok()) {
    return status;
  }
  LogInfo(absl::StrCat("parts and files of scenes lie in ", url, " at ",
                       objects.server->options().endpoint));
  return objects;
}

}  // namespace sheaf::coordinator
