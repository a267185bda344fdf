// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "common/tls/enrolment_token.h"

#include <vector>

#include "absl/strings/ascii.h"
#include "absl/strings/escaping.h"
#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_split.h"
#include "common/tls/certificate.h"

namespace sheaf {
namespace {

constexpr char kVersionWord[] = "sheaf1";

absl::Status MalformedToken(const std::string& why) {
  return absl::InvalidArgumentError(
      absl::StrCat("the enrolment token ", why,
                   "; give the whole line that sheaf-coordinator enroll has printed"));
}

}  // namespace

absl::StatusOr<std::string> FormatToken(const EnrolmentToken& token) {
  const absl::StatusOr<std::string> der = CertificateToDer(token.authority_pem);
  if (!der.ok()) return der.status();
  return absl::StrCat(kVersionWord, ".", absl::WebSafeBase64Escape(*der), ".",
                      absl::WebSafeBase64Escape(token.secret));
}

absl::StatusOr<EnrolmentToken> ParseToken(const std::string& text) {
  if (text.size() > kTokenBytesMax) return MalformedToken("is too long");
  const std::vector<std::string> fields =
      absl::StrSplit(absl::StripAsciiWhitespace(text), absl::ByChar('.'));
  if (fields[0] != kVersionWord) {
    return MalformedToken(absl::StartsWith(fields[0], "sheaf") ? "is of another version of Sheaf"
                                                               : "does not begin with \"sheaf1.\"");
  }
  EnrolmentToken token;
  std::string der;
  if (fields.size() != 3 || !absl::WebSafeBase64Unescape(fields[1], &der) ||
      !absl::WebSafeBase64Unescape(fields[2], &token.secret) ||
      token.secret.size() != kTokenSecretBytes) {
    return MalformedToken("is incomplete");
  }
  absl::StatusOr<std::string> authority = CertificateFromDer(der);
  if (!authority.ok()) return MalformedToken("holds no certificate");
  token.authority_pem = *std::move(authority);
  return token;
}

}  // namespace sheaf
