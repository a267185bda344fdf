// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Files that Draco and meshoptimizer compress, by the encoders of both libraries.
#include <draco/compression/encode.h>
#include <draco/mesh/triangle_soup_mesh_builder.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <meshoptimizer.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <memory>
#include <string>
#include <vector>

#include "absl/strings/escaping.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_replace.h"
#include "common/base/file.h"
#include "common/scene/file_source.h"
#include "common/scene/gltf/gltf_reader.h"

namespace sheaf {
namespace {

using ::testing::HasSubstr;

constexpr char kNode[] = R"("materials": [{}], "nodes": [{"mesh": 0}], "scenes": [{"nodes": [0]}])";

// A grid of `side` x `side` squares with z = x y / 8, and its uv.
struct Grid {
  explicit Grid(int side) {
    for (int y = 0; y <= side; ++y) {
      for (int x = 0; x <= side; ++x) {
        const auto u = static_cast<float>(x), v = static_cast<float>(y);
        positions.push_back({u, v, u * v / 8});
        uvs.push_back({u / static_cast<float>(side), v / static_cast<float>(side)});
      }
    }
    const auto row = static_cast<uint32_t>(side + 1);
    for (uint32_t y = 0; y + 1 < row; ++y) {
      for (uint32_t x = 0; x + 1 < row; ++x) {
        const uint32_t a = y * row + x;
        indices.insert(indices.end(), {a, a + 1, a + row + 1, a, a + row + 1, a + row});
      }
    }
  }
  std::vector<std::array<float, 3>> positions;
  std::vector<std::array<float, 2>> uvs;
  std::vector<uint32_t> indices;
};

std::string Bytes(const void* first, size_t size) {
  return {static_cast<const char*>(first), size};
}

std::string BufferText(const std::string& bytes) {
  return absl::StrCat(R"({"byteLength": )", bytes.size(),
                      R"(, "uri": "data:application/octet-stream;base64,)",
                      absl::Base64Escape(bytes), "\"}");
}

absl::StatusOr<ReadSceneResult> ReadCompressed(const std::string& file,
                                               const SceneReaderLimits& limits = {}) {
  const std::string path = ::testing::TempDir() + "/compressed.gltf";
  EXPECT_TRUE(WriteFileOnce(path, file).ok());
  TableFileSource files({{"a.gltf", path}});
  return ReadGltf("a.gltf", files, {}, limits);
}

std::string ErrorOf(const std::string& file, const SceneReaderLimits& limits = {}) {
  const auto read = ReadCompressed(file, limits);
  return std::string(read.ok() ? "" : read.status().message());
}

// Corners of the triangles, each with its position, in an order that does not depend on that of the
// triangles and of their corners.
std::vector<std::array<float, 3>> CornersOf(const TriangleMesh& mesh) {
  std::vector<std::array<float, 3>> corners;
  for (const uint32_t index : mesh.indices) {
    const Vec3f& p = mesh.positions[index];
    corners.push_back({std::round(p.x), std::round(p.y), p.z});
  }
  std::sort(corners.begin(), corners.end());
  return corners;
}

std::vector<std::array<float, 3>> CornersOf(const Grid& grid) {
  TriangleMesh mesh;
  for (const auto& p : grid.positions) mesh.positions.push_back({p[0], p[1], p[2]});
  mesh.indices = grid.indices;
  return CornersOf(mesh);
}

void ExpectSameSurface(const TriangleMesh& mesh, const Grid& grid, float tolerance) {
  const auto corners = CornersOf(mesh), expected = CornersOf(grid);
  ASSERT_EQ(corners.size(), expected.size());
  for (size_t i = 0; i < corners.size(); ++i) {
    EXPECT_EQ(corners[i][0], expected[i][0]);
    EXPECT_EQ(corners[i][1], expected[i][1]);
    EXPECT_NEAR(corners[i][2], expected[i][2], tolerance);
  }
}

// A Draco mesh: positions with the id 7, uv with the id 3.
std::string DracoOf(const Grid& grid, draco::MeshEncoderMethod method) {
  draco::TriangleSoupMeshBuilder builder;
  const auto triangles = static_cast<int>(grid.indices.size() / 3);
  builder.Start(triangles);
  const int positions =
      builder.AddAttribute(draco::GeometryAttribute::POSITION, 3, draco::DT_FLOAT32);
  const int uvs = builder.AddAttribute(draco::GeometryAttribute::TEX_COORD, 2, draco::DT_FLOAT32);
  for (int t = 0; t < triangles; ++t) {
    const uint32_t* corner = &grid.indices[static_cast<size_t>(3 * t)];
    const auto set = [&](int attribute, const auto& values) {
      builder.SetAttributeValuesForFace(attribute, draco::FaceIndex(static_cast<uint32_t>(t)),
                                        values[corner[0]].data(), values[corner[1]].data(),
                                        values[corner[2]].data());
    };
    set(positions, grid.positions);
    set(uvs, grid.uvs);
  }
  const std::unique_ptr<draco::Mesh> mesh = builder.Finalize();
  mesh->attribute(positions)->set_unique_id(7);
  mesh->attribute(uvs)->set_unique_id(3);
  draco::Encoder encoder;
  encoder.SetEncodingMethod(method);
  encoder.SetAttributeQuantization(draco::GeometryAttribute::POSITION, 14);
  encoder.SetAttributeQuantization(draco::GeometryAttribute::TEX_COORD, 12);
  draco::EncoderBuffer buffer;
  EXPECT_TRUE(encoder.EncodeMeshToBuffer(*mesh, &buffer).ok());
  return Bytes(buffer.data(), buffer.size());
}

constexpr char kDracoAttributes[] = R"("attributes": {"POSITION": 7, "TEXCOORD_0": 3})";

std::string DracoPrimitive(const std::string& attributes = kDracoAttributes) {
  return absl::StrCat(R"({"attributes": {"POSITION": 0, "TEXCOORD_0": 1}, "indices": 2,
    "material": 0, "extensions": {"KHR_draco_mesh_compression": {"bufferView": 0, )",
                      attributes, "}}}");
}

// A file of Draco primitives, whose accessors claim these numbers of vertices and indices.
std::string DracoFile(const std::string& draco, size_t vertices, size_t indices,
                      const std::string& primitives = DracoPrimitive()) {
  return absl::StrCat(R"({"asset": {"version": "2.0"}, "extensionsUsed":
    ["KHR_draco_mesh_compression"], "extensionsRequired": ["KHR_draco_mesh_compression"],
    "buffers": [)",
                      BufferText(draco), R"(], "bufferViews": [{"buffer": 0, "byteLength": )",
                      draco.size(), R"(}], "accessors": [
    {"componentType": 5126, "count": )",
                      vertices, R"(, "type": "VEC3"},
    {"componentType": 5126, "count": )",
                      vertices, R"(, "type": "VEC2"},
    {"componentType": 5123, "count": )",
                      indices, R"(, "type": "SCALAR"}], "meshes": [{"primitives": [)", primitives,
                      "]}], ", kNode, "}");
}

TEST(CompressedGltfTest, ReadsDracoMeshesOfBothMethods) {
  const Grid grid(9);
  for (const auto method : {draco::MESH_SEQUENTIAL_ENCODING, draco::MESH_EDGEBREAKER_ENCODING}) {
    const auto read = ReadCompressed(
        DracoFile(DracoOf(grid, method), grid.positions.size(), grid.indices.size()));
    ASSERT_TRUE(read.ok()) << read.status();
    ASSERT_EQ(read->scene.meshes.size(), 1u);
    const TriangleMesh& mesh = read->scene.meshes[0];
    ExpectSameSurface(mesh, grid, 2e-3f);
    ASSERT_EQ(mesh.uvs.size(), mesh.positions.size());
    for (size_t v = 0; v < mesh.uvs.size(); ++v) {
      EXPECT_NEAR(mesh.uvs[v].x, mesh.positions[v].x / 9, 1e-3f);
      EXPECT_NEAR(1 - mesh.uvs[v].y, mesh.positions[v].y / 9, 1e-3f);
    }
  }
}

TEST(CompressedGltfTest, PrimitivesOfOneDracoMeshShareIt) {
  const Grid grid(20);
  const std::string draco = DracoOf(grid, draco::MESH_EDGEBREAKER_ENCODING);
  std::string primitives = DracoPrimitive();
  for (int i = 1; i < 50; ++i) primitives += ", " + DracoPrimitive();
  SceneReaderLimits limits;
  limits.memory_bytes_max = 8 << 20;  // 50 primitives of 30 KB each, and decoding once.
  const auto read = ReadCompressed(
      DracoFile(draco, grid.positions.size(), grid.indices.size(), primitives), limits);
  ASSERT_TRUE(read.ok()) << read.status();
  EXPECT_EQ(read->scene.meshes.size(), 50u);
}

TEST(CompressedGltfTest, DracoSaysWhatIsWrong) {
  const Grid grid(4);
  const size_t vertices = grid.positions.size(), indices = grid.indices.size();
  const std::string draco = DracoOf(grid, draco::MESH_EDGEBREAKER_ENCODING);
  const auto with = [&](const std::string& primitive) {
    return ErrorOf(DracoFile(draco, vertices, indices, DracoPrimitive(primitive)));
  };
  const std::string where =
      "a.gltf: mesh 0, primitive 0: the Draco mesh "
      "(KHR_draco_mesh_compression) ";
  EXPECT_THAT(
      ErrorOf(DracoFile(draco, vertices, 6)),
      HasSubstr(where + "has 32 triangles, but its accessors only 2; compress the file again"));
  EXPECT_THAT(with(R"("attributes": {"POSITION": 4})"), HasSubstr("has no attribute 4 (POSITION)"));
  EXPECT_THAT(with(R"("attributes": {"POSITION": 3})"),
              HasSubstr("has 2 components of POSITION, its accessor 3"));
  EXPECT_THAT(with(R"("attributes": {"NORMAL": 3})"),
              HasSubstr("has NORMAL, for which the primitive has no accessor"));
  EXPECT_THAT(with(R"("x": 0)"), HasSubstr("names no attributes"));
  EXPECT_THAT(ErrorOf(DracoFile("DRACO", vertices, indices)), HasSubstr("does not begin as Draco"));
  for (size_t size = 12; size < draco.size(); size += 7) {
    EXPECT_THAT(ErrorOf(DracoFile(draco.substr(0, size), vertices, indices)), HasSubstr(where));
  }
}

TEST(CompressedGltfTest, DracoTakesNoMemoryBeyondTheLimit) {
  const Grid grid(4);
  std::string draco = DracoOf(grid, draco::MESH_SEQUENTIAL_ENCODING);
  // A sequential mesh begins, after a header of 11 bytes, with its triangles and vertices.
  draco.replace(11, 2, std::string("\xff\xff\xff\xff\x03\x10", 6));  // 2^30 - 1 triangles.
  SceneReaderLimits limits;
  limits.memory_bytes_max = 1 << 20;
  const auto read = ReadCompressed(DracoFile(draco, 25, size_t{3} << 30), limits);
  EXPECT_EQ(read.status().code(), absl::StatusCode::kResourceExhausted) << read.status();
  EXPECT_THAT(read.status().message(),
              HasSubstr("needs more memory than the limit of 1048576 bytes"));
}

// Buffers and views of a file that meshoptimizer compresses: the first buffer holds what is
// compressed, the second is a fallback without bytes.
class MeshoptFile {
 public:
  void Add(const std::string& encoded, const std::string& mode, size_t count, size_t stride,
           const std::string& filter = "NONE") {
    absl::StrAppend(&views_, views_.empty() ? "" : ", ", R"({"buffer": 1, "byteOffset": )",
                    plain_bytes_, R"(, "byteLength": )", count * stride);
    if (mode == "ATTRIBUTES") absl::StrAppend(&views_, R"(, "byteStride": )", stride);
    absl::StrAppend(&views_, R"(, "extensions": {"EXT_meshopt_compression": {"buffer": 0,
      "byteOffset": )",
                    bytes_.size(), R"(, "byteLength": )", encoded.size(), R"(, "byteStride": )",
                    stride, R"(, "count": )", count, R"(, "mode": ")", mode, R"(", "filter": ")",
                    filter, "\"}}}");
    plain_bytes_ += count * stride;
    bytes_ += encoded;
    bytes_.resize((bytes_.size() + 3) / 4 * 4);
  }

  std::string Json(const std::string& buffer, const std::string& accessors) const {
    return absl::StrCat(R"({"asset": {"version": "2.0"}, "extensionsUsed":
      ["EXT_meshopt_compression", "KHR_mesh_quantization"], "extensionsRequired":
      ["EXT_meshopt_compression", "KHR_mesh_quantization"], "buffers": [)",
                        buffer, R"(, {"byteLength": )", plain_bytes_,
                        R"(, "extensions": {"EXT_meshopt_compression": {"fallback": true}}}],
      "bufferViews": [)",
                        views_, R"(], "accessors": [)", accessors, R"(], "meshes": [
      {"primitives": [{"attributes": {"POSITION": 0, "NORMAL": 1}, "indices": 2,
        "material": 0}]}], )",
                        kNode, "}");
  }
  std::string Text(const std::string& accessors) const {
    return Json(BufferText(bytes_), accessors);
  }
  std::string Glb(const std::string& accessors) const {
    std::string json = Json(absl::StrCat(R"({"byteLength": )", bytes_.size(), "}"), accessors);
    json.resize((json.size() + 3) / 4 * 4, ' ');
    const auto word = [](size_t value) {
      const auto number = static_cast<uint32_t>(value);
      return Bytes(&number, sizeof number);
    };
    return absl::StrCat("glTF", word(2), word(28 + json.size() + bytes_.size()), word(json.size()),
                        "JSON", json, word(bytes_.size()), std::string("BIN\0", 4), bytes_);
  }

 private:
  std::string bytes_, views_;
  size_t plain_bytes_ = 0;
};

std::string EncodedVertices(const void* vertices, size_t count, size_t stride) {
  std::vector<unsigned char> out(meshopt_encodeVertexBufferBound(count, stride));
  out.resize(meshopt_encodeVertexBuffer(out.data(), out.size(), vertices, count, stride));
  return Bytes(out.data(), out.size());
}

std::string EncodedIndices(const Grid& grid, bool is_sequence) {
  const size_t vertices = grid.positions.size(), count = grid.indices.size();
  std::vector<unsigned char> out(is_sequence ? meshopt_encodeIndexSequenceBound(count, vertices)
                                             : meshopt_encodeIndexBufferBound(count, vertices));
  out.resize(is_sequence
                 ? meshopt_encodeIndexSequence(out.data(), out.size(), grid.indices.data(), count)
                 : meshopt_encodeIndexBuffer(out.data(), out.size(), grid.indices.data(), count));
  return Bytes(out.data(), out.size());
}

// Numbers as the exponential filter has them: an exponent and 24 bits of a whole number.
std::vector<uint32_t> Exponential(const Grid& grid) {
  std::vector<uint32_t> words;
  for (const auto& p : grid.positions) {
    for (const float x : p) {
      words.push_back((static_cast<uint32_t>(-8) << 24) |
                      (static_cast<uint32_t>(std::lround(x * 256)) & 0xffffff));
    }
  }
  return words;
}

std::vector<std::array<float, 4>> Normals(const Grid& grid) {
  std::vector<std::array<float, 4>> normals;
  for (const auto& p : grid.positions) {
    const float x = -p[1] / 8, y = -p[0] / 8, length = std::sqrt(x * x + y * y + 1);
    normals.push_back({x / length, y / length, 1 / length, 0});
  }
  return normals;
}

std::string AccessorsOf(const Grid& grid, int index_type) {
  const size_t count = grid.positions.size();
  return absl::StrCat(R"({"bufferView": 0, "componentType": 5126, "type": "VEC3", "count": )",
                      count,
                      R"(}, {"bufferView": 1, "componentType": 5120, "normalized": true,
    "type": "VEC3", "count": )",
                      count, R"(}, {"bufferView": 2, "componentType": )", index_type,
                      R"(, "type": "SCALAR", "count": )", grid.indices.size(), "}");
}

// Positions by the exponential filter, normals by the octahedral one.
MeshoptFile FilteredFile(const Grid& grid, bool is_sequence, size_t index_bytes) {
  const size_t count = grid.positions.size();
  MeshoptFile file;
  file.Add(EncodedVertices(Exponential(grid).data(), count, 12), "ATTRIBUTES", count, 12,
           "EXPONENTIAL");
  std::vector<unsigned char> octahedral(4 * count);
  meshopt_encodeFilterOct(octahedral.data(), count, 4, 8, Normals(grid)[0].data());
  file.Add(EncodedVertices(octahedral.data(), count, 4), "ATTRIBUTES", count, 4, "OCTAHEDRAL");
  file.Add(EncodedIndices(grid, is_sequence), is_sequence ? "INDICES" : "TRIANGLES",
           grid.indices.size(), index_bytes);
  return file;
}

void ExpectFilteredGrid(const std::string& content, const Grid& grid) {
  const auto read = ReadCompressed(content);
  ASSERT_TRUE(read.ok()) << read.status();
  ASSERT_EQ(read->scene.meshes.size(), 1u);
  const TriangleMesh& mesh = read->scene.meshes[0];
  ExpectSameSurface(mesh, grid, 0);
  const auto normals = Normals(grid);
  ASSERT_EQ(mesh.normals.size(), normals.size());
  for (size_t v = 0; v < normals.size(); ++v) {
    EXPECT_NEAR(mesh.normals[v].x, normals[v][0], 0.02f);
    EXPECT_NEAR(mesh.normals[v].y, normals[v][1], 0.02f);
    EXPECT_NEAR(mesh.normals[v].z, normals[v][2], 0.02f);
  }
}

TEST(CompressedGltfTest, ReadsMeshoptViewsOfAllModesAndFallbacks) {
  const Grid grid(9);
  ExpectFilteredGrid(FilteredFile(grid, false, 2).Text(AccessorsOf(grid, 5123)), grid);
  ExpectFilteredGrid(FilteredFile(grid, true, 4).Text(AccessorsOf(grid, 5125)), grid);
  ExpectFilteredGrid(FilteredFile(grid, false, 4).Glb(AccessorsOf(grid, 5125)), grid);
}

TEST(CompressedGltfTest, ReadsMeshoptByItsLaterName) {
  const Grid grid(9);
  const auto renamed = [](const std::string& text) {
    return absl::StrReplaceAll(text, {{"EXT_meshopt", "KHR_meshopt"}});
  };
  ExpectFilteredGrid(renamed(FilteredFile(grid, false, 2).Text(AccessorsOf(grid, 5123))), grid);
  std::string later = EncodedVertices(grid.positions.data(), 100, 12);
  later[0] = static_cast<char>(later[0] | 1);
  MeshoptFile file;
  for (int v = 0; v < 3; ++v) file.Add(later, "ATTRIBUTES", 100, 12);
  EXPECT_THAT(ErrorOf(renamed(file.Text(AccessorsOf(grid, 5123)))),
              HasSubstr("(KHR_meshopt_compression) is of a later version of the codec"));
}

TEST(CompressedGltfTest, QuaternionsOfMeshoptTurnInstances) {
  const Grid grid(1);
  MeshoptFile file = FilteredFile(grid, false, 2);
  const float turns[] = {0, 0, 0, 1, 0, 0, 0.70710678f, 0.70710678f};
  std::array<int16_t, 8> encoded{};
  meshopt_encodeFilterQuat(encoded.data(), 2, 8, 16, turns);
  file.Add(EncodedVertices(encoded.data(), 2, 8), "ATTRIBUTES", 2, 8, "QUATERNION");
  std::string text = file.Text(AccessorsOf(grid, 5123) + R"(, {"bufferView": 3,
    "componentType": 5122, "normalized": true, "type": "VEC4", "count": 2})");
  const std::string node = R"("nodes": [{"mesh": 0)";
  text.replace(text.find(node), node.size(), node + R"(, "extensions": {"EXT_mesh_gpu_instancing":
    {"attributes": {"ROTATION": 3}}})");
  const auto read = ReadCompressed(text);
  ASSERT_TRUE(read.ok()) << read.status();
  ASSERT_EQ(read->scene.instances.size(), 2u);
  const auto& turned = read->scene.instances[1].world_from_instance.start.m;
  EXPECT_NEAR(turned[0][0], 0, 1e-3);
  EXPECT_NEAR(turned[1][0], 1, 1e-3);
}

TEST(CompressedGltfTest, MeshoptSaysWhatIsWrong) {
  const Grid grid(2);
  const std::string positions = EncodedVertices(grid.positions.data(), 9, 12);
  const std::string accessors = AccessorsOf(grid, 5123);
  const auto error = [&](const std::string& encoded, const char* mode, size_t count, size_t stride,
                         const char* filter) {
    MeshoptFile file;
    file.Add(encoded, mode, count, stride, filter);
    for (int v = 1; v < 3; ++v) file.Add(positions, "ATTRIBUTES", 9, 12);
    return ErrorOf(file.Text(accessors));
  };
  const std::string where = "a.gltf: buffer view 0 (EXT_meshopt_compression) ";
  EXPECT_THAT(error(positions, "ATTRIBUTES", 9, 12, "QUATERNION"), HasSubstr("has the filter"));
  EXPECT_THAT(error(positions, "ATTRIBUTES", 9, 12, "COLOR"),
              HasSubstr("has the filter \"COLOR\""));
  EXPECT_THAT(error(positions, "POINTS", 9, 12, "NONE"), HasSubstr("unknown mode \"POINTS\""));
  EXPECT_THAT(error(positions, "TRIANGLES", 10, 2, "NONE"), HasSubstr("not three for each"));
  EXPECT_THAT(error(positions, "INDICES", 9, 8, "NONE"), HasSubstr("has indices of 8 bytes"));
  EXPECT_THAT(error(positions, "ATTRIBUTES", size_t{1} << 30, 12, "NONE"),
              HasSubstr("hold 1073741824 elements of 12 bytes, more than they can"));
  EXPECT_THAT(error(positions.substr(0, 20), "ATTRIBUTES", 9, 12, "NONE"),
              HasSubstr(where + "is damaged; compress the file again, or export it without"));
  MeshoptFile file;
  for (int v = 0; v < 3; ++v) file.Add(positions, "ATTRIBUTES", 9, 12);
  const auto changed = [&](const std::string& from, const std::string& to) {
    return ErrorOf(absl::StrReplaceAll(file.Text(accessors), {{from, to}}));
  };
  EXPECT_THAT(changed(R"("buffer": 0)", R"("buffer": 9)"),
              HasSubstr(where + "refers to buffer 9, which does not exist"));
  EXPECT_THAT(changed(R"("byteStride": 12, "count")", R"("byteStride": 6, "count")"),
              HasSubstr(where + "has a stride of 6 bytes"));
}

TEST(CompressedGltfTest, MeshoptTakesNoMemoryBeyondTheLimit) {
  const Grid grid(100);
  SceneReaderLimits limits;
  const size_t count = grid.positions.size();
  MeshoptFile file;
  for (int v = 0; v < 3; ++v) {
    file.Add(EncodedVertices(grid.positions.data(), count, 12), "ATTRIBUTES", count, 12);
  }
  limits.memory_bytes_max = uint64_t{100} << 10;
  const auto read = ReadCompressed(file.Text(AccessorsOf(grid, 5123)), limits);
  EXPECT_EQ(read.status().code(), absl::StatusCode::kResourceExhausted) << read.status();
}

}  // namespace
}  // namespace sheaf
