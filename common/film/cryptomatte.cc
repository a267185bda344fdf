// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "common/film/cryptomatte.h"

#include <algorithm>
#include <bit>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "common/base/check.h"

namespace sheaf {
namespace {

const char* LayerName(IdKind kind) {
  switch (kind) {
    case IdKind::kObject:
      return "CryptoObject";
    case IdKind::kMaterial:
      return "CryptoMaterial";
    case IdKind::kAsset:
    case IdKind::kCount:
      break;
  }
  return "CryptoAsset";
}

uint32_t ByteAt(std::string_view text, size_t i) { return static_cast<unsigned char>(text[i]); }

uint32_t ScrambleBlock(uint32_t block) { return std::rotl(block * 0xcc9e2d51u, 15) * 0x1b873593u; }

std::string JsonString(std::string_view text) {
  std::string json = "\"";
  for (const char c : text) {
    if (c == '"' || c == '\\') {
      json += '\\';
      json += c;
    } else if (static_cast<unsigned char>(c) < 0x20) {
      absl::StrAppendFormat(&json, "\\u%04x", static_cast<unsigned char>(c));
    } else {
      json += c;
    }
  }
  return json + "\"";
}

}  // namespace

uint32_t MurmurHash3(std::string_view text) {
  uint32_t hash = 0;
  const size_t block_count = text.size() / 4;
  for (size_t i = 0; i < block_count; ++i) {
    const uint32_t block = ByteAt(text, 4 * i) | ByteAt(text, 4 * i + 1) << 8 |
                           ByteAt(text, 4 * i + 2) << 16 | ByteAt(text, 4 * i + 3) << 24;
    hash = std::rotl(hash ^ ScrambleBlock(block), 13) * 5 + 0xe6546b64u;
  }
  uint32_t tail = 0;
  for (size_t i = 4 * block_count; i < text.size(); ++i) tail |= ByteAt(text, i) << 8 * (i % 4);
  hash ^= ScrambleBlock(tail);
  hash ^= static_cast<uint32_t>(text.size());
  hash = (hash ^ hash >> 16) * 0x85ebca6bu;
  hash = (hash ^ hash >> 13) * 0xc2b2ae35u;
  return hash ^ hash >> 16;
}

uint32_t CryptomatteIdBits(std::string_view name) {
  const uint32_t hash = MurmurHash3(name);
  const uint32_t exponent = hash >> 23 & 255;
  return exponent == 0 || exponent == 255 ? hash ^ 1u << 23 : hash;
}

std::vector<std::string> CryptomatteChannels(IdKind kind) {
  std::vector<std::string> names;
  for (size_t layer = 0; layer < kCryptomatteRankCount / 2; ++layer) {
    for (const char component : {'R', 'G', 'B', 'A'}) {
      names.push_back(absl::StrFormat("%s%02d.%c", LayerName(kind), layer, component));
    }
  }
  names.push_back(absl::StrCat("rest.", LayerName(kind)));
  return names;
}

std::array<float, 2 * kCryptomatteRankCount + 1> RankIds(
    const IdList& list, const std::map<uint32_t, std::string>& names, double weight) {
  std::array<float, 2 * kCryptomatteRankCount + 1> values{};
  if (weight == 0) return values;
  struct Matte {
    uint32_t bits;
    double coverage;
  };
  std::vector<Matte> mattes;
  double rest = 0;
  for (const IdWeight& entry : list) {
    const double coverage = entry.weight / weight;
    if (entry.id == kNoId) {
      rest += coverage;
      continue;
    }
    const auto name = names.find(entry.id);
    SHEAF_CHECK(name != names.end());
    const uint32_t bits = CryptomatteIdBits(name->second);
    const auto same = std::find_if(mattes.begin(), mattes.end(),
                                   [bits](const Matte& matte) { return matte.bits == bits; });
    if (same != mattes.end()) {
      same->coverage += coverage;
    } else {
      mattes.push_back({bits, coverage});
    }
  }
  std::stable_sort(mattes.begin(), mattes.end(),
                   [](const Matte& a, const Matte& b) { return a.coverage > b.coverage; });
  for (size_t i = 0; i < mattes.size(); ++i) {
    if (i < kCryptomatteRankCount && mattes[i].coverage > 0) {
      values[2 * i] = std::bit_cast<float>(mattes[i].bits);
      values[2 * i + 1] = static_cast<float>(mattes[i].coverage);
    } else {
      rest += mattes[i].coverage;
    }
  }
  values.back() = static_cast<float>(rest);
  return values;
}

uint32_t LeadingId(const IdList& list) {
  IdWeight leading;
  for (const IdWeight& entry : list) {
    if (entry.id != kNoId && entry.weight > leading.weight) leading = entry;
  }
  return leading.id;
}

std::map<std::string, std::string> CryptomatteAttributes(const FrameImage& image) {
  std::map<std::string, std::string> attributes;
  for (size_t i = 0; i < kIdKindCount; ++i) {
    const auto kind = static_cast<IdKind>(i);
    if (!image.outputs.HasCryptomatte(kind)) continue;
    const std::string layer = LayerName(kind);
    const std::string key = absl::StrCat(
        "cryptomatte/", absl::StrFormat("%08x", CryptomatteIdBits(layer)).substr(0, 7), "/");
    std::string manifest = "{";
    for (const std::string& name : image.id_names[i]) {
      absl::StrAppend(&manifest, manifest.size() > 1 ? "," : "", JsonString(name),
                      absl::StrFormat(":\"%08x\"", CryptomatteIdBits(name)));
    }
    attributes[key + "name"] = layer;
    attributes[key + "hash"] = "MurmurHash3_32";
    attributes[key + "conversion"] = "uint32_to_float32";
    attributes[key + "manifest"] = manifest + "}";
  }
  return attributes;
}

}  // namespace sheaf
