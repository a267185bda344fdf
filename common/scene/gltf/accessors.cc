// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "common/scene/gltf/accessors.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstring>
#include <filesystem>
#include <limits>
#include <system_error>
#include <type_traits>

#include "absl/strings/str_cat.h"
#include "common/scene/gltf/values.h"

namespace sheaf::gltf {
namespace {

static_assert(std::endian::native == std::endian::little);

template <typename Source>
float FloatOf(const unsigned char* bytes, bool normalized) {
  Source value;
  std::memcpy(&value, bytes, sizeof value);
  if constexpr (std::is_floating_point_v<Source>) {
    return static_cast<float>(value);
  } else {
    // Source: glTF 2.0 specification, sec. 3.6.2.2.
    const auto number = static_cast<float>(value);
    if (!normalized) return number;
    return std::max(number / static_cast<float>(std::numeric_limits<Source>::max()), -1.0f);
  }
}

float LoadFloat(const unsigned char* bytes, int type, bool normalized) {
  switch (type) {
    case TINYGLTF_COMPONENT_TYPE_BYTE:
      return FloatOf<int8_t>(bytes, normalized);
    case TINYGLTF_COMPONENT_TYPE_UNSIGNED_BYTE:
      return FloatOf<uint8_t>(bytes, normalized);
    case TINYGLTF_COMPONENT_TYPE_SHORT:
      return FloatOf<int16_t>(bytes, normalized);
    case TINYGLTF_COMPONENT_TYPE_UNSIGNED_SHORT:
      return FloatOf<uint16_t>(bytes, normalized);
    case TINYGLTF_COMPONENT_TYPE_UNSIGNED_INT:
      return FloatOf<uint32_t>(bytes, normalized);
    default:
      return FloatOf<float>(bytes, normalized);
  }
}

uint32_t LoadInteger(const unsigned char* bytes, int type) {
  uint32_t value = 0;
  const size_t size = type == TINYGLTF_COMPONENT_TYPE_UNSIGNED_BYTE    ? 1
                      : type == TINYGLTF_COMPONENT_TYPE_UNSIGNED_SHORT ? 2
                                                                       : 4;
  std::memcpy(&value, bytes, size);
  return value;
}

bool IsUnsigned(int type) {
  return type == TINYGLTF_COMPONENT_TYPE_UNSIGNED_BYTE ||
         type == TINYGLTF_COMPONENT_TYPE_UNSIGNED_SHORT ||
         type == TINYGLTF_COMPONENT_TYPE_UNSIGNED_INT;
}

size_t BytesOfComponent(int type) {
  switch (type) {
    case TINYGLTF_COMPONENT_TYPE_BYTE:
    case TINYGLTF_COMPONENT_TYPE_UNSIGNED_BYTE:
      return 1;
    case TINYGLTF_COMPONENT_TYPE_SHORT:
    case TINYGLTF_COMPONENT_TYPE_UNSIGNED_SHORT:
      return 2;
    case TINYGLTF_COMPONENT_TYPE_UNSIGNED_INT:
    case TINYGLTF_COMPONENT_TYPE_FLOAT:
      return 4;
    default:
      return 0;
  }
}

size_t ComponentsOf(int type) {
  switch (type) {
    case TINYGLTF_TYPE_SCALAR:
      return 1;
    case TINYGLTF_TYPE_VEC2:
      return 2;
    case TINYGLTF_TYPE_VEC3:
      return 3;
    case TINYGLTF_TYPE_VEC4:
      return 4;
    case TINYGLTF_TYPE_MAT4:
      return 16;
    default:
      return 0;
  }
}

template <typename T>
T LoadComponent(const unsigned char* bytes, int type, bool normalized) {
  if constexpr (std::is_same_v<T, float>) {
    return LoadFloat(bytes, type, normalized);
  } else {
    return LoadInteger(bytes, type);
  }
}

}  // namespace

SceneReaderLimits LimitsFor(const tinygltf::Model& model, const std::string& main_file,
                            FileSource& files, const SceneReaderLimits& limits) {
  uint64_t bytes = 0;
  std::error_code unknown;
  const absl::StatusOr<std::string> path = files.LocalPath(main_file);
  const uintmax_t main_bytes = path.ok() ? std::filesystem::file_size(*path, unknown) : 0;
  if (!unknown) bytes += main_bytes;
  for (const tinygltf::Buffer& buffer : model.buffers) bytes += buffer.data.size();
  const uint64_t expanded = limits.expansion_bytes + limits.expansion_factor * bytes;
  SceneReaderLimits fitting = limits;
  if (expanded >= limits.memory_bytes_max) return fitting;
  fitting.memory_bytes_max = expanded;
  fitting.memory_limit = absl::StrCat("expansion_bytes, and expansion_factor ",
                                      limits.expansion_factor, " times the bytes of its files");
  return fitting;
}

size_t Accessors::Shape::size() const { return components * BytesOfComponent(component_type); }

std::nullopt_t Accessors::Fail(int accessor, const std::string& what, const std::string& problem) {
  diagnostics_->Error(kFile, absl::StrCat("accessor ", accessor, " (", what, ") ", problem,
                                          "; export the file again"));
  return std::nullopt;
}

bool Accessors::Charge(uint64_t bytes) {
  if (bytes <= bytes_left_) {
    bytes_left_ -= bytes;
    return true;
  }
  diagnostics_->MemoryError(
      kFile, absl::StrCat("the scene needs more memory than the limit of ",
                          limits_.memory_bytes_max, " bytes (", limits_.memory_limit, ")"));
  return false;
}

std::optional<Accessors::Elements> Accessors::Locate(int view, uint64_t offset, uint64_t count,
                                                     size_t size, bool has_stride,
                                                     std::string* problem) const {
  if (!HasIndex(model_->bufferViews, view)) {
    *problem = absl::StrCat("refers to buffer view ", view, ", which does not exist");
    return std::nullopt;
  }
  const tinygltf::BufferView& found = model_->bufferViews[static_cast<size_t>(view)];
  if (!HasIndex(model_->buffers, found.buffer)) {
    *problem = absl::StrCat("refers to buffer ", found.buffer, ", which does not exist");
    return std::nullopt;
  }
  const std::vector<unsigned char>& data = model_->buffers[static_cast<size_t>(found.buffer)].data;
  if (found.byteOffset > data.size() || found.byteLength > data.size() - found.byteOffset) {
    *problem = absl::StrCat("uses buffer view ", view, ", which ends after its buffer");
    return std::nullopt;
  }
  const uint64_t stride = has_stride && found.byteStride > 0 ? found.byteStride : size;
  // The last element ends at offset + (count - 1) * stride + size; nothing here overflows.
  if (stride < size || offset > found.byteLength || found.byteLength - offset < size ||
      (found.byteLength - offset - size) / stride < count - 1) {
    *problem = absl::StrCat("has ", count, " elements, more than buffer view ", view, " has");
    return std::nullopt;
  }
  return Elements{data.data() + found.byteOffset + offset, stride};
}

template <typename T>
bool Accessors::ReadSparse(const tinygltf::Accessor& accessor, const Shape& shape,
                           std::vector<T>* values, std::string* problem) const {
  const auto& sparse = accessor.sparse;
  const int index_type = sparse.indices.componentType;
  if (sparse.count <= 0 || static_cast<size_t>(sparse.count) > accessor.count ||
      !IsUnsigned(index_type) || sparse.indices.byteOffset < 0 || sparse.values.byteOffset < 0) {
    *problem = "has sparse changes with impossible counts or types";
    return false;
  }
  const auto count = static_cast<uint64_t>(sparse.count);
  const size_t index_size = BytesOfComponent(index_type);
  const std::optional<Elements> indices =
      Locate(sparse.indices.bufferView, static_cast<uint64_t>(sparse.indices.byteOffset), count,
             index_size, false, problem);
  if (!indices) return false;
  const std::optional<Elements> changes =
      Locate(sparse.values.bufferView, static_cast<uint64_t>(sparse.values.byteOffset), count,
             shape.size(), false, problem);
  if (!changes) return false;
  const size_t component_size = BytesOfComponent(shape.component_type);
  for (size_t i = 0; i < count; ++i) {
    const size_t at = LoadInteger(indices->first + i * index_size, index_type);
    if (at >= accessor.count) {
      *problem = absl::StrCat("changes element ", at, " of ", accessor.count);
      return false;
    }
    for (size_t c = 0; c < shape.components; ++c) {
      (*values)[at * shape.components + c] =
          LoadComponent<T>(changes->first + i * changes->stride + c * component_size,
                           shape.component_type, accessor.normalized);
    }
  }
  return true;
}

template <typename T>
std::optional<std::vector<T>> Accessors::Read(int index, int components, const std::string& what) {
  if (!HasIndex(model_->accessors, index)) return Fail(index, what, "does not exist");
  const tinygltf::Accessor& accessor = model_->accessors[static_cast<size_t>(index)];
  const Shape shape{accessor.componentType, ComponentsOf(accessor.type)};
  if (shape.components != static_cast<size_t>(components)) {
    return Fail(index, what, absl::StrCat("must have ", components, " components"));
  }
  if (shape.size() == 0) return Fail(index, what, "has an unknown component type");
  if (std::is_same_v<T, uint32_t> && !IsUnsigned(accessor.componentType)) {
    return Fail(index, what, "must hold unsigned integers");
  }
  if (accessor.count == 0) return Fail(index, what, "is empty");
  if (accessor.count > std::numeric_limits<uint32_t>::max()) {
    return Fail(index, what, "has more than 2^32 elements");
  }
  std::string problem;
  std::optional<Elements> elements;
  if (accessor.bufferView >= 0) {
    elements = Locate(accessor.bufferView, accessor.byteOffset, accessor.count, shape.size(), true,
                      &problem);
    // Told before a lack of memory, which it would look like.
    if (!elements) return Fail(index, what, problem);
  }
  const uint64_t total = uint64_t{accessor.count} * shape.components;
  if (!Charge(total * sizeof(T))) return std::nullopt;
  std::vector<T> values(total);  // Zeros without a view, which sparse changes may follow.
  if (elements) {
    const size_t component_size = BytesOfComponent(shape.component_type);
    for (size_t i = 0; i < accessor.count; ++i) {
      const unsigned char* element = elements->first + i * elements->stride;
      for (size_t c = 0; c < shape.components; ++c) {
        values[i * shape.components + c] = LoadComponent<T>(
            element + c * component_size, shape.component_type, accessor.normalized);
      }
    }
  }
  if (accessor.sparse.isSparse && !ReadSparse(accessor, shape, &values, &problem)) {
    return Fail(index, what, problem);
  }
  if constexpr (std::is_same_v<T, float>) {
    for (const float value : values) {
      if (!std::isfinite(value)) return Fail(index, what, "holds a number that is not finite");
    }
  }
  return values;
}

std::optional<std::vector<float>> Accessors::Floats(int accessor, int components,
                                                    const std::string& what) {
  return Read<float>(accessor, components, what);
}

std::optional<std::vector<uint32_t>> Accessors::Integers(int accessor, int components,
                                                         const std::string& what) {
  return Read<uint32_t>(accessor, components, what);
}

}  // namespace sheaf::gltf
