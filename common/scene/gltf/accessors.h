// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Accessors: typed arrays of a glTF file (glTF 2.0 specification, sec. 3.6): views of buffers with
// offsets and strides, sparse changes, normalized integers. Every access is checked.
#pragma once

#include "common/scene/gltf/tinygltf_door.h"

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "common/scene/file_source.h"
#include "common/scene/pbrt/syntax/diagnostics.h"
#include "common/scene/scene_reader_limits.h"

namespace sheaf::gltf {

// The limits with a memory that fits the bytes of the files: a file may claim elements that it does
// not have, and name the same ones many times.
SceneReaderLimits LimitsFor(const tinygltf::Model& model, const std::string& main_file,
                            FileSource& files, const SceneReaderLimits& limits);

class Accessors {
 public:
  // All arguments must outlive this.
  Accessors(const tinygltf::Model* model, Diagnostics* diagnostics, const SceneReaderLimits& limits)
      : model_(model),
        diagnostics_(diagnostics),
        limits_(limits),
        bytes_left_(limits.memory_bytes_max) {}

  // The elements of an accessor, component after component. Integers become floats, in [0, 1] or
  // [-1, 1] where the accessor is normalized. what: its role, for messages. Nothing after an error,
  // which is reported.
  std::optional<std::vector<float>> Floats(int accessor, int components, const std::string& what);
  // The same for indices: unsigned integers that are not normalized.
  std::optional<std::vector<uint32_t>> Integers(int accessor, int components,
                                                const std::string& what);
  // False, after an error, if the scene would need more memory than the limit.
  bool Charge(uint64_t bytes);

 private:
  // Bytes of `count` elements, `stride` apart.
  struct Elements {
    const unsigned char* first = nullptr;
    size_t stride = 0;
  };
  struct Shape {
    int component_type = 0;
    size_t components = 0;
    size_t size() const;
  };

  std::nullopt_t Fail(int accessor, const std::string& what, const std::string& problem);
  // Null, with the reason in problem, if the elements do not lie within the view.
  std::optional<Elements> Locate(int view, uint64_t offset, uint64_t count, size_t size,
                                 bool has_stride, std::string* problem) const;
  template <typename T>
  std::optional<std::vector<T>> Read(int accessor, int components, const std::string& what);
  template <typename T>
  bool ReadSparse(const tinygltf::Accessor& accessor, const Shape& shape, std::vector<T>* values,
                  std::string* problem) const;

  const tinygltf::Model* model_;
  Diagnostics* diagnostics_;
  const SceneReaderLimits limits_;
  uint64_t bytes_left_;
};

}  // namespace sheaf::gltf
