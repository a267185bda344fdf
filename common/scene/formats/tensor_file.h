// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Tensor files, in which the RGL stores measured materials (.bsdf): named arrays of numbers of any
// rank. All numbers are little-endian: "tensor_file" and a zero byte, two bytes of version (1, 0),
// the number of fields (uint32); then for each the length of its name (uint16), the name, its rank
// (uint16), type (uint8), offset in the file and sizes along each dimension (uint64). Source: Dupuy
// and Jakob 2018, "An Adaptive Parameterization for Efficient Material Acquisition and Rendering",
// and its reference implementation.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "absl/status/statusor.h"

namespace sheaf {

enum class TensorType : uint8_t {
  kUint8 = 1,
  kInt8,
  kUint16,
  kInt16,
  kUint32,
  kInt32,
  kUint64,
  kInt64,
  kFloat16,
  kFloat32,
  kFloat64,
};

struct TensorField {
  std::string name;
  TensorType type = TensorType::kUint8;
  std::vector<uint64_t> shape;  // Slowest dimension first.
  uint64_t offset_bytes = 0;
  uint64_t size_bytes = 0;

  uint64_t ValueCount() const;
};

// The fields of a file, all verified to lie within it; values are read on request.
// Thread safety: const functions may run concurrently.
class TensorFile {
 public:
  // Reads the list of fields. Memory is bounded by kTensorFieldsMax fields of kTensorRankMax. name:
  // of the file, for errors, which read "name: what" or "name: field "field": what".
  // Errors: kInvalidArgument for malformed files, kResourceExhausted beyond the limits; errors of
  // opening and reading the file.
  static absl::StatusOr<TensorFile> Open(const std::string& name, const std::string& path);

  const std::vector<TensorField>& fields() const { return fields_; }
  // Null if there is none of that name.
  const TensorField* Find(const std::string& field) const;
  // All values, in the order of the file. Requires: field is one of fields(), of that type.
  absl::StatusOr<std::vector<float>> ReadFloats(const TensorField& field) const;
  absl::StatusOr<std::vector<uint8_t>> ReadBytes(const TensorField& field) const;
  // An error about a field.
  absl::Status Error(const std::string& field, const std::string& what) const;

 private:
  std::string name_, path_;
  std::vector<TensorField> fields_;
};

// Measured materials have a dozen fields, the largest a few hundred megabytes.
inline constexpr uint64_t kTensorFileBytesMax = uint64_t{1} << 30;
inline constexpr uint32_t kTensorFieldsMax = 256;
inline constexpr uint16_t kTensorRankMax = 16;
inline constexpr uint16_t kTensorNameBytesMax = 256;

}  // namespace sheaf
