// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// PageSessions: browsers that are signed in to the page. An enrolled user gets a token by a
// command. A browser exchanges the token once for a session, and then sends the session's secret as
// a cookie. Only digests of secrets are kept, in memory: a restart of the coordinator ends all
// sessions.
#pragma once

#include <cstddef>
#include <map>
#include <optional>
#include <string>

#include "absl/time/time.h"
#include "common/base/mutex.h"
#include "coordinator/access/identity.h"

namespace sheaf::coordinator {

inline constexpr absl::Duration kPageTokenLifetime = absl::Minutes(5);
inline constexpr absl::Duration kPageSessionLifetime = absl::Hours(12);
// Limits of tokens, and of sessions. Beyond one the oldest of the identity, or of all, ends.
inline constexpr size_t kPageSecretsMax = 10'000;
inline constexpr size_t kPageSecretsOfIdentityMax = 20;

// The user who is signed in. The generation tells whether the name was enrolled again since.
struct PageUser {
  IdentityId id;
  uint64_t generation = 0;
};

// Secrets of 256 bits that stand for an identity for a time. Thread safety: all members may be
// called concurrently.
class PageSecrets {
 public:
  explicit PageSecrets(absl::Duration lifetime) : lifetime_(lifetime) {}
  // Returns the new secret as base64url.
  std::string Make(const PageUser& user, absl::Time now);
  // None for a secret that is unknown or expired.
  std::optional<PageUser> Find(const std::string& secret, absl::Time now) const;
  // The same, and forgets the secret.
  std::optional<PageUser> Take(const std::string& secret, absl::Time now);

 private:
  struct Entry {
    PageUser user;
    absl::Time made;
  };
  // Makes room for one more secret of the identity.
  void MakeRoom(const IdentityId& id, absl::Time now) ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);

  const absl::Duration lifetime_;
  mutable Mutex mutex_;
  std::map<std::string, Entry> entries_ ABSL_GUARDED_BY(mutex_);  // By SHA-256 of the secret.
};

// Thread safety: all members may be called concurrently.
struct PageSessions {
  PageSecrets tokens{kPageTokenLifetime};
  PageSecrets sessions{kPageSessionLifetime};
};

}  // namespace sheaf::coordinator
