// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "common/tls/credential_store.h"

#include <gtest/gtest.h>
#include <sys/stat.h>

#include <filesystem>

#include "absl/time/clock.h"
#include "common/base/file.h"
#include "common/base/surroundings/local_time.h"

namespace sheaf {
namespace {

Credentials MakeCredentials(const std::string& certificate) {
  CertificateTerms terms;
  terms.use = CertificateUse::kAuthority;
  terms.common_name = "a farm";
  terms.not_before = absl::Now();
  terms.not_after = absl::Now() + absl::Hours(1);
  return {"a key", certificate, *MakeAuthorityCertificate(terms, GenerateKey())};
}

class CredentialStoreTest : public ::testing::Test {
 protected:
  CredentialStoreTest()
      : directory_(::testing::TempDir() + "sheaf-credentials-" +
                   ::testing::UnitTest::GetInstance()->current_test_info()->name()),
        store_(directory_) {
    std::filesystem::remove_all(directory_);
  }
  ~CredentialStoreTest() override { std::filesystem::remove_all(directory_); }

  std::string CertificateFor(const std::string& address) {
    const std::optional<CredentialFiles> files = store_.Find(address);
    return files ? *ReadWholeFile(files->certificate_path) : "";
  }

  const std::string directory_;
  const CredentialStore store_;
};

TEST_F(CredentialStoreTest, FindsByAddress) {
  EXPECT_FALSE(store_.Find("a:1"));
  ASSERT_TRUE(store_.Put(MakeCredentials("first"), {"a:1", "b:1"}).ok());
  ASSERT_TRUE(store_.Put(MakeCredentials("second"), {"c:1"}).ok());
  EXPECT_EQ(CertificateFor("a:1"), "first");
  EXPECT_EQ(CertificateFor("b:1"), "first");
  EXPECT_EQ(CertificateFor("c:1"), "second");
  EXPECT_FALSE(store_.Find("a:2"));
}

TEST_F(CredentialStoreTest, WithoutADirectoryNothingIsFoundOrKept) {
  const CredentialStore none("");
  EXPECT_FALSE(none.Find("a:1"));
  const absl::Status status = none.Put(MakeCredentials("first"), {"a:1"}).status();
  EXPECT_TRUE(absl::IsFailedPrecondition(status)) << status;
  EXPECT_NE(status.message().find("set HOME"), std::string::npos) << status;
}

TEST_F(CredentialStoreTest, ANewCoordinatorAtAnAddressReplacesTheOld) {
  ASSERT_TRUE(store_.Put(MakeCredentials("old"), {"a:1", "b:1"}).ok());
  ASSERT_TRUE(store_.Put(MakeCredentials("new"), {"a:1"}).ok());
  EXPECT_EQ(CertificateFor("a:1"), "new");
  EXPECT_EQ(CertificateFor("b:1"), "old");
}

TEST_F(CredentialStoreTest, NobodyElseReadsKeys) {
  const absl::StatusOr<CredentialFiles> files = store_.Put(MakeCredentials("c"), {"a:1"});
  ASSERT_TRUE(files.ok()) << files.status();
  for (const std::string& path :
       {files->key_path, files->certificate_path, files->authority_path}) {
    struct stat info {};
    ASSERT_EQ(::stat(path.c_str(), &info), 0);
    EXPECT_EQ(info.st_mode & 0777, 0600u) << path;
  }
  struct stat info {};
  ASSERT_EQ(::stat(directory_.c_str(), &info), 0);
  EXPECT_EQ(info.st_mode & 0777, 0700u);
}

TEST_F(CredentialStoreTest, LifeGoesFromZeroToOne) {
  CertificateTerms terms;
  terms.not_before = absl::FromUnixSeconds(1000);
  terms.not_after = absl::FromUnixSeconds(2000);
  EXPECT_DOUBLE_EQ(LifeFraction(terms, absl::FromUnixSeconds(1000)), 0);
  EXPECT_DOUBLE_EQ(LifeFraction(terms, absl::FromUnixSeconds(1500)), 0.5);
  EXPECT_DOUBLE_EQ(LifeFraction(terms, absl::FromUnixSeconds(3000)), 2);
  EXPECT_DOUBLE_EQ(LifeFraction(terms, absl::FromUnixSeconds(0)), -1);
}

TEST_F(CredentialStoreTest, ClocksThatAreFarBehindAreNamed) {
  CertificateTerms terms;
  terms.common_name = "user:anna";
  terms.not_before = absl::FromCivil(absl::CivilDay(2026, 5, 4), LocalZone());
  terms.not_after = terms.not_before + absl::Hours(24 * 90);
  for (const absl::Duration late :
       {absl::ZeroDuration(), -absl::Minutes(59), absl::Hours(10'000)}) {
    EXPECT_EQ(WhyNotYetValid(terms, terms.not_before + late), "");
  }
  EXPECT_EQ(WhyNotYetValid(terms, terms.not_before - absl::Hours(24)),
            "the certificate of user:anna is not valid before 2026-05-04 00:00, and the clock of "
            "this machine says 2026-05-03 00:00: set the clock, otherwise calls are refused");
}

}  // namespace
}  // namespace sheaf
