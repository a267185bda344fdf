// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "coordinator/access/certificate_authority.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/stat.h>

#include <filesystem>

#include "common/base/file.h"

namespace sheaf::coordinator {
namespace {

using ::testing::Contains;

const absl::Time kIssueTime = absl::FromUnixSeconds(1'800'000'000);

class CertificateAuthorityTest : public ::testing::Test {
 protected:
  CertificateAuthorityTest()
      : directory_(::testing::TempDir() + "sheaf-authority-" +
                   ::testing::UnitTest::GetInstance()->current_test_info()->name()) {
    std::filesystem::remove_all(directory_);
  }
  ~CertificateAuthorityTest() override { std::filesystem::remove_all(directory_); }

  std::unique_ptr<CertificateAuthority> Create(const std::vector<std::string>& hosts) {
    const absl::Status created = CertificateAuthority::Create(directory_, hosts, kIssueTime);
    EXPECT_TRUE(created.ok()) << created;
    auto authority = CertificateAuthority::Open(directory_);
    EXPECT_TRUE(authority.ok()) << authority.status();
    return authority.ok() ? *std::move(authority) : nullptr;
  }
  static std::string ServerCertificate(const CertificateAuthority& authority) {
    return *ReadWholeFile(authority.server_files().certificate_path);
  }

  const std::string directory_;
};

TEST_F(CertificateAuthorityTest, CertifiesItsServer) {
  EXPECT_FALSE(CertificateAuthority::Exists(directory_));
  const auto authority = Create({"farm.example.org", "192.0.2.7"});
  ASSERT_NE(authority, nullptr);
  EXPECT_TRUE(CertificateAuthority::Exists(directory_));
  const std::string pem = ServerCertificate(*authority);
  EXPECT_TRUE(
      VerifyCertificate(pem, CertificateUse::kServer, authority->certificate_pem(), kIssueTime)
          .ok());
  EXPECT_THAT(ReadCertificate(pem)->hosts, Contains("192.0.2.7"));
}

TEST_F(CertificateAuthorityTest, OnlyItsOwnerReadsIt) {
  Create({"localhost"});
  struct stat info {};
  for (const auto& entry : std::filesystem::directory_iterator(directory_)) {
    ASSERT_EQ(::stat(entry.path().c_str(), &info), 0);
    EXPECT_EQ(info.st_mode & 0777, 0600u) << entry.path();
  }
  ASSERT_EQ(::stat(directory_.c_str(), &info), 0);
  EXPECT_EQ(info.st_mode & 0777, 0700u);
}

TEST_F(CertificateAuthorityTest, AFurtherHostKeepsTheAuthority) {
  const std::string before = Create({"a.example.org"})->certificate_pem();
  const auto authority = Create({"b.example.org"});
  EXPECT_EQ(authority->certificate_pem(), before);
  const std::vector<std::string> hosts = ReadCertificate(ServerCertificate(*authority))->hosts;
  EXPECT_THAT(hosts, Contains("a.example.org"));
  EXPECT_THAT(hosts, Contains("b.example.org"));
}

TEST_F(CertificateAuthorityTest, RenewsItsServerInTime) {
  const auto authority = Create({"localhost"});
  EXPECT_FALSE(*authority->RenewServerCertificate(kIssueTime + kServerLifetime * 0.4));
  EXPECT_TRUE(*authority->RenewServerCertificate(kIssueTime + kServerLifetime * 0.6));
  EXPECT_EQ(ReadCertificate(ServerCertificate(*authority))->not_after,
            kIssueTime + kServerLifetime * 1.6);
  EXPECT_EQ(authority->ServerExpiry(), kIssueTime + kServerLifetime * 1.6);
  EXPECT_EQ(authority->Expiry(), kIssueTime + kAuthorityLifetime);
  std::filesystem::remove(authority->server_files().certificate_path);
  EXPECT_EQ(authority->ServerExpiry(), absl::UnixEpoch()) << "as if it had ended";
}

TEST_F(CertificateAuthorityTest, ReplacesAServerCertificateThatHasYetToBegin) {
  const auto authority = Create({"localhost"});  // While the clock is ahead.
  const absl::Time right = kIssueTime - absl::Hours(24);
  EXPECT_TRUE(*authority->RenewServerCertificate(right));
  EXPECT_LT(ReadCertificate(ServerCertificate(*authority))->not_before, right);
  EXPECT_FALSE(*authority->RenewServerCertificate(right));
}

TEST_F(CertificateAuthorityTest, IssuesToIdentities) {
  const auto authority = Create({"localhost"});
  Identity identity;
  identity.id = {IdentityKind::kWorker, "node7"};
  identity.generation = 2;
  const absl::StatusOr<std::string> pem = authority->IssueClientCertificate(
      identity, *MakeCertificateRequest(GenerateKey()), kIssueTime, absl::Hours(24));
  ASSERT_TRUE(pem.ok()) << pem.status();
  EXPECT_TRUE(
      VerifyCertificate(*pem, CertificateUse::kClient, authority->certificate_pem(), kIssueTime)
          .ok());
  EXPECT_EQ(ReadCertificate(*pem)->common_name, "worker:node7");
  EXPECT_EQ(ReadCertificate(*pem)->generation, 2u);
}

TEST_F(CertificateAuthorityTest, RefusesHostsThatAreNoNames) {
  for (const std::string& host :
       {std::string(), std::string("a,DNS:b"), std::string("a b"), std::string(300, 'a')}) {
    EXPECT_EQ(CertificateAuthority::Create(directory_, {host}, kIssueTime).code(),
              absl::StatusCode::kInvalidArgument);
  }
  EXPECT_FALSE(CertificateAuthority::Exists(directory_));
}

TEST_F(CertificateAuthorityTest, SaysThatItIsDamaged) {
  Create({"localhost"});
  ASSERT_TRUE(WriteFileOnce(directory_ + "/authority.key", "").ok());
  EXPECT_EQ(CertificateAuthority::Open(directory_).status().code(),
            absl::StatusCode::kFailedPrecondition);
}

TEST(HostsOfThisMachineTest, AreReachable) {
  const std::vector<std::string> hosts = HostsOfThisMachine();
  EXPECT_THAT(hosts, Contains("localhost"));
  EXPECT_THAT(hosts, Contains("127.0.0.1"));
}

}  // namespace
}  // namespace sheaf::coordinator
