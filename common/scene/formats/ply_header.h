// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// The header of a PLY file, and the reader of its bytes: one buffered reader serves both header and
// data.
#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "common/scene/formats/text_input.h"

namespace sheaf {

enum class PlyFormat { kAscii, kLittleEndian, kBigEndian };
enum class PlyType { kInt8, kUint8, kInt16, kUint16, kInt32, kUint32, kFloat32, kFloat64 };
size_t PlySizeBytes(PlyType type);
// The value of these bytes; swap: they are of the other byte order.
double PlyValueOf(PlyType type, const unsigned char* bytes, bool swap);

struct PlyProperty {
  std::string name;
  PlyType type = PlyType::kFloat32;
  bool is_list = false;
  PlyType count_type = PlyType::kUint8;  // For lists.
  uint64_t line = 0;
};
struct PlyElement {
  std::string name;
  uint64_t count = 0;
  std::vector<PlyProperty> properties;
  uint64_t line = 0;
};
struct PlyHeader {
  PlyFormat format = PlyFormat::kAscii;
  std::vector<PlyElement> elements;
  std::string texture;  // A file that a comment names as the mesh's texture; empty: none.
  uint64_t texture_line = 0;
};

// Bytes, lines and words of a file, in order, through one buffer. The first error is sticky:
// afterwards every call fails, and status() has the cause.
class PlyBytes {
 public:
  explicit PlyBytes(std::unique_ptr<TextInput> input);

  bool ReadLine(std::string* line);       // Without its line end, which is \r\n or \n.
  bool ReadWord(std::string_view* word);  // Valid until the next call.
  // Whether nothing but blanks follows, as far as the buffer reaches.
  bool IsAtEnd();
  // The next size_bytes <= 8 bytes; nullptr at the end.
  const unsigned char* ReadBytes(size_t size_bytes) {
    if (end_ - position_ < size_bytes && !Refill(size_bytes)) return nullptr;
    const unsigned char* bytes = buffer_.data() + position_;
    position_ += size_bytes;
    return bytes;
  }
  const absl::Status& status() const { return status_; }
  uint64_t line() const { return line_; }  // Number of the current line, from 1.
  uint64_t size_bytes_bound() const { return input_->size_bytes_bound(); }

 private:
  bool Refill(size_t size_bytes);  // Makes size_bytes available, or fails.
  bool Pull(size_t size_bytes);    // The same, but the end of the file is not a failure.

  std::unique_ptr<TextInput> input_;
  std::vector<unsigned char> buffer_;
  size_t position_ = 0;
  size_t end_ = 0;
  uint64_t line_ = 1;
  absl::Status status_;
};

// Leaves bytes at the first byte after end_header.
// Errors: kInvalidArgument with the line, kDataLoss for a file that ends within its header.
absl::StatusOr<PlyHeader> ReadPlyHeader(PlyBytes& bytes);

}  // namespace sheaf
