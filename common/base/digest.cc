// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "common/base/digest.h"

#include <openssl/evp.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <charconv>
#include <cstdio>
#include <memory>
#include <system_error>

#include "common/base/check.h"
#include "common/base/status.h"

namespace sheaf {

struct Sha256::Context {
  EVP_MD_CTX* evp = EVP_MD_CTX_new();
  ~Context() { EVP_MD_CTX_free(evp); }
};

Sha256::Sha256() : context_(std::make_unique<Context>()) {
  SHEAF_CHECK(EVP_DigestInit_ex(context_->evp, EVP_sha256(), nullptr) == 1);
}
Sha256::~Sha256() = default;
Sha256::Sha256(Sha256&&) noexcept = default;
Sha256& Sha256::operator=(Sha256&&) noexcept = default;

void Sha256::Update(const void* bytes, size_t size_bytes) {
  SHEAF_CHECK(EVP_DigestUpdate(context_->evp, bytes, size_bytes) == 1);
}

std::string Sha256::FinishHex() {
  std::array<unsigned char, EVP_MAX_MD_SIZE> raw;
  unsigned int size = 0;
  SHEAF_CHECK(EVP_DigestFinal_ex(context_->evp, raw.data(), &size) == 1);
  constexpr char kDigits[] = "0123456789abcdef";
  std::string hex;
  for (unsigned int i = 0; i < size; ++i) {
    hex += kDigits[raw[i] >> 4];
    hex += kDigits[raw[i] & 15];
  }
  return hex;
}

std::string Sha256Hex(std::string_view bytes) {
  Sha256 hash;
  hash.Update(bytes);
  return hash.FinishHex();
}

absl::StatusOr<FileDigest> Sha256OfFile(const std::string& path) {
  std::unique_ptr<std::FILE, int (*)(std::FILE*)> file(std::fopen(path.c_str(), "rb"), std::fclose);
  if (!file) return StatusFromErrno(errno, path);
  Sha256 hash;
  FileDigest digest;
  // Not set to zero, and no memory map of its own: scenes may have many small files.
  constexpr size_t kBufferBytes = size_t{1} << 16;
  const auto buffer = std::make_unique_for_overwrite<char[]>(kBufferBytes);
  while (size_t n = std::fread(buffer.get(), 1, kBufferBytes, file.get())) {
    hash.Update(buffer.get(), n);
    digest.size_bytes += n;
  }
  if (std::ferror(file.get())) return StatusFromErrno(errno, path);
  digest.sha256_hex = hash.FinishHex();
  return digest;
}

bool IsSha256Hex(std::string_view text) {
  return text.size() == 64 && std::all_of(text.begin(), text.end(), [](char c) {
           return (c >= '0' && c <= '9') || (c >= 'a' && c <= 'f');
         });
}

std::string BytesOfHex(std::string_view hex) {
  SHEAF_CHECK(hex.size() % 2 == 0);
  std::string bytes(hex.size() / 2, '\0');
  for (size_t i = 0; i < bytes.size(); ++i) {
    const char* const digits = hex.data() + 2 * i;
    unsigned char byte = 0;
    const auto [end, error] = std::from_chars(digits, digits + 2, byte, 16);
    SHEAF_CHECK(error == std::errc() && end == digits + 2);
    bytes[i] = static_cast<char>(byte);
  }
  return bytes;
}

}  // namespace sheaf
