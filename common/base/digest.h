// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// SHA-256, which names everything that is stored.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <string>
#include <string_view>

#include "absl/status/statusor.h"

namespace sheaf {

class Sha256 {
 public:
  Sha256();
  ~Sha256();
  Sha256(Sha256&&) noexcept;
  Sha256& operator=(Sha256&&) noexcept;
  void Update(const void* bytes, size_t size_bytes);
  void Update(std::string_view bytes) { Update(bytes.data(), bytes.size()); }
  // 64 lower-case hexadecimal digits. Call once.
  std::string FinishHex();

 private:
  struct Context;
  std::unique_ptr<Context> context_;
};

std::string Sha256Hex(std::string_view bytes);
struct FileDigest {
  std::string sha256_hex;
  uint64_t size_bytes = 0;
};
absl::StatusOr<FileDigest> Sha256OfFile(const std::string& path);
bool IsSha256Hex(std::string_view text);
// The bytes that pairs of hexadecimal digits name. Requires: an even number of digits, such as
// those of a Sha256Hex.
std::string BytesOfHex(std::string_view hex);

}  // namespace sheaf
