// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "coordinator/access/page_sessions.h"

#include <utility>

#include "absl/strings/escaping.h"
#include "common/base/digest.h"
#include "common/base/secret.h"

namespace sheaf::coordinator {
namespace {

constexpr size_t kPageSecretBytes = 32;

}  // namespace

std::string PageSecrets::Make(const PageUser& user, absl::Time now) {
  std::string secret = absl::WebSafeBase64Escape(RandomBytes(kPageSecretBytes));
  const MutexLock lock(&mutex_);
  MakeRoom(user.id, now);
  entries_.emplace(Sha256Hex(secret), Entry{user, now});
  return secret;
}

void PageSecrets::MakeRoom(const IdentityId& id, absl::Time now) {
  std::erase_if(entries_, [&](const auto& entry) { return now - entry.second.made >= lifetime_; });
  auto oldest = entries_.end(), oldest_of_id = entries_.end();
  size_t count_of_id = 0;
  for (auto it = entries_.begin(); it != entries_.end(); ++it) {
    const auto is_older = [&](auto than) ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_) {
      return than == entries_.end() || it->second.made < than->second.made;
    };
    if (is_older(oldest)) oldest = it;
    if (it->second.user.id != id) continue;
    ++count_of_id;
    if (is_older(oldest_of_id)) oldest_of_id = it;
  }
  if (count_of_id >= kPageSecretsOfIdentityMax) {
    entries_.erase(oldest_of_id);
  } else if (entries_.size() >= kPageSecretsMax) {
    entries_.erase(oldest);
  }
}

std::optional<PageUser> PageSecrets::Find(const std::string& secret, absl::Time now) const {
  const MutexLock lock(&mutex_);
  const auto found = entries_.find(Sha256Hex(secret));
  const bool valid = found != entries_.end() && now - found->second.made < lifetime_;
  return valid ? std::optional(found->second.user) : std::nullopt;
}

std::optional<PageUser> PageSecrets::Take(const std::string& secret, absl::Time now) {
  const std::optional<PageUser> user = Find(secret, now);
  if (!user) return std::nullopt;
  const MutexLock lock(&mutex_);
  // Only one of several concurrent calls erases it, and thus consumes it.
  return entries_.erase(Sha256Hex(secret)) == 1 ? user : std::nullopt;
}

}  // namespace sheaf::coordinator
