// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "coordinator/access/identity_store.h"

#include <gtest/gtest.h>

#include <atomic>
#include <filesystem>
#include <latch>
#include <thread>

#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "common/base/file.h"

namespace sheaf::coordinator {
namespace {

const absl::Time kStoreTime = absl::FromUnixSeconds(1'800'000'000);
const IdentityId kStoredUser{IdentityKind::kUser, "anna"};
const IdentityId kStoredWorker{IdentityKind::kWorker, "node7"};

class IdentityStoreTest : public ::testing::Test {
 protected:
  IdentityStoreTest()
      : directory_(::testing::TempDir() + "sheaf-identities-" +
                   ::testing::UnitTest::GetInstance()->current_test_info()->name()) {
    std::filesystem::remove_all(directory_);
    std::filesystem::create_directories(directory_);
    store_ = Open();
  }
  ~IdentityStoreTest() override { std::filesystem::remove_all(directory_); }

  std::unique_ptr<IdentityStore> Open() {
    absl::StatusOr<std::unique_ptr<IdentityStore>> store =
        IdentityStore::Open(directory_ + "/access.db");
    EXPECT_TRUE(store.ok()) << store.status();
    return store.ok() ? *std::move(store) : nullptr;
  }
  std::string Token(const IdentityId& id = kStoredUser, Role role = Role::kSubmit) {
    const absl::StatusOr<std::string> secret =
        store_->MakeToken(id, role, kStoreTime, absl::Hours(1));
    EXPECT_TRUE(secret.ok()) << secret.status();
    return secret.value_or("");
  }
  absl::StatusCode Use(const std::string& secret, const std::string& key = "a key",
                       absl::Time now = kStoreTime) {
    return store_->UseToken(secret, key, now).status().code();
  }

  const std::string directory_;
  std::unique_ptr<IdentityStore> store_;
};

TEST_F(IdentityStoreTest, ATokenSaysWhoseItIs) {
  const absl::StatusOr<Identity> user = store_->UseToken(Token(), "a key", kStoreTime);
  ASSERT_TRUE(user.ok()) << user.status();
  EXPECT_EQ(user->id, kStoredUser);
  EXPECT_EQ(user->role, Role::kSubmit);
  const absl::StatusOr<Identity> worker =
      store_->UseToken(Token(kStoredWorker, Role::kWork), "a key", kStoreTime);
  ASSERT_TRUE(worker.ok()) << worker.status();
  EXPECT_EQ(FormatIdentity(worker->id), "worker:node7");
}

TEST_F(IdentityStoreTest, ScrapeTokensAreDigestsAndEnd) {
  ASSERT_TRUE(store_->PutIdentity(kStoredUser, Role::kView).ok());
  const std::string token = *store_->MakeScrapeToken(kStoredUser, kStoreTime, absl::Hours(1));
  EXPECT_EQ(store_->FindScrapeToken(token, kStoreTime)->id, kStoredUser);
  EXPECT_EQ(Open()->FindScrapeToken(token, kStoreTime)->id, kStoredUser) << "it outlives a restart";
  EXPECT_FALSE(store_->FindScrapeToken("another", kStoreTime).ok());
  EXPECT_FALSE(store_->FindScrapeToken(token, kStoreTime + absl::Hours(1)).ok());
  for (const char* file : {"/access.db", "/access.db-wal"}) {
    EXPECT_FALSE(absl::StrContains(ReadWholeFile(directory_ + file).value_or(""), token)) << file;
  }
  for (int64_t i = 1; i < kScrapeTokensOfIdentityMax; ++i) {
    ASSERT_TRUE(store_->MakeScrapeToken(kStoredUser, kStoreTime, absl::Hours(1)).ok()) << i;
  }
  EXPECT_TRUE(absl::IsResourceExhausted(
      store_->MakeScrapeToken(kStoredUser, kStoreTime, absl::Hours(1)).status()));
  EXPECT_TRUE(
      store_->MakeScrapeToken(kStoredUser, kStoreTime + absl::Hours(2), absl::Hours(1)).ok())
      << "expired ones have gone";
  const std::string last =
      *store_->MakeScrapeToken(kStoredUser, kStoreTime + absl::Hours(2), absl::Hours(1));
  ASSERT_TRUE(store_->Revoke(kStoredUser, kStoreTime).ok());
  EXPECT_FALSE(store_->FindScrapeToken(last, kStoreTime + absl::Hours(2)).ok());
  EXPECT_TRUE(absl::IsFailedPrecondition(
      store_->MakeScrapeToken(kStoredUser, kStoreTime, absl::Hours(1)).status()));
  EXPECT_TRUE(absl::IsNotFound(
      store_->MakeScrapeToken({IdentityKind::kUser, "ben"}, kStoreTime, absl::Hours(1)).status()));
}

TEST_F(IdentityStoreTest, AReplayedTokenIsRefusedToAnotherKey) {
  const std::string secret = Token();
  EXPECT_EQ(Use(secret), absl::StatusCode::kOk);
  EXPECT_EQ(Use(secret, "a thief's key"), absl::StatusCode::kUnauthenticated);
  EXPECT_EQ(Use(secret), absl::StatusCode::kOk) << "the first answer may be lost";
}

TEST_F(IdentityStoreTest, TokensExpireAndUnknownOnesAreRefused) {
  const std::string secret = Token();
  EXPECT_EQ(Use(secret, "a key", kStoreTime + absl::Hours(1)), absl::StatusCode::kUnauthenticated);
  EXPECT_EQ(Use("no token"), absl::StatusCode::kUnauthenticated);
  EXPECT_EQ(Use(""), absl::StatusCode::kUnauthenticated);
}

TEST_F(IdentityStoreTest, OfManyConcurrentKeysOneGetsTheToken) {
  const std::string secret = Token();
  constexpr int kThieves = 16;
  std::vector<std::unique_ptr<IdentityStore>> stores;  // As of processes of their own.
  for (int i = 0; i < kThieves; ++i) stores.push_back(Open());
  std::atomic<int> enrolled{0};
  std::latch together(kThieves);
  {
    std::vector<std::jthread> threads;
    for (int i = 0; i < kThieves; ++i) {
      threads.emplace_back([&, i] {
        together.arrive_and_wait();
        if (stores[i]->UseToken(secret, absl::StrCat("key ", i), kStoreTime).ok()) ++enrolled;
      });
    }
  }
  EXPECT_EQ(enrolled, 1);
}

TEST_F(IdentityStoreTest, RevocationTakesTokensToo) {
  const std::string secret = Token();
  ASSERT_TRUE(store_->Revoke(kStoredUser, kStoreTime).ok());
  EXPECT_EQ(Use(secret), absl::StatusCode::kUnauthenticated);
  EXPECT_TRUE((*store_->Find(kStoredUser))->revoked());
  EXPECT_EQ(store_->Revoke(kStoredWorker, kStoreTime).code(), absl::StatusCode::kNotFound);
}

TEST_F(IdentityStoreTest, AnIdentityThatIsEnrolledAgainBeginsANewGeneration) {
  Token();
  Token();
  EXPECT_EQ((*store_->Find(kStoredUser))->generation, 1u) << "a second machine of the same user";
  ASSERT_TRUE(store_->Revoke(kStoredUser, kStoreTime).ok());
  Token(kStoredUser, Role::kView);
  EXPECT_EQ((*store_->Find(kStoredUser))->generation, 2u);
  EXPECT_EQ((*store_->Find(kStoredUser))->role, Role::kView);
  EXPECT_FALSE((*store_->Find(kStoredUser))->revoked());
}

TEST_F(IdentityStoreTest, AHigherRoleIsGrantedWhenItsTokenIsUsed) {
  const auto role = [&] { return (*store_->Find(kStoredUser))->role; };
  ASSERT_EQ(Use(Token(kStoredUser, Role::kView), "a laptop"), absl::StatusCode::kOk);
  const std::string higher = Token(kStoredUser, Role::kAdminister);
  EXPECT_EQ(role(), Role::kView) << "certificates of before gain nothing by a token";
  EXPECT_EQ(Use("not the token", "a laptop"), absl::StatusCode::kUnauthenticated);
  EXPECT_EQ(role(), Role::kView);
  const absl::StatusOr<Identity> used = Open()->UseToken(higher, "another", kStoreTime);
  ASSERT_TRUE(used.ok()) << used.status();
  EXPECT_EQ(used->role, Role::kAdminister);
  EXPECT_EQ(role(), Role::kAdminister);
}

TEST_F(IdentityStoreTest, ALowerRoleTakesEffectAtOnceAndForOpenTokens) {
  const auto role = [&] { return (*store_->Find(kStoredUser))->role; };
  const std::string first = Token(kStoredUser, Role::kOperate);
  ASSERT_EQ(Use(first), absl::StatusCode::kOk);
  const std::string open = Token(kStoredUser, Role::kAdminister);
  const std::string lower = Token(kStoredUser, Role::kView);
  EXPECT_EQ(role(), Role::kView);
  ASSERT_EQ(Use(open, "another"), absl::StatusCode::kOk);
  EXPECT_EQ(role(), Role::kView);
  ASSERT_EQ(Use(first), absl::StatusCode::kOk) << "the answer may be lost";
  EXPECT_EQ(role(), Role::kView) << "a used token grants nothing again";
  ASSERT_EQ(Use(lower, "a third"), absl::StatusCode::kOk);
  EXPECT_EQ(role(), Role::kView);
}

TEST_F(IdentityStoreTest, AChangeByAnotherProcessIsSeenAtTheNextCall) {
  Token();
  ASSERT_FALSE((*store_->Find(kStoredUser))->revoked());
  ASSERT_TRUE(Open()->Revoke(kStoredUser, kStoreTime).ok());
  EXPECT_TRUE((*store_->Find(kStoredUser))->revoked());
  ASSERT_TRUE(Open()->PutIdentity(kStoredWorker, Role::kWork).ok());
  EXPECT_EQ(store_->List()->size(), 2u);
}

TEST_F(IdentityStoreTest, TheSecretIsNotOnDisk) {
  const std::string secret = Token();
  store_.reset();
  for (const auto& entry : std::filesystem::directory_iterator(directory_)) {
    EXPECT_FALSE(absl::StrContains(*ReadWholeFile(entry.path().string()), secret));
  }
}

TEST_F(IdentityStoreTest, NamesAreChecked) {
  for (const std::string& name : {std::string(), std::string("local"), std::string("a b"),
                                  std::string("a/b"), std::string("a\nb"), std::string(41, 'a')}) {
    EXPECT_EQ(store_->PutIdentity({IdentityKind::kUser, name}, Role::kView).code(),
              absl::StatusCode::kInvalidArgument)
        << name;
  }
  EXPECT_EQ(ParseIdentity("user:anna")->name, "anna");
  EXPECT_FALSE(ParseIdentity("anna").ok());
}

}  // namespace
}  // namespace sheaf::coordinator
