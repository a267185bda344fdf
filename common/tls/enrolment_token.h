// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Enrolment tokens: one line of text that a user carries from the coordinator to a new machine. It
// holds a secret for one enrolment, and the certificate of the coordinator's authority, so that the
// machine verifies the coordinator before it sends the secret.
#pragma once

#include <cstddef>
#include <string>

#include "absl/status/statusor.h"

namespace sheaf {

inline constexpr size_t kTokenSecretBytes = 32;
inline constexpr size_t kTokenBytesMax = 16 << 10;

struct EnrolmentToken {
  std::string secret;         // kTokenSecretBytes bytes.
  std::string authority_pem;  // The coordinator's only root.
};

// "sheaf1.AUTHORITY.SECRET", both base64url; the number is the version of the format.
// Errors: kInvalidArgument: the certificate.
absl::StatusOr<std::string> FormatToken(const EnrolmentToken& token);
// Spaces and line ends around the text are ignored. Errors: kInvalidArgument, never with the
// secret.
absl::StatusOr<EnrolmentToken> ParseToken(const std::string& text);

}  // namespace sheaf
