// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "common/content/chunk_codec.h"

#include <zstd.h>

#include <memory>

#include "absl/strings/str_cat.h"
#include "common/base/check.h"

namespace sheaf {
namespace {

// Fast enough to keep up with a 10 Gb/s link on one core; higher levels gain little on meshes.
constexpr int kCompressionLevel = 3;

struct ContextDeleter {
  void operator()(ZSTD_CCtx* context) const { ZSTD_freeCCtx(context); }
};

}  // namespace

std::string CompressChunk(std::string_view bytes) {
  const std::unique_ptr<ZSTD_CCtx, ContextDeleter> context(ZSTD_createCCtx());
  SHEAF_CHECK(context != nullptr);
  ZSTD_CCtx_setParameter(context.get(), ZSTD_c_compressionLevel, kCompressionLevel);
  ZSTD_CCtx_setParameter(context.get(), ZSTD_c_checksumFlag, 1);
  std::string frame(ZSTD_compressBound(bytes.size()), '\0');
  const size_t size =
      ZSTD_compress2(context.get(), frame.data(), frame.size(), bytes.data(), bytes.size());
  SHEAF_CHECK(ZSTD_isError(size) == 0);  // The bound makes every input fit.
  frame.resize(size);
  return frame;
}

absl::StatusOr<std::string> DecompressChunk(std::string_view frame, uint64_t size_bytes_max) {
  const uint64_t size = ZSTD_getFrameContentSize(frame.data(), frame.size());
  if (size == ZSTD_CONTENTSIZE_ERROR || size == ZSTD_CONTENTSIZE_UNKNOWN) {
    return absl::InvalidArgumentError("compressed chunk: not a zstd frame that states its size");
  }
  if (size > size_bytes_max) {
    return absl::InvalidArgumentError(
        absl::StrCat("compressed chunk: claims ", size, " bytes, the limit is ", size_bytes_max));
  }
  std::string bytes(size, '\0');
  const size_t written = ZSTD_decompress(bytes.data(), bytes.size(), frame.data(), frame.size());
  if (ZSTD_isError(written) != 0) {
    return absl::InvalidArgumentError(
        absl::StrCat("compressed chunk: ", ZSTD_getErrorName(written)));
  }
  if (written != size)
    return absl::InvalidArgumentError("compressed chunk: shorter than it claims");
  return bytes;
}

}  // namespace sheaf
