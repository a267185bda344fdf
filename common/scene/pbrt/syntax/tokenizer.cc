// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "common/scene/pbrt/syntax/tokenizer.h"

#include <algorithm>
#include <cstring>
#include <limits>

#include "absl/strings/str_cat.h"

namespace sheaf {
namespace {

constexpr size_t kBufferBytes = size_t{1} << 18;
static_assert(kBufferBytes >= 2 * Tokenizer::kTokenBytesMax);

// Small files fit into a small buffer, with room to notice their end: scenes may have many. A size
// of 0 is that of files whose size is not known, such as pipes.
size_t BufferBytesFor(uint64_t file_bytes) {
  if (file_bytes == 0) return kBufferBytes;
  return static_cast<size_t>(std::min<uint64_t>(file_bytes + 1, kBufferBytes));
}

bool IsBlank(char c) { return c == ' ' || c == '\t' || c == '\r'; }

bool EndsWord(char c) {
  return IsBlank(c) || c == '\n' || c == '"' || c == '[' || c == ']' || c == '#';
}

char Unescape(char c) {
  switch (c) {
    case 'b':
      return '\b';
    case 'f':
      return '\f';
    case 'n':
      return '\n';
    case 'r':
      return '\r';
    case 't':
      return '\t';
    case '\\':
      return '\\';
    case '\'':
      return '\'';
    case '"':
      return '"';
    default:
      return '\0';
  }
}

}  // namespace

Tokenizer::Tokenizer(std::unique_ptr<TextInput> input)
    : input_(std::move(input)), buffer_(BufferBytesFor(input_->size_bytes_bound())) {}

Token Tokenizer::Next() {
  if (has_ungotten_) {
    has_ungotten_ = false;
    return last_;
  }
  last_ = Scan();
  return last_;
}

bool Tokenizer::Fill() {
  if (position_ < end_) return true;
  if (!error_.empty()) return false;
  const size_t kept = end_ - keep_from_;
  std::memmove(buffer_.data(), buffer_.data() + keep_from_, kept);
  buffer_offset_ += keep_from_;
  position_ -= keep_from_;
  keep_from_ = 0;
  end_ = kept;
  if (end_ == buffer_.size())
    return false;  // Only a token longer than kTokenBytesMax fills the buffer.
  const absl::StatusOr<size_t> count = input_->Read(buffer_.data() + end_, buffer_.size() - end_);
  if (!count.ok()) {
    error_ = std::string(count.status().message());
    return false;
  }
  end_ += *count;
  return *count > 0;
}

bool Tokenizer::SkipBlanks() {
  while (true) {
    keep_from_ = position_;
    if (!Fill()) return false;
    const char c = buffer_[position_];
    if (c == '\n') {
      ++position_;
      StartLine();
    } else if (IsBlank(c)) {
      ++position_;
    } else if (c == '#') {
      while (position_ < end_ && buffer_[position_] != '\n') ++position_;
      while (position_ == end_) {
        keep_from_ = position_;
        if (!Fill()) return false;
        while (position_ < end_ && buffer_[position_] != '\n') ++position_;
      }
    } else {
      return true;
    }
  }
}

Token Tokenizer::Scan() {
  Token token;
  const bool found = SkipBlanks();
  token.line = line_;
  token.column = static_cast<int32_t>(
      std::min<uint64_t>(buffer_offset_ + position_ - line_start_ + 1,
                         static_cast<uint64_t>(std::numeric_limits<int32_t>::max())));
  if (!found) return error_.empty() ? token : Failed(token, error_);
  keep_from_ = position_;
  switch (buffer_[position_]) {
    case '[':
      token.kind = Token::Kind::kLeftBracket;
      break;
    case ']':
      token.kind = Token::Kind::kRightBracket;
      break;
    case '"':
      return ScanString(token);
    default:
      return ScanWord(token);
  }
  token.text = std::string_view(buffer_.data() + position_, 1);
  ++position_;
  return token;
}

Token Tokenizer::Failed(Token token, std::string why) {
  error_ = std::move(why);
  token.kind = Token::Kind::kError;
  token.text = error_;
  return token;
}

Token Tokenizer::ScanString(Token token) {
  ++position_;
  unescaped_.clear();
  bool escaped = false;
  while (true) {
    if (!Fill() || position_ - keep_from_ > kTokenBytesMax) break;
    const char c = buffer_[position_++];
    if (c == '\n') return Failed(token, "the string is not closed on its line; add the missing \"");
    if (c == '"') {
      token.kind = Token::Kind::kString;
      token.text =
          escaped ? std::string_view(unescaped_)
                  : std::string_view(buffer_.data() + keep_from_ + 1, position_ - keep_from_ - 2);
      return token;
    }
    if (c != '\\') {
      if (escaped) unescaped_.push_back(c);
      continue;
    }
    if (!escaped) unescaped_.assign(buffer_.data() + keep_from_ + 1, position_ - keep_from_ - 2);
    escaped = true;
    if (!Fill()) break;
    const char resolved = Unescape(buffer_[position_++]);
    if (resolved == '\0') {
      return Failed(token,
                    "the string holds an unknown escape after \\; between folders write / instead");
    }
    unescaped_.push_back(resolved);
  }
  if (!error_.empty()) return Failed(token, error_);
  return Failed(token,
                position_ - keep_from_ > kTokenBytesMax
                    ? absl::StrCat("the string exceeds the limit of ", kTokenBytesMax, " bytes")
                    : std::string("the file ends inside a string"));
}

Token Tokenizer::ScanWord(Token token) {
  while (true) {
    while (position_ < end_ && !EndsWord(buffer_[position_])) ++position_;
    if (position_ < end_ || position_ - keep_from_ > kTokenBytesMax || !Fill()) break;
  }
  if (position_ - keep_from_ > kTokenBytesMax) {
    return Failed(token, absl::StrCat("a word exceeds the limit of ", kTokenBytesMax,
                                      " bytes; this is not a pbrt scene file"));
  }
  if (!error_.empty()) return Failed(token, error_);
  token.kind = Token::Kind::kWord;
  token.text = std::string_view(buffer_.data() + keep_from_, position_ - keep_from_);
  return token;
}

}  // namespace sheaf
