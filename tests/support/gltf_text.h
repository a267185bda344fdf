// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Texts of glTF files of one triangle, for tests of the reader.
#pragma once

#include <cstdint>
#include <string>

#include "absl/status/statusor.h"
#include "absl/strings/escaping.h"
#include "absl/strings/str_cat.h"
#include "common/base/file.h"
#include "common/scene/file_source.h"
#include "common/scene/gltf/gltf_reader.h"
#include "gtest/gtest.h"

namespace sheaf::testing {

// One triangle: 3 positions (36 bytes), 3 uvs (24), 3 indices (6), then animation times 0 1 (8),
// translations (24), four numbers of a rotation by 90 degrees about z after the identity (32).
inline std::string Buffer() {
  std::string bytes;
  const auto put = [&](const auto& values) {
    bytes.append(reinterpret_cast<const char*>(values), sizeof values);
  };
  const float positions[] = {0, 0, 0, 1, 0, 0, 0, 1, 0}, uvs[] = {0, 0, 1, 0, 0, 1};
  const uint16_t indices[] = {0, 1, 2, 0};  // One more for the alignment.
  const float times[] = {0, 1}, moves[] = {0, 0, 0, 2, 0, 0};
  const float turns[] = {0, 0, 0, 1, 0, 0, 0.70710678f, 0.70710678f};
  put(positions);
  put(uvs);
  put(indices);
  put(times);
  put(moves);
  put(turns);
  return bytes;
}

inline constexpr char kAccessors[] = R"("accessors": [
  {"bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3"},
  {"bufferView": 1, "componentType": 5126, "count": 3, "type": "VEC2"},
  {"bufferView": 2, "componentType": 5123, "count": 3, "type": "SCALAR"},
  {"bufferView": 3, "componentType": 5126, "count": 2, "type": "SCALAR"},
  {"bufferView": 4, "componentType": 5126, "count": 2, "type": "VEC3"},
  {"bufferView": 5, "componentType": 5126, "count": 2, "type": "VEC4"}],
"bufferViews": [
  {"buffer": 0, "byteOffset": 0, "byteLength": 36},
  {"buffer": 0, "byteOffset": 36, "byteLength": 24},
  {"buffer": 0, "byteOffset": 60, "byteLength": 6},
  {"buffer": 0, "byteOffset": 68, "byteLength": 8},
  {"buffer": 0, "byteOffset": 76, "byteLength": 24},
  {"buffer": 0, "byteOffset": 100, "byteLength": 32}],)";
inline constexpr char kMesh[] = R"("meshes": [{"name": "leaf", "primitives": [
  {"attributes": {"POSITION": 0, "TEXCOORD_0": 1}, "indices": 2, "material": 0}]}],)";

inline std::string File(const std::string& rest, const std::string& mesh = kMesh,
                        const std::string& accessors = kAccessors) {
  const std::string buffer = Buffer();
  return absl::StrCat(R"({"asset": {"version": "2.0"}, "buffers": [{"byteLength": )", buffer.size(),
                      R"(, "uri": "data:application/octet-stream;base64,)",
                      absl::Base64Escape(buffer), "\"}],", accessors, mesh, rest, "}");
}

// The notes name the file a.gltf; "wood.png" beside it need not exist.
inline absl::StatusOr<ReadSceneResult> Read(const std::string& text, const GltfView& view = {},
                                            const SceneReaderLimits& limits = {}) {
  const std::string path = ::testing::TempDir() + "/a.gltf";
  EXPECT_TRUE(WriteFileOnce(path, text).ok());
  TableFileSource files({{"a.gltf", path}, {"wood.png", "/nowhere/wood.png"}});
  return ReadGltf("a.gltf", files, view, limits);
}

inline const std::string kOneNode = R"("materials": [{"name": "green", "pbrMetallicRoughness": {
  "baseColorFactor": [0, 1, 0, 1], "metallicFactor": 0.25}}],
  "nodes": [{"mesh": 0, "translation": [1, 2, 3]}], "scenes": [{"nodes": [0]}])";

inline std::string Notes(const ReadSceneResult& read) {
  std::string notes;
  for (const SceneDiagnostic& d : read.diagnostics) absl::StrAppend(&notes, d.text, "\n");
  return notes;
}

}  // namespace sheaf::testing
