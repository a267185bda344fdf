// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// The bytes of a ContributionField, little-endian: "SHCF"; version, width, height, block bits and
// number of regions as uint32; the factors of blocks, then of regions, as floats.
#include "worker/render/guiding/contribution_field.h"

#include <bit>
#include <cmath>

#include "absl/strings/str_cat.h"
#include "common/base/vector_bytes.h"

namespace sheaf::render {
namespace {

constexpr std::string_view kContributionMagic = "SHCF";
constexpr uint32_t kContributionVersion = 1;
static_assert(kContributionHeaderBytes == 4 + 5 * sizeof(uint32_t));

void AppendWord(uint32_t word, std::string* bytes) {
  for (int i = 0; i < 4; ++i) bytes->push_back(static_cast<char>(word >> 8 * i & 0xff));
}
uint32_t WordAt(std::string_view bytes, size_t at) {
  uint32_t word = 0;
  for (size_t i = 0; i < 4; ++i) {
    word |= static_cast<uint32_t>(static_cast<uint8_t>(bytes[at + i])) << 8 * i;
  }
  return word;
}

absl::Status WrongContributions(const std::string& what) {
  return absl::DataLossError(absl::StrCat("the field of contributions ", what, "; train it again"));
}

}  // namespace

uint64_t ContributionField::memory_bytes() const {
  return sizeof(*this) + VectorBytes(blocks_, regions_);
}

std::string ContributionField::Encode() const {
  std::string bytes(kContributionMagic);
  for (const uint32_t word :
       {kContributionVersion, static_cast<uint32_t>(grid_.width_px),
        static_cast<uint32_t>(grid_.height_px), grid_.block_bits, region_count()}) {
    AppendWord(word, &bytes);
  }
  for (const float factor : blocks_) AppendWord(std::bit_cast<uint32_t>(factor), &bytes);
  for (const float factor : regions_) AppendWord(std::bit_cast<uint32_t>(factor), &bytes);
  return bytes;
}

absl::StatusOr<ContributionField> ContributionField::Decode(std::string_view bytes) {
  if (bytes.size() < kContributionHeaderBytes || bytes.size() > kContributionBytesMax) {
    return WrongContributions("has an impossible size");
  }
  if (!bytes.starts_with(kContributionMagic)) return WrongContributions("does not begin as one");
  const uint32_t version = WordAt(bytes, 4), width = WordAt(bytes, 8), height = WordAt(bytes, 12),
                 block_bits = WordAt(bytes, 16), regions = WordAt(bytes, 20);
  if (version != kContributionVersion) {
    return WrongContributions(absl::StrCat("has the unknown version ", version));
  }
  ContributionField field;
  field.grid_ = {static_cast<int32_t>(width), static_cast<int32_t>(height), block_bits};
  if (field.grid_.width_px < 1 || field.grid_.height_px < 1 ||
      block_bits > kContributionBlockBitsMax || field.grid_.columns() > kContributionBlocksMax ||
      field.grid_.rows() > kContributionBlocksMax || field.grid_.size() > kContributionBlocksMax) {
    return WrongContributions("has impossible blocks of pixels");
  }
  if (regions < 1 || regions > kGuidingRegionsMax) {
    return WrongContributions("has an impossible number of regions");
  }
  const size_t blocks = field.grid_.size();
  if (bytes.size() != kContributionHeaderBytes + sizeof(float) * (blocks + regions)) {
    return WrongContributions("has another size than its head says (truncated?)");
  }
  for (size_t i = 0; i < blocks + regions; ++i) {
    const auto factor =
        std::bit_cast<float>(WordAt(bytes, kContributionHeaderBytes + sizeof(float) * i));
    if (!std::isfinite(factor) || std::signbit(factor)) {
      return WrongContributions("has a factor that is negative or not finite");
    }
    (i < blocks ? field.blocks_ : field.regions_).push_back(factor);
  }
  return field;
}

}  // namespace sheaf::render
