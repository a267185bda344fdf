// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// IdentityStore: the identities of a farm and their enrolment tokens, in an SQLite database that
// several processes may have open. Commands change it while the coordinator runs, and the
// coordinator sees a change at its next call. Only the SHA-256 of a token's secret is stored.
#pragma once

#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "absl/time/time.h"
#include "common/base/mutex.h"
#include "coordinator/access/identity.h"
#include "coordinator/store/database/sqlite_database.h"

namespace sheaf::coordinator {

inline constexpr absl::Duration kTokenLifetime = absl::Hours(1);  // Unless told otherwise.
inline constexpr absl::Duration kTokenLifetimeMax = absl::Hours(24 * 30);
inline constexpr absl::Duration kScrapeTokenLifetimeMax = absl::Hours(24 * 365 * 10);
inline constexpr int64_t kScrapeTokensOfIdentityMax = 10;  // Several, so that one can be replaced.
inline constexpr int64_t kIdentitiesMax = 10'000;  // Revoked ones included: names stay taken.
inline constexpr int64_t kOpenTokensMax = 10'000;

// Thread safety: all members may be called concurrently.
class IdentityStore {
 public:
  // Opens or makes the database. Errors: those of SqliteDatabase::Open.
  static absl::StatusOr<std::unique_ptr<IdentityStore>> Open(const std::string& path);

  // Makes an identity, or gives an existing one this role; a revoked one starts a new generation.
  // Errors: kInvalidArgument (the name); kResourceExhausted (kIdentitiesMax).
  absl::Status PutIdentity(const IdentityId& id, Role role);
  // Makes a token that enrols one machine as an identity with this role, and the identity if it is
  // new or revoked. A higher role is granted when the token is used; a lower one at once, also to
  // its unused tokens. Returns the token's secret.
  // Errors: those of PutIdentity; kResourceExhausted (kOpenTokensMax).
  absl::StatusOr<std::string> MakeToken(const IdentityId& id, Role role, absl::Time now,
                                        absl::Duration lifetime);
  // From the next call on, its certificates and all its tokens are refused. Errors: kNotFound.
  absl::Status Revoke(const IdentityId& id, absl::Time now);

  // Consumes a token for a key, grants its role, and returns its identity. A token that the same
  // key has used is accepted again until it expires, because the first answer may be lost. Errors:
  // kUnauthenticated.
  absl::StatusOr<Identity> UseToken(const std::string& secret, const std::string& key_sha256_hex,
                                    absl::Time now);

  // Makes a token with which a machine reads /metrics for a user, as base64url. Errors: kNotFound;
  // kFailedPrecondition (revoked); kResourceExhausted (kScrapeTokensOfIdentityMax).
  absl::StatusOr<std::string> MakeScrapeToken(const IdentityId& id, absl::Time now,
                                              absl::Duration lifetime);
  // Its owner. Errors: kUnauthenticated: it is unknown, expired or revoked.
  absl::StatusOr<Identity> FindScrapeToken(const std::string& token, absl::Time now);

  // None if there is no such identity. Fast: queries the database only after it has changed.
  absl::StatusOr<std::optional<Identity>> Find(const IdentityId& id);
  // Ascending by kind and name.
  absl::StatusOr<std::vector<Identity>> List();

 private:
  explicit IdentityStore(std::unique_ptr<SqliteDatabase> database)
      : database_(std::move(database)), version_(database_->Prepare("PRAGMA data_version")) {}
  // Makes or lowers the identity for a token of this role.
  absl::Status PrepareForToken(const IdentityId& id, Role role);
  // UseToken within a transaction, without the check of revocations.
  absl::StatusOr<IdentityId> TakeToken(const std::string& secret, const std::string& key_sha256_hex,
                                       absl::Time now) ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);
  absl::Status Refresh() ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);
  absl::StatusOr<int64_t> Count(const std::string& query) ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);
  // Removes the tokens of a table ("tokens", "scrape_tokens") that have expired.
  absl::Status RemoveExpired(const char* table, absl::Time now)
      ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);
  // The rows of scrape_tokens of a user.
  absl::StatusOr<int64_t> CountScrapeTokens(const IdentityId& id)
      ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);

  Mutex mutex_;
  const std::unique_ptr<SqliteDatabase> database_ ABSL_PT_GUARDED_BY(mutex_);
  Statement version_ ABSL_GUARDED_BY(mutex_);
  // The identities as of the database's change number; -1: not read yet, or changed here.
  int64_t cached_version_ ABSL_GUARDED_BY(mutex_) = -1;
  std::map<IdentityId, Identity> cache_ ABSL_GUARDED_BY(mutex_);
};

}  // namespace sheaf::coordinator
