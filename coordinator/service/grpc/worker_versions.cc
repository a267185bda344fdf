// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "coordinator/service/grpc/worker_versions.h"

#include "absl/strings/str_cat.h"
#include "common/base/log.h"
#include "common/rpc/protocol_version.h"

namespace sheaf::coordinator {

bool WorkerVersions::Note(const std::string& worker_id, int version) {
  if (version == kProtocolVersion) return false;
  {
    const MutexLock lock(&mutex_);
    if (told_.size() >= kToldMax) told_.clear();
    if (!told_.insert(worker_id).second) return false;
  }
  LogInfo(absl::StrCat("workers/", worker_id, " speaks version ", version,
                       " of the protocol, this coordinator ", kProtocolVersion,
                       ": its program is older, and still understood"));
  return true;
}

}  // namespace sheaf::coordinator
