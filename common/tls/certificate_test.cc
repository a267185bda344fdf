// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "common/tls/certificate.h"

#include <gtest/gtest.h>

namespace sheaf {
namespace {

const absl::Time kNow = absl::FromUnixSeconds(1'800'000'000);

Issuer MakeIssuer() {
  Issuer issuer;
  issuer.key_pem = GenerateKey();
  CertificateTerms terms;
  terms.use = CertificateUse::kAuthority;
  terms.common_name = "an authority";
  terms.not_before = kNow - absl::Hours(1);
  terms.not_after = kNow + absl::Hours(1000);
  issuer.certificate_pem = *MakeAuthorityCertificate(terms, issuer.key_pem);
  return issuer;
}

CertificateTerms ClientTerms() {
  CertificateTerms terms;
  terms.common_name = "user:anna";
  terms.generation = 3;
  terms.not_before = kNow;
  terms.not_after = kNow + absl::Hours(24);
  return terms;
}

std::string RequestOfNewKey() { return *MakeCertificateRequest(GenerateKey()); }

TEST(CertificateTest, StatesTheTermsUnderWhichItWasIssued) {
  const absl::StatusOr<std::string> pem =
      IssueCertificate(ClientTerms(), RequestOfNewKey(), MakeIssuer());
  ASSERT_TRUE(pem.ok()) << pem.status();
  const absl::StatusOr<CertificateTerms> terms = ReadCertificate(*pem);
  ASSERT_TRUE(terms.ok()) << terms.status();
  EXPECT_EQ(terms->use, CertificateUse::kClient);
  EXPECT_EQ(terms->common_name, "user:anna");
  EXPECT_EQ(terms->generation, 3u);
  EXPECT_EQ(terms->not_before, kNow);
  EXPECT_EQ(terms->not_after, kNow + absl::Hours(24));
  EXPECT_EQ(*CertificateFromDer(*CertificateToDer(*pem)), *pem);
}

TEST(CertificateTest, ServerNamesAndAddressesAreKept) {
  CertificateTerms terms = ClientTerms();
  terms.use = CertificateUse::kServer;
  terms.hosts = {"farm.example.org", "192.0.2.7", "2001:db8::1"};
  const absl::StatusOr<std::string> pem = IssueCertificate(terms, RequestOfNewKey(), MakeIssuer());
  ASSERT_TRUE(pem.ok()) << pem.status();
  const std::vector<std::string> read = ReadCertificate(*pem)->hosts;
  EXPECT_EQ(read,
            (std::vector<std::string>{"farm.example.org", "192.0.2.7", "2001:db8:0:0:0:0:0:1"}));
  EXPECT_EQ(ReadCertificate(*pem)->use, CertificateUse::kServer);
}

TEST(CertificateTest, IsValidForItsUseItsAuthorityAndItsTime) {
  const Issuer issuer = MakeIssuer();
  const std::string pem = *IssueCertificate(ClientTerms(), RequestOfNewKey(), issuer);
  const auto verify = [&](CertificateUse use, const Issuer& of, absl::Time time) {
    return VerifyCertificate(pem, use, of.certificate_pem, time).code();
  };
  EXPECT_EQ(verify(CertificateUse::kClient, issuer, kNow), absl::StatusCode::kOk);
  EXPECT_EQ(verify(CertificateUse::kServer, issuer, kNow), absl::StatusCode::kUnauthenticated);
  EXPECT_EQ(verify(CertificateUse::kClient, MakeIssuer(), kNow),
            absl::StatusCode::kUnauthenticated);
  EXPECT_EQ(verify(CertificateUse::kClient, issuer, kNow + absl::Hours(25)),
            absl::StatusCode::kUnauthenticated);
  EXPECT_EQ(verify(CertificateUse::kClient, issuer, kNow - absl::Hours(1)),
            absl::StatusCode::kUnauthenticated);
}

TEST(CertificateTest, AHolderIssuesNothing) {
  const Issuer issuer = MakeIssuer();
  Issuer holder;
  holder.key_pem = GenerateKey();
  holder.certificate_pem =
      *IssueCertificate(ClientTerms(), *MakeCertificateRequest(holder.key_pem), issuer);
  const std::string forged = *IssueCertificate(ClientTerms(), RequestOfNewKey(), holder);
  EXPECT_EQ(VerifyCertificate(forged, CertificateUse::kClient, issuer.certificate_pem, kNow).code(),
            absl::StatusCode::kUnauthenticated);
}

TEST(CertificateTest, ARequestProvesPossessionOfItsKey) {
  const std::string key = GenerateKey();
  const std::string request = *MakeCertificateRequest(key);
  EXPECT_EQ(*CheckCertificateRequest(request),
            *CheckCertificateRequest(*MakeCertificateRequest(key)));
  EXPECT_NE(*CheckCertificateRequest(request), *CheckCertificateRequest(RequestOfNewKey()));
  // A changed signature, and texts that are not requests.
  std::string changed = request;
  const size_t last = changed.rfind("\n-----END") - 8;
  changed[last] = changed[last] == 'A' ? 'B' : 'A';
  for (const std::string& text :
       {changed, std::string("a request"), std::string(), std::string(kPemBytesMax + 1, 'x')}) {
    EXPECT_EQ(CheckCertificateRequest(text).status().code(), absl::StatusCode::kInvalidArgument);
  }
}

TEST(CertificateTest, TextThatIsNoCertificateIsRefused) {
  for (const std::string& text : {std::string("x"), std::string(), GenerateKey()}) {
    EXPECT_EQ(ReadCertificate(text).status().code(), absl::StatusCode::kInvalidArgument);
    EXPECT_EQ(CertificateToDer(text).status().code(), absl::StatusCode::kInvalidArgument);
    EXPECT_EQ(CertificateFromDer(text).status().code(), absl::StatusCode::kInvalidArgument);
  }
}

}  // namespace
}  // namespace sheaf
