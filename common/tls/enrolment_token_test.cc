// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "common/tls/enrolment_token.h"

#include <gtest/gtest.h>

#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "absl/time/clock.h"
#include "common/base/secret.h"
#include "common/tls/certificate.h"

namespace sheaf {
namespace {

EnrolmentToken MakeToken() {
  CertificateTerms terms;
  terms.use = CertificateUse::kAuthority;
  terms.common_name = "a farm";
  terms.not_before = absl::Now();
  terms.not_after = absl::Now() + absl::Hours(1);
  return {RandomBytes(kTokenSecretBytes), *MakeAuthorityCertificate(terms, GenerateKey())};
}

TEST(EnrolmentTokenTest, TravelsAsOneLine) {
  const EnrolmentToken token = MakeToken();
  const std::string text = *FormatToken(token);
  EXPECT_EQ(text.find_first_of(" \n\t"), std::string::npos);
  const absl::StatusOr<EnrolmentToken> read = ParseToken(absl::StrCat("  ", text, "\n"));
  ASSERT_TRUE(read.ok()) << read.status();
  EXPECT_EQ(read->secret, token.secret);
  EXPECT_EQ(read->authority_pem, token.authority_pem);
}

TEST(EnrolmentTokenTest, DamagedTextIsRefusedWithoutTellingIt) {
  const std::string text = *FormatToken(MakeToken());
  const size_t dot = text.rfind('.');
  for (const std::string& damaged :
       {std::string(), text.substr(0, dot), text.substr(0, text.size() - 4), text + ".x",
        absl::StrCat("sheaf2", text.substr(6)), absl::StrCat("sheaf1.AAAA", text.substr(dot)),
        std::string(kTokenBytesMax + 1, 'a')}) {
    const absl::Status status = ParseToken(damaged).status();
    EXPECT_EQ(status.code(), absl::StatusCode::kInvalidArgument) << damaged.substr(0, 40);
    EXPECT_FALSE(absl::StrContains(status.message(), text.substr(dot + 1)));
  }
}

}  // namespace
}  // namespace sheaf
