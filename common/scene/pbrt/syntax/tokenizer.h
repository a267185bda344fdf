// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Tokenizer: the words, strings and brackets of a pbrt file with their places, read through a
// buffer of bounded size, so that a file of any length costs the same memory. Comments run from '#'
// to the end of the line.
#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "common/scene/formats/text_input.h"

namespace sheaf {

struct Token {
  enum class Kind {
    kEnd,     // End of the file.
    kWord,    // A directive, a number, true or false.
    kString,  // Between quotation marks, which text omits; escapes are resolved.
    kLeftBracket,
    kRightBracket,
    kError,  // Reading cannot continue; text has the reason.
  };
  Kind kind = Kind::kEnd;
  std::string_view text;  // Valid until the next call of Next.
  int32_t line = 1;       // From 1.
  int32_t column = 1;     // From 1, in bytes.
};

class Tokenizer {
 public:
  // The longest token. Numbers and names are far shorter: a file with a longer one is not a scene.
  static constexpr size_t kTokenBytesMax = size_t{1} << 16;

  explicit Tokenizer(std::unique_ptr<TextInput> input);

  Token Next();
  // Makes the next call of Next return the last token again.
  void Unget() { has_ungotten_ = true; }

 private:
  Token Scan();
  Token ScanString(Token token);
  Token ScanWord(Token token);
  Token Failed(Token token, std::string why);
  // Ensures that buffer_[position_] exists, keeping bytes from keep_from_ on. False at the end.
  bool Fill();
  bool SkipBlanks();
  void StartLine() {
    ++line_;
    line_start_ = buffer_offset_ + position_;
  }

  std::unique_ptr<TextInput> input_;
  std::vector<char> buffer_;
  size_t position_ = 0;         // Index in buffer_ of the next byte.
  size_t end_ = 0;              // End of the contents of buffer_.
  size_t keep_from_ = 0;        // First byte that Fill must keep.
  uint64_t buffer_offset_ = 0;  // Offset of buffer_[0] in the file.
  uint64_t line_start_ = 0;     // Offset of the current line in the file.
  int32_t line_ = 1;
  Token last_;
  bool has_ungotten_ = false;
  std::string unescaped_;
  std::string error_;
};

}  // namespace sheaf
