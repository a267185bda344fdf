// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "coordinator/access/access_control.h"

#include <gtest/gtest.h>

#include <filesystem>

#include "absl/strings/match.h"
#include "common/base/file.h"

namespace sheaf::coordinator {
namespace {

const absl::Time kNow = absl::FromUnixSeconds(1'800'000'000);
const IdentityId kAnna{IdentityKind::kUser, "anna"};
const IdentityId kNode{IdentityKind::kWorker, "node7"};
constexpr char kGetJob[] = "/sheaf.v1.JobService/GetJob";
constexpr char kSynchronize[] = "/sheaf.v1.WorkerService/Synchronize";
constexpr char kEnroll[] = "/sheaf.v1.AccessService/Enroll";

class AccessControlTest : public ::testing::Test {
 protected:
  AccessControlTest()
      : directory_(::testing::TempDir() + "sheaf-access-" +
                   ::testing::UnitTest::GetInstance()->current_test_info()->name()) {
    std::filesystem::remove_all(directory_);
    access_ = Create(directory_);
  }
  ~AccessControlTest() override {
    access_.reset();
    std::filesystem::remove_all(directory_);
    std::filesystem::remove_all(directory_ + "-other");
  }

  static std::unique_ptr<AccessControl> Create(const std::string& directory) {
    const absl::Status created =
        CertificateAuthority::Create(AccessControl::Directory(directory), {"localhost"}, kNow);
    EXPECT_TRUE(created.ok()) << created;
    auto access = AccessControl::Open(directory);
    EXPECT_TRUE(access.ok()) << access.status();
    return access.ok() ? *std::move(access) : nullptr;
  }
  // A certificate for a new key.
  static std::string EnrolAt(AccessControl* access, const IdentityId& id, Role role) {
    const absl::StatusOr<std::string> secret =
        access->identities().MakeToken(id, role, kNow, kTokenLifetime);
    EXPECT_TRUE(secret.ok()) << secret.status();
    const auto issued =
        access->Enroll(*secret, *MakeCertificateRequest(GenerateKey()), "192.0.2.7", kNow);
    EXPECT_TRUE(issued.ok()) << issued.status();
    return issued.ok() ? issued->certificate_pem : "";
  }
  std::string Enrol(const IdentityId& id, Role role) { return EnrolAt(access_.get(), id, role); }
  absl::Status Admit(const std::string& certificate, const char* operation, absl::Time now = kNow) {
    return access_->Admit(certificate, operation, "192.0.2.7:1", now);
  }
  std::string Audit() const { return ReadWholeFile(directory_ + "/audit.log").value_or(""); }

  const std::string directory_;
  std::unique_ptr<AccessControl> access_;
};

TEST_F(AccessControlTest, AUserAndAWorkerDoWhatTheyAreFor) {
  const std::string user = Enrol(kAnna, Role::kView), worker = Enrol(kNode, Role::kWork);
  EXPECT_TRUE(Admit(user, kGetJob).ok());
  EXPECT_TRUE(Admit(worker, kSynchronize).ok());
  EXPECT_EQ(Admit(user, kSynchronize).code(), absl::StatusCode::kPermissionDenied);
  EXPECT_EQ(Admit(worker, kGetJob).code(), absl::StatusCode::kPermissionDenied);
  EXPECT_TRUE(absl::StrContains(Audit(), "user:anna at 192.0.2.7:1"));
  EXPECT_TRUE(absl::StrContains(Audit(), "worker:node7 has the role work; GetJob needs"));
}

TEST_F(AccessControlTest, WithoutACertificateOneMayOnlyEnrol) {
  for (const OperationRule& rule : RoleTable()) {
    if (rule.operation[0] != '/') continue;  // A route of the page, which sessions open.
    const bool open = Admit("", rule.operation).ok();
    EXPECT_EQ(open, rule.operation == std::string(kEnroll)) << rule.operation;
  }
  EXPECT_TRUE(absl::StrContains(Audit(), "GetJob needs a certificate"));
}

TEST_F(AccessControlTest, AnUnknownOperationIsRefusedToAdministratorsToo) {
  EXPECT_EQ(Admit(Enrol(kAnna, Role::kAdminister), "/sheaf.v1.JobService/Unknown").code(),
            absl::StatusCode::kPermissionDenied);
}

TEST_F(AccessControlTest, ExpiredCertificatesAreRefused) {
  const std::string worker = Enrol(kNode, Role::kWork), user = Enrol(kAnna, Role::kView);
  EXPECT_TRUE(Admit(worker, kSynchronize, kNow + absl::Hours(23)).ok());
  EXPECT_EQ(Admit(worker, kSynchronize, kNow + absl::Hours(25)).code(),
            absl::StatusCode::kUnauthenticated)
      << "though its signature is remembered as verified";
  EXPECT_EQ(Admit(user, kGetJob, kNow + absl::Hours(24 * 8)).code(),
            absl::StatusCode::kUnauthenticated);
  EXPECT_TRUE(Admit(worker, kEnroll, kNow + absl::Hours(25)).ok()) << "it may enrol again";
}

TEST_F(AccessControlTest, RevokedCertificatesAreRefusedAndStaySoAfterANewEnrolment) {
  const std::string lost = Enrol(kAnna, Role::kView);
  EXPECT_TRUE(Admit(lost, kGetJob).ok());
  ASSERT_TRUE(access_->identities().Revoke(kAnna, kNow).ok());
  EXPECT_EQ(Admit(lost, kGetJob).code(), absl::StatusCode::kUnauthenticated);
  const std::string next = Enrol(kAnna, Role::kView);
  EXPECT_TRUE(Admit(next, kGetJob).ok());
  EXPECT_EQ(Admit(lost, kGetJob).code(), absl::StatusCode::kUnauthenticated);
  EXPECT_TRUE(absl::StrContains(Audit(), "user:anna is revoked"));
}

TEST_F(AccessControlTest, AnotherFarmsCertificatesAreRefused) {
  const auto other = Create(directory_ + "-other");
  EXPECT_EQ(Admit(EnrolAt(other.get(), kAnna, Role::kAdminister), kGetJob).code(),
            absl::StatusCode::kUnauthenticated);
  Enrol(kAnna, Role::kAdminister);  // The same name here changes nothing.
  EXPECT_EQ(Admit(EnrolAt(other.get(), kAnna, Role::kAdminister), kGetJob).code(),
            absl::StatusCode::kUnauthenticated);
  EXPECT_EQ(Admit("not a certificate", kGetJob).code(), absl::StatusCode::kUnauthenticated);
}

TEST_F(AccessControlTest, AMalformedRequestLeavesTheTokenForTheNextTry) {
  const std::string secret =
      *access_->identities().MakeToken(kAnna, Role::kView, kNow, kTokenLifetime);
  EXPECT_EQ(access_->Enroll(secret, "no request", "192.0.2.7", kNow).status().code(),
            absl::StatusCode::kInvalidArgument);
  EXPECT_TRUE(
      access_->Enroll(secret, *MakeCertificateRequest(GenerateKey()), "192.0.2.7", kNow).ok());
}

TEST_F(AccessControlTest, RenewalPutsTheEndOff) {
  const Caller caller = *access_->Authenticate(Enrol(kNode, Role::kWork), kNow);
  const absl::Time later = kNow + absl::Hours(16);
  const auto renewed = access_->Renew(caller, *MakeCertificateRequest(GenerateKey()), later);
  ASSERT_TRUE(renewed.ok()) << renewed.status();
  EXPECT_TRUE(Admit(renewed->certificate_pem, kSynchronize, kNow + absl::Hours(39)).ok());
}

TEST_F(AccessControlTest, JobsBelongToWhoSubmittedThem) {
  const auto caller = [&](const IdentityId& id, Role role) {
    return *access_->Authenticate(Enrol(id, role), kNow);
  };
  const Caller anna = caller(kAnna, Role::kSubmit);
  EXPECT_TRUE(AccessControl::AuthorizeJob(anna, "anna").ok());
  EXPECT_EQ(AccessControl::AuthorizeJob(anna, "ben").code(), absl::StatusCode::kPermissionDenied);
  EXPECT_EQ(AccessControl::AuthorizeJob(anna, "local").code(), absl::StatusCode::kPermissionDenied);
  const Caller operator_caller = caller({IdentityKind::kUser, "olga"}, Role::kOperate);
  EXPECT_TRUE(AccessControl::AuthorizeJob(operator_caller, "anna").ok());
  // A worker does not own what a user of its name has submitted.
  const Caller worker = caller({IdentityKind::kWorker, "anna"}, Role::kWork);
  EXPECT_FALSE(AccessControl::AuthorizeJob(worker, "anna").ok());
  EXPECT_FALSE(AccessControl::AuthorizeJob(Caller{}, "").ok());
}

TEST(RoleTableTest, RolesIncludeLowerOnes) {
  using enum Requirement;
  const Role users[] = {Role::kView, Role::kSubmit, Role::kOperate, Role::kAdminister};
  const Requirement required[] = {kView, kSubmit, kOperate, kAdminister};
  for (int role = 0; role < 4; ++role) {
    for (int need = 0; need < 4; ++need) {
      EXPECT_EQ(Permits(required[need], users[role]), role >= need);
    }
    EXPECT_FALSE(Permits(kWork, users[role]));
    EXPECT_TRUE(Permits(kIdentity, users[role]));
    EXPECT_EQ(UserRoleFromName(RoleName(users[role])), users[role]);
  }
  for (const Requirement user_only : required) EXPECT_FALSE(Permits(user_only, Role::kWork));
  EXPECT_TRUE(Permits(kWorkOrOperate, Role::kWork));
  EXPECT_FALSE(Permits(kWorkOrOperate, Role::kSubmit));
  EXPECT_TRUE(Permits(kWorkOrOperate, Role::kOperate));
  EXPECT_FALSE(UserRoleFromName("work"));
}

}  // namespace
}  // namespace sheaf::coordinator
