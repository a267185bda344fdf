// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "coordinator/access/identity_store.h"

#include <utility>

#include "absl/strings/escaping.h"
#include "absl/strings/str_cat.h"
#include "common/base/digest.h"
#include "common/base/log.h"
#include "common/base/secret.h"
#include "common/tls/enrolment_token.h"
#include "coordinator/store/stored_times.h"

namespace sheaf::coordinator {
namespace {

constexpr char kIdentitySchema[] = R"sql(
CREATE TABLE IF NOT EXISTS identities(
  kind INTEGER NOT NULL, name TEXT NOT NULL, role INTEGER NOT NULL, generation INTEGER NOT NULL,
  revoked_ns INTEGER NOT NULL, PRIMARY KEY(kind, name)) WITHOUT ROWID;
CREATE TABLE IF NOT EXISTS tokens(
  secret_sha256 TEXT PRIMARY KEY, kind INTEGER NOT NULL, name TEXT NOT NULL,
  expire_ns INTEGER NOT NULL, used_ns INTEGER NOT NULL, key_sha256 TEXT NOT NULL,
  role INTEGER NOT NULL) WITHOUT ROWID;
CREATE TABLE IF NOT EXISTS scrape_tokens(
  secret_sha256 TEXT PRIMARY KEY, kind INTEGER NOT NULL, name TEXT NOT NULL,
  expire_ns INTEGER NOT NULL) WITHOUT ROWID;
)sql";
constexpr char kUnused[] = "";  // key_sha256 of an unused token.

int64_t Stored(IdentityKind kind) { return static_cast<int64_t>(kind); }

}  // namespace

absl::StatusOr<std::unique_ptr<IdentityStore>> IdentityStore::Open(const std::string& path) {
  absl::StatusOr<std::unique_ptr<SqliteDatabase>> database = SqliteDatabase::Open(path);
  if (!database.ok()) return database.status();
  if (const int64_t lost = (*database)->LostCommits(); lost > 0) {
    LogError(absl::StrCat(path, "-wal: bits changed in the log of the database. Up to ", lost,
                          " of the last enrolments and revocations are lost: repeat them, and "
                          "check the disk"));
  }
  if (absl::Status status = (*database)->Execute(kIdentitySchema); !status.ok()) return status;
  return std::unique_ptr<IdentityStore>(new IdentityStore(*std::move(database)));
}

absl::StatusOr<int64_t> IdentityStore::Count(const std::string& query) {
  Statement statement = database_->Prepare(query);
  const absl::StatusOr<bool> row = statement.Step();
  if (!row.ok()) return row.status();
  return statement.Int64(0);
}

absl::Status IdentityStore::PutIdentity(const IdentityId& id, Role role) {
  if (absl::Status status = CheckIdentityName(id.name); !status.ok()) return status;
  const MutexLock lock(&mutex_);
  const absl::StatusOr<int64_t> count = Count("SELECT COUNT(*) FROM identities");
  if (!count.ok()) return count.status();
  if (*count >= kIdentitiesMax) {
    return absl::ResourceExhaustedError(
        absl::StrCat("the farm has ", *count, " identities, its limit"));
  }
  cached_version_ = -1;
  // In an ON CONFLICT clause, plain column names are the values before the change.
  return database_
      ->Prepare(
          "INSERT INTO identities(kind, name, role, generation, revoked_ns) VALUES(?,?,?,1,?) "
          "ON CONFLICT(kind, name) DO UPDATE SET role = excluded.role, "
          "generation = generation + (revoked_ns <> excluded.revoked_ns), "
          "revoked_ns = excluded.revoked_ns")
      .Bind(Stored(id.kind))
      .Bind(id.name)
      .Bind(static_cast<int64_t>(role))
      .Bind(ToNanoseconds(absl::InfiniteFuture()))
      .Run();
}

absl::Status IdentityStore::PrepareForToken(const IdentityId& id, Role role) {
  const absl::StatusOr<std::optional<Identity>> present = Find(id);
  if (!present.ok()) return present.status();
  const bool is_active = present->has_value() && !(*present)->revoked();
  if (!is_active || role < (*present)->role) {
    if (absl::Status status = PutIdentity(id, role); !status.ok()) return status;
  }
  const MutexLock lock(&mutex_);
  return database_
      ->Prepare(
          "UPDATE tokens SET role = ? WHERE kind = ? AND name = ? AND key_sha256 = ? AND role > ?")
      .Bind(static_cast<int64_t>(role))
      .Bind(Stored(id.kind))
      .Bind(id.name)
      .Bind(kUnused)
      .Bind(static_cast<int64_t>(role))
      .Run();
}

absl::StatusOr<std::string> IdentityStore::MakeToken(const IdentityId& id, Role role,
                                                     absl::Time now, absl::Duration lifetime) {
  if (absl::Status status = PrepareForToken(id, role); !status.ok()) return status;
  const MutexLock lock(&mutex_);
  if (absl::Status removed = RemoveExpired("tokens", now); !removed.ok()) return removed;
  const absl::StatusOr<int64_t> count = Count("SELECT COUNT(*) FROM tokens");
  if (!count.ok()) return count.status();
  if (*count >= kOpenTokensMax) {
    return absl::ResourceExhaustedError(
        absl::StrCat(*count, " enrolment tokens are open, the limit; wait until they expire"));
  }
  std::string secret = RandomBytes(kTokenSecretBytes);
  absl::Status added =
      database_
          ->Prepare(
              "INSERT INTO tokens(secret_sha256, kind, name, expire_ns, used_ns, key_sha256, role) "
              "VALUES(?,?,?,?,0,?,?)")
          .Bind(Sha256Hex(secret))
          .Bind(Stored(id.kind))
          .Bind(id.name)
          .Bind(ToNanoseconds(now + lifetime))
          .Bind(kUnused)
          .Bind(static_cast<int64_t>(role))
          .Run();
  if (!added.ok()) return added;
  return secret;
}

absl::Status IdentityStore::Revoke(const IdentityId& id, absl::Time now) {
  const MutexLock lock(&mutex_);
  cached_version_ = -1;
  Statement revoke = database_->Prepare(
      "UPDATE identities SET revoked_ns = MIN(revoked_ns, ?) WHERE kind = ? AND name = ? "
      "RETURNING name");
  const absl::StatusOr<bool> found =
      revoke.Bind(ToNanoseconds(now)).Bind(Stored(id.kind)).Bind(id.name).Step();
  if (!found.ok()) return found.status();
  if (!*found) {
    return absl::NotFoundError(absl::StrCat("there is no ", FormatIdentity(id),
                                            "; sheaf-coordinator identities lists all"));
  }
  if (absl::Status status = revoke.Run(); !status.ok()) return status;
  for (const char* table : {"tokens", "scrape_tokens"}) {
    absl::Status removed =
        database_->Prepare(absl::StrCat("DELETE FROM ", table, " WHERE kind = ? AND name = ?"))
            .Bind(Stored(id.kind))
            .Bind(id.name)
            .Run();
    if (!removed.ok()) return removed;
  }
  return absl::OkStatus();
}

absl::StatusOr<IdentityId> IdentityStore::TakeToken(const std::string& secret,
                                                    const std::string& key_sha256_hex,
                                                    absl::Time now) {
  // The transaction excludes other processes: of several callers at most one key gets the token.
  Statement find = database_->Prepare(
      "SELECT kind, name, key_sha256, role FROM tokens "
      "WHERE secret_sha256 = ? AND expire_ns > ? AND key_sha256 IN (?, ?)");
  const absl::StatusOr<bool> usable = find.Bind(Sha256Hex(secret))
                                          .Bind(ToNanoseconds(now))
                                          .Bind(kUnused)
                                          .Bind(key_sha256_hex)
                                          .Step();
  if (!usable.ok()) return usable.status();
  if (!*usable) {
    return absl::UnauthenticatedError(
        "the enrolment token is unknown, used, expired or revoked; an administrator makes "
        "another with sheaf-coordinator enroll");
  }
  const IdentityId id{static_cast<IdentityKind>(find.Int64(0)), find.Text(1)};
  const bool is_first = find.Text(2) == kUnused;
  const int64_t role = find.Int64(3);
  if (absl::Status status = find.Run(); !status.ok()) return status;
  if (!is_first) return id;
  absl::Status used =
      database_->Prepare("UPDATE tokens SET used_ns = ?, key_sha256 = ? WHERE secret_sha256 = ?")
          .Bind(ToNanoseconds(now))
          .Bind(key_sha256_hex)
          .Bind(Sha256Hex(secret))
          .Run();
  if (!used.ok()) return used;
  cached_version_ = -1;
  // A token never lowers a role: a token with a higher role may have been used since.
  used = database_->Prepare("UPDATE identities SET role = MAX(role, ?) WHERE kind = ? AND name = ?")
             .Bind(role)
             .Bind(Stored(id.kind))
             .Bind(id.name)
             .Run();
  if (!used.ok()) return used;
  return id;
}

absl::StatusOr<Identity> IdentityStore::UseToken(const std::string& secret,
                                                 const std::string& key_sha256_hex,
                                                 absl::Time now) {
  absl::StatusOr<IdentityId> id;
  {
    const MutexLock lock(&mutex_);
    absl::Status status = database_->InTransaction([&]() ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_) {
      id = TakeToken(secret, key_sha256_hex, now);
      return id.status();
    });
    if (!status.ok()) return status;
  }
  const absl::StatusOr<std::optional<Identity>> identity = Find(*id);
  if (!identity.ok()) return identity.status();
  if (!identity->has_value() || (*identity)->revoked()) {
    return absl::UnauthenticatedError(absl::StrCat(FormatIdentity(*id), " is revoked"));
  }
  return **identity;
}

absl::Status IdentityStore::RemoveExpired(const char* table, absl::Time now) {
  return database_->Prepare(absl::StrCat("DELETE FROM ", table, " WHERE expire_ns < ?"))
      .Bind(ToNanoseconds(now))
      .Run();
}

absl::StatusOr<int64_t> IdentityStore::CountScrapeTokens(const IdentityId& id) {
  Statement statement =
      database_->Prepare("SELECT COUNT(*) FROM scrape_tokens WHERE kind = ? AND name = ?");
  const absl::StatusOr<bool> row = statement.Bind(Stored(id.kind)).Bind(id.name).Step();
  if (!row.ok()) return row.status();
  return statement.Int64(0);
}

absl::StatusOr<std::string> IdentityStore::MakeScrapeToken(const IdentityId& id, absl::Time now,
                                                           absl::Duration lifetime) {
  const absl::StatusOr<std::optional<Identity>> identity = Find(id);
  if (!identity.ok()) return identity.status();
  if (!identity->has_value()) {
    return absl::NotFoundError(absl::StrCat("there is no ", FormatIdentity(id)));
  }
  if ((*identity)->revoked()) {
    return absl::FailedPreconditionError(
        absl::StrCat(FormatIdentity(id), " is revoked; enrol it again, or choose another name"));
  }
  const MutexLock lock(&mutex_);
  if (absl::Status removed = RemoveExpired("scrape_tokens", now); !removed.ok()) return removed;
  const absl::StatusOr<int64_t> count = CountScrapeTokens(id);
  if (!count.ok()) return count.status();
  if (*count >= kScrapeTokensOfIdentityMax) {
    return absl::ResourceExhaustedError(
        absl::StrCat(FormatIdentity(id), " has ", *count,
                     " scrape tokens, the limit; revoke the user and enrol it again, or use "
                     "another name"));
  }
  std::string token = absl::WebSafeBase64Escape(RandomBytes(kTokenSecretBytes));
  absl::Status added =
      database_
          ->Prepare(
              "INSERT INTO scrape_tokens(secret_sha256, kind, name, expire_ns) VALUES(?,?,?,?)")
          .Bind(Sha256Hex(token))
          .Bind(Stored(id.kind))
          .Bind(id.name)
          .Bind(ToNanoseconds(now + lifetime))
          .Run();
  if (!added.ok()) return added;
  return token;
}

absl::StatusOr<Identity> IdentityStore::FindScrapeToken(const std::string& token, absl::Time now) {
  const absl::Status unknown = absl::UnauthenticatedError(
      "the scrape token is unknown, expired or revoked; an administrator makes another with "
      "sheaf-coordinator scraper");
  IdentityId id;
  {
    const MutexLock lock(&mutex_);
    Statement find = database_->Prepare(
        "SELECT kind, name FROM scrape_tokens WHERE secret_sha256 = ? AND expire_ns > ?");
    const absl::StatusOr<bool> found = find.Bind(Sha256Hex(token)).Bind(ToNanoseconds(now)).Step();
    if (!found.ok()) return found.status();
    if (!*found) return unknown;
    id = {static_cast<IdentityKind>(find.Int64(0)), find.Text(1)};
  }
  const absl::StatusOr<std::optional<Identity>> identity = Find(id);
  if (!identity.ok()) return identity.status();
  // Revoke removes the token, and another process may be between its two steps.
  if (!identity->has_value() || (*identity)->revoked()) return unknown;
  return **identity;
}

absl::Status IdentityStore::Refresh() {
  const absl::StatusOr<bool> row = version_.Step();
  if (!row.ok()) return row.status();
  const int64_t version = version_.Int64(0);
  if (absl::Status status = version_.Run(); !status.ok()) return status;
  if (version == cached_version_) return absl::OkStatus();
  std::map<IdentityId, Identity> read;
  Statement query =
      database_->Prepare("SELECT kind, name, role, generation, revoked_ns FROM identities");
  while (true) {
    const absl::StatusOr<bool> there = query.Step();
    if (!there.ok()) return there.status();
    if (!*there) break;
    Identity identity;
    identity.id = {static_cast<IdentityKind>(query.Int64(0)), query.Text(1)};
    identity.role = static_cast<Role>(query.Int64(2));
    identity.generation = static_cast<uint64_t>(query.Int64(3));
    identity.revoked_time = FromNanoseconds(query.Int64(4));
    read[identity.id] = std::move(identity);
  }
  cache_ = std::move(read);
  cached_version_ = version;
  return absl::OkStatus();
}

absl::StatusOr<std::optional<Identity>> IdentityStore::Find(const IdentityId& id) {
  const MutexLock lock(&mutex_);
  if (absl::Status status = Refresh(); !status.ok()) return status;
  const auto found = cache_.find(id);
  if (found == cache_.end()) return std::nullopt;
  return found->second;
}

absl::StatusOr<std::vector<Identity>> IdentityStore::List() {
  const MutexLock lock(&mutex_);
  if (absl::Status status = Refresh(); !status.ok()) return status;
  std::vector<Identity> identities;
  for (const auto& [id, identity] : cache_) identities.push_back(identity);
  return identities;
}

}  // namespace sheaf::coordinator
