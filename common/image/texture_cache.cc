// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "common/image/texture_cache.h"

#include <algorithm>
#include <utility>

#include "common/base/load_phases.h"
#include "common/base/log.h"
#include "common/image/image_header.h"
#include "common/image/image_library.h"
#include "common/image/plain_image.h"
#include "common/image/resident_texture.h"

namespace sheaf {
namespace {

// Images that stay in memory may take 1 / kResidentFraction of it.
constexpr uint64_t kResidentFraction = 4;

}  // namespace

TextureCache::TextureCache(uint64_t bytes_max) : bytes_max_(bytes_max) {}

TextureCache::~TextureCache() = default;

std::shared_ptr<const PlainImage> TextureCache::Load(const std::string& path) {
  std::shared_ptr<const PlainImage>& numbers = numbers_[path];
  if (numbers != nullptr) return numbers;
  const uint64_t left = bytes_max_ / kResidentFraction - resident_bytes_;
  std::optional<PlainImage> image =
      ReadPlainImage(path, {.bytes_max = std::min(kResidentImageBytesMax, left)});
  if (!image) return nullptr;
  resident_bytes_ += image->numbers.size();
  numbers = std::make_shared<const PlainImage>(*std::move(image));
  return numbers;
}

absl::Status TextureCache::OpenTiles(Opened* opened) {
  if (tiles_ == nullptr) {
    const absl::StatusOr<const ImageLibrary*> library = LoadImageLibrary();
    if (!library.ok()) return library.status();
    tiles_ = (*library)->make_texture_tiles(bytes_max_ - bytes_max_ / kResidentFraction, LogError);
  }
  absl::StatusOr<TextureImage> facts = tiles_->Open(opened->path, opened->encoding);
  if (!facts.ok()) return facts.status();
  opened->tiled = facts->index;
  opened->facts = *std::move(facts);
  return absl::OkStatus();
}

absl::StatusOr<TextureImage> TextureCache::Open(const std::string& path, TexelEncoding encoding) {
  const PhaseTimer timer(LoadPhase::kImages);
  if (absl::Status header = CheckImageHeader(path); !header.ok()) return header;
  for (const Opened& opened : opened_) {
    if (opened.path == path && opened.encoding == encoding) return opened.facts;
  }
  Opened opened;
  opened.path = path;
  opened.encoding = encoding;
  if (opens_by_header()) {
    if (const auto header = ReadPlainImage(path, {.is_header_enough = true})) {
      opened.facts = FactsOf(*header);
    } else if (absl::Status status = OpenTiles(&opened); !status.ok()) {
      return status;
    }
  } else if (const auto numbers = Load(path)) {
    opened.resident = std::make_unique<const ResidentTexture>(numbers, encoding);
    opened.facts = opened.resident->facts();
  } else if (absl::Status status = OpenTiles(&opened); !status.ok()) {
    return status;
  }
  opened.facts.index = static_cast<int32_t>(opened_.size());
  opened_.push_back(std::move(opened));
  return opened_.back().facts;
}

uint64_t TextureCache::memory_bytes() const {
  return resident_bytes_ + (tiles_ == nullptr ? 0 : tiles_->memory_bytes());
}

void TextureCache::ReadTexels(int32_t image, std::span<const TexelIndex> where,
                              std::span<Texel> values) const {
  const Opened& opened = opened_[static_cast<size_t>(image)];
  if (opened.resident == nullptr) return tiles_->ReadTexels(opened.tiled, where, values);
  opened.resident->ReadTexels(where, values);
}

}  // namespace sheaf
