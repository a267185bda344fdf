// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "common/base/surroundings/similar_file.h"

#include <cstdint>
#include <filesystem>
#include <system_error>

#include "absl/strings/ascii.h"
#include "absl/strings/str_cat.h"
#include "common/base/printable.h"

namespace sheaf {
namespace {

namespace fs = std::filesystem;

constexpr int kEntriesMax = 10'000;  // Examined entries of a folder.

// The letters without their marks, from U+00C0 and from U+1E00 on; "." if it has none.
constexpr std::string_view kLatin =
    "aaaaaa.ceeeeiiii.nooooo..uuuuy..aaaaaa.ceeeeiiii.nooooo..uuuuy.y"
    "aaaaaaccccccccdd..eeeeeeeeeegggggggghh..iiiiiiiii...jjkk.llllll."
    "...nnnnnn...oooooo..rrrrrrsssssssstttt..uuuuuuuuuuuuwwyyyzzzzzz.";
constexpr std::string_view kMoreLatin =
    "aabbbbbbccddddddddddeeeeeeeeeeffgghhhhhhhhhhiiiikkkkkkllllllllmm"
    "mmmmnnnnnnnnoooooooopppprrrrrrrrssssssssssttttttttuuuuuuuuuuvvvv"
    "wwwwwwwwwwxxxxyyzzzzzzhtwy......aaaaaaaaaaaaaaaaaaaaaaaaeeeeeeee"
    "eeeeeeeeiiiioooooooooooooooooooooooouuuuuuuuuuuuuuyyyyyyyy......";

// Takes a character off the front. Bytes that are not UTF-8 are characters of their own.
uint32_t TakeCharacter(std::string_view* text) {
  const auto first = static_cast<uint8_t>(text->front());
  size_t size = first >= 0xf0 ? 4 : first >= 0xe0 ? 3 : first >= 0xc0 ? 2 : 1;
  if (size > text->size()) size = 1;
  uint32_t code = size == 1 ? first : first & (0xffu >> (size + 1));
  for (size_t i = 1; i < size; ++i) {
    code = code << 6 | (static_cast<uint8_t>((*text)[i]) & 0x3fu);
  }
  text->remove_prefix(size);
  return code;
}

bool IsMark(uint32_t code) {
  return (code >= 0x300 && code <= 0x36f) || code == 0x3099 || code == 0x309a;
}

// Kana without the marks of voice: the voiced ones follow the others.
uint32_t WithoutVoice(uint32_t code) {
  const uint32_t hiragana = code >= 0x30a1 ? code - 0x60 : code;
  uint32_t base = hiragana;
  if (hiragana >= 0x304b && hiragana <= 0x3062) base -= (hiragana - 0x304b) % 2;
  if (hiragana >= 0x3064 && hiragana <= 0x3069) base -= (hiragana - 0x3064) % 2;
  if (hiragana >= 0x306f && hiragana <= 0x307d) base -= (hiragana - 0x306f) % 3;
  if (hiragana == 0x3094) base = 0x3046;
  return base + (code - hiragana);
}

uint32_t LowerCase(uint32_t code) {
  if (code < 0x80) return static_cast<uint8_t>(absl::ascii_tolower(static_cast<uint8_t>(code)));
  if ((code >= 0x391 && code <= 0x3a9) || (code >= 0x410 && code <= 0x42f)) return code + 0x20;
  if (code >= 0x400 && code <= 0x40f) return code + 0x50;
  return code;
}

// Without marks, in lower case.
uint32_t BaseOf(uint32_t code) {
  char latin = '.';
  if (code >= 0xc0 && code - 0xc0 < kLatin.size()) latin = kLatin[code - 0xc0];
  if (code >= 0x1e00 && code - 0x1e00 < kMoreLatin.size()) latin = kMoreLatin[code - 0x1e00];
  if (latin != '.') return static_cast<uint8_t>(latin);
  if (code >= 0x3041 && code <= 0x30fa) return WithoutVoice(code);
  code = LowerCase(code);
  if (code == 0x439 || code == 0x457) return code == 0x439 ? 0x438 : 0x456;
  return code == 0x451 ? 0x435 : code;
}

void Append(uint32_t code, std::string* out) { absl::StrAppend(out, absl::Hex(code), " "); }

}  // namespace

std::string NameSkeleton(std::string_view name) {
  // Hangul: a syllable has a leading consonant, a vowel and perhaps a trailing consonant.
  constexpr uint32_t kSyllables = 0xac00, kLeading = 0x1100, kVowels = 0x1161, kTrailing = 0x11a7;
  constexpr uint32_t kSyllableCount = 11172, kVowelCount = 21, kTrailingCount = 28;
  std::string skeleton;
  while (!name.empty()) {
    const uint32_t code = TakeCharacter(&name);
    if (IsMark(code)) continue;
    if (code >= kSyllables && code < kSyllables + kSyllableCount) {
      const uint32_t at = code - kSyllables;
      Append(kLeading + at / (kVowelCount * kTrailingCount), &skeleton);
      Append(kVowels + at / kTrailingCount % kVowelCount, &skeleton);
      if (at % kTrailingCount > 0) Append(kTrailing + at % kTrailingCount, &skeleton);
    } else {
      Append(BaseOf(code), &skeleton);
    }
  }
  return skeleton;
}

std::string SimilarFileHint(const std::string& path) {
  // The first part that does not exist.
  fs::path folder = ".", missing;
  std::error_code error;
  for (const fs::path& part : fs::path(path)) {
    const fs::path next = part.has_root_directory() ? part : folder / part;
    if (!fs::exists(next, error)) {
      missing = part;
      break;
    }
    folder = next;
  }
  const std::string wanted = NameSkeleton(missing.string());
  if (wanted.empty()) return "";
  int count = 0;
  for (fs::directory_iterator at(folder, error), end; !error && at != end; at.increment(error)) {
    if (++count > kEntriesMax) break;
    const std::string name = at->path().filename().string();
    if (NameSkeleton(name) != wanted) continue;
    const bool is_case = absl::AsciiStrToLower(name) == absl::AsciiStrToLower(missing.string());
    return absl::StrCat("; there is \"", Printable(name), "\", ",
                        is_case
                            ? "in other case"
                            : "whose letters are other Unicode characters, as where macOS wrote "
                              "one of the names: rename the file or the reference");
  }
  return "";
}

}  // namespace sheaf
