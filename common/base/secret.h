// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Keyed digests: a holder of the key can prove, and check, that a message was made by a holder of
// the key. Uses OpenSSL.
#pragma once

#include <cstddef>
#include <string>
#include <string_view>

namespace sheaf {

// HMAC with SHA-256 (RFC 2104), as 32 bytes.
std::string HmacSha256(std::string_view key, std::string_view message);
// Whether the bytes are equal, in a time that tells nothing of where they differ.
bool EqualSecrets(std::string_view a, std::string_view b);
// Unpredictable bytes from OpenSSL's generator. Ends the program if it has none.
std::string RandomBytes(size_t count);

}  // namespace sheaf
