// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "common/scene/formats/ply_reader.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cstring>
#include <fstream>
#include <limits>
#include <string>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "absl/strings/str_replace.h"

namespace sheaf {
namespace {

using ::testing::HasSubstr;

std::string WriteMesh(const std::string& bytes) {
  const auto* info = ::testing::UnitTest::GetInstance()->current_test_info();
  std::string name = std::string(info->test_suite_name()) + "-" + info->name();
  std::replace(name.begin(), name.end(), '/', '-');
  const std::string path = ::testing::TempDir() + "sheaf-" + name + ".ply";
  std::ofstream(path, std::ios::binary) << bytes;
  return path;
}

template <typename T>
void Append(std::string* bytes, T value, bool is_big_endian) {
  char raw[sizeof(T)];
  std::memcpy(raw, &value, sizeof(T));
  if (is_big_endian) std::reverse(raw, raw + sizeof(T));
  bytes->append(raw, sizeof(T));
}

// A unit square of one quad, with a property and an element that a mesh does not need.
std::string BinarySquare(bool is_big_endian) {
  std::string bytes =
      std::string("ply\nformat ") + (is_big_endian ? "binary_big_endian" : "binary_little_endian") +
      " 1.0\ncomment made by hand\nelement vertex 4\nproperty double x\n"
      "property float y\nproperty float z\nproperty uchar red\nproperty float nx\n"
      "property float ny\nproperty float nz\nproperty float s\nproperty float t\n"
      "element edge 1\nproperty int vertex1\nproperty list ushort float weights\n"
      "element face 1\nproperty uchar group\nproperty list uchar uint vertex_index\n"
      "end_header\n";
  for (int i = 0; i < 4; ++i) {
    const float x = i == 1 || i == 2 ? 1.f : 0.f, y = i >= 2 ? 1.f : 0.f;
    Append<double>(&bytes, x, is_big_endian);
    for (const float value : {y, 0.f}) Append(&bytes, value, is_big_endian);
    Append<uint8_t>(&bytes, 7, is_big_endian);
    for (const float value : {0.f, 0.f, 1.f, x, y}) Append(&bytes, value, is_big_endian);
  }
  Append<int32_t>(&bytes, 3, is_big_endian);
  Append<uint16_t>(&bytes, 2, is_big_endian);
  for (const float value : {1.f, 2.f}) Append(&bytes, value, is_big_endian);
  for (const uint8_t value : {uint8_t{1}, uint8_t{4}}) Append(&bytes, value, is_big_endian);
  for (const uint32_t value : {0u, 1u, 2u, 3u}) Append(&bytes, value, is_big_endian);
  return bytes;
}

// A mesh about the origin of its file.
absl::StatusOr<TriangleMesh> ReadMesh(const std::string& path, const SceneReaderLimits& limits) {
  absl::StatusOr<PlyMesh> read = ReadPly(path, limits);
  if (!read.ok()) return read.status();
  EXPECT_EQ(read->origin, Vec3d{});
  return std::move(read->mesh);
}

void ExpectSquare(const absl::StatusOr<TriangleMesh>& mesh) {
  ASSERT_TRUE(mesh.ok()) << mesh.status().message();
  EXPECT_EQ(mesh->indices, (std::vector<uint32_t>{0, 1, 2, 0, 2, 3}));
  ASSERT_EQ(mesh->positions.size(), 4u);
  EXPECT_EQ(mesh->positions[2], (Vec3f{1, 1, 0}));
  ASSERT_EQ(mesh->normals.size(), 4u);
  EXPECT_EQ(mesh->normals[3], (Vec3f{0, 0, 1}));
  ASSERT_EQ(mesh->uvs.size(), 4u);
  EXPECT_EQ(mesh->uvs[1], (Vec2f{1, 0}));
}

constexpr char kAsciiHead[] =
    "ply\r\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\n"
    "property float z\nelement face 1\nproperty list uchar int vertex_indices\nend_header\n";

TEST(PlyReaderTest, ReadsBothByteOrders) {
  ExpectSquare(ReadMesh(WriteMesh(BinarySquare(false)), {}));
  ExpectSquare(ReadMesh(WriteMesh(BinarySquare(true)), {}));
}

TEST(PlyReaderTest, ReadsAsciiWithoutATrailingNewline) {
  const auto mesh =
      ReadMesh(WriteMesh(absl::StrCat(kAsciiHead, "0 0 0\n1 0 0\n0 1e-50 2.5\n3 0 1 2")), {});
  ASSERT_TRUE(mesh.ok()) << mesh.status().message();
  EXPECT_EQ(mesh->positions[2], (Vec3f{0, 0, 2.5f}));
  EXPECT_EQ(mesh->indices, (std::vector<uint32_t>{0, 1, 2}));
  EXPECT_TRUE(mesh->normals.empty());
}

// A triangle of float properties alone, whose rows are read at once where the bytes have this
// order.
std::string FloatTriangle(bool is_big_endian, int32_t last_index) {
  std::string bytes =
      std::string("ply\nformat ") + (is_big_endian ? "binary_big_endian" : "binary_little_endian") +
      " 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\n"
      "property float quality\nproperty float u\nproperty float v\n"
      "element face 1\nproperty list uchar int vertex_indices\nend_header\n";
  for (int i = 0; i < 3; ++i) {
    const auto at = static_cast<float>(i);
    for (const float value : {at, at * at, 2.5f, 9.f, at / 3, 1.f}) {
      Append(&bytes, value, is_big_endian);
    }
  }
  Append<uint8_t>(&bytes, 3, is_big_endian);
  for (const int32_t index : {0, 1, last_index}) Append(&bytes, index, is_big_endian);
  return bytes;
}

TEST(PlyReaderTest, RowsOfFloatsAreReadAsOthers) {
  const auto read = [](const std::string& bytes) { return ReadPly(WriteMesh(bytes), {}); };
  const auto at_once = read(FloatTriangle(false, 2)), one_by_one = read(FloatTriangle(true, 2));
  ASSERT_TRUE(at_once.ok() && one_by_one.ok()) << at_once.status() << one_by_one.status();
  EXPECT_EQ(at_once->mesh.positions, one_by_one->mesh.positions);
  EXPECT_EQ(at_once->mesh.uvs, one_by_one->mesh.uvs);
  EXPECT_EQ(at_once->mesh.uvs[2].x, 2 / 3.f);
  EXPECT_EQ(at_once->mesh.indices, (std::vector<uint32_t>{0, 1, 2}));
  EXPECT_EQ(at_once->skipped.size(), 1) << "the property `quality`";
  for (const int32_t index : {-1, 3}) {
    const absl::Status status = read(FloatTriangle(false, index)).status();
    EXPECT_TRUE(absl::IsInvalidArgument(status)) << index;
    EXPECT_EQ(status, read(FloatTriangle(true, index)).status());
  }
  const std::string whole = FloatTriangle(false, 2);
  for (const size_t missing : {size_t{1}, size_t{12}, size_t{13}, size_t{30}}) {
    EXPECT_FALSE(read(whole.substr(0, whole.size() - missing)).ok());
  }
}

// Coordinates of a map, as double: float would keep halves of a unit of them.
TEST(PlyReaderTest, G22CoordinatesOfMapsKeepTheirDigits) {
  for (const bool is_ascii : {false, true}) {
    std::string bytes = absl::StrCat("ply\nformat ", is_ascii ? "ascii" : "binary_little_endian",
                                     " 1.0\nelement vertex 3\nproperty double x\n"
                                     "property double y\nproperty double z\nelement face 1\n"
                                     "property list uchar int vertex_indices\nend_header\n");
    const double corners[3][3] = {
        {500000.125, 5400000.25, 7}, {500001.3, 5400000.1, 7}, {500000.7, 5400001.4, 7.5}};
    for (const auto& corner : corners) {
      for (const double x : corner) {
        if (is_ascii) {
          absl::StrAppend(&bytes, absl::StrFormat("%.10f ", x));
        } else {
          Append(&bytes, x, false);
        }
      }
    }
    if (is_ascii) {
      bytes += "3 0 1 2\n";
    } else {
      Append<uint8_t>(&bytes, 3, false);
      for (const int32_t i : {0, 1, 2}) Append(&bytes, i, false);
    }
    const absl::StatusOr<PlyMesh> read = ReadPly(WriteMesh(bytes), {});
    ASSERT_TRUE(read.ok()) << read.status().message();
    const absl::StatusOr<PlyMesh> about = ReadPly(WriteMesh(bytes), {}, Vec3d{500000, 5400000, 0});
    ASSERT_TRUE(about.ok()) << about.status().message();
    EXPECT_EQ(about->origin, (Vec3d{500000, 5400000, 0}));
    for (size_t v = 0; v < 3; ++v) {
      for (size_t i = 0; i < 3; ++i) {
        EXPECT_NEAR(static_cast<double>(read->mesh.positions[v][i]) + read->origin[i],
                    corners[v][i], 1e-6);
        EXPECT_NEAR(static_cast<double>(about->mesh.positions[v][i]) + about->origin[i],
                    corners[v][i], 1e-6);
      }
    }
  }
}

TEST(PlyReaderTest, EveryTruncationIsAnError) {
  const std::string whole = BinarySquare(false);
  for (size_t size = 0; size < whole.size(); ++size) {
    EXPECT_FALSE(ReadMesh(WriteMesh(whole.substr(0, size)), {}).ok()) << size;
  }
}

TEST(PlyReaderTest, NonFiniteVerticesAreNamed) {
  std::string bytes = BinarySquare(false);
  const float nan = std::numeric_limits<float>::quiet_NaN();
  // The y of vertex 1: a row is 8 + 8 + 1 + 20 bytes.
  std::memcpy(bytes.data() + bytes.find("end_header\n") + 11 + 37 + 8, &nan, sizeof nan);
  EXPECT_THAT(std::string(ReadMesh(WriteMesh(bytes), {}).status().message()),
              HasSubstr("vertex 1: y is not a finite 32-bit float"));
}

struct BadPly {
  const char* name;
  std::string text;
  const char* expected;
};
void PrintTo(const BadPly& bad, std::ostream* out) { *out << bad.name; }

class BadPlyTest : public ::testing::TestWithParam<BadPly> {};

TEST_P(BadPlyTest, IsAClearError) {
  const auto mesh = ReadMesh(WriteMesh(GetParam().text), {});
  ASSERT_FALSE(mesh.ok());
  EXPECT_THAT(std::string(mesh.status().message()), HasSubstr(GetParam().expected));
}

std::vector<BadPly> BadMeshes() {
  const std::string head = kAsciiHead;
  const std::string xyz = "property float x\nproperty float y\nproperty float z\n";
  return {
      {"Empty", "", "line 1: this is not a PLY file"},
      {"NoEnd", "ply\nformat ascii 1.0\n", "ends too early"},
      {"Format", "ply\nformat roman 1.0\nend_header\n", "line 2: the format \"roman\" is unknown"},
      {"NoFormat", "ply\nend_header\n", "no format line"},
      {"Word", "ply\nfromat ascii 1.0\n", "line 2: \"fromat\" is not a keyword of a PLY header"},
      {"Type", "ply\nformat ascii 1.0\nelement vertex 1\nproperty real x\n",
       "line 4: \"property\""},
      {"FloatCount", "ply\nformat ascii 1.0\nelement face 1\nproperty list float int v\n",
       "line 4: the list's count is not of an integer type"},
      {"Count", "ply\nformat ascii 1.0\nelement vertex -3\n", "line 3: \"element\" needs"},
      {"NoZ", "ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nend_header\n1\n",
       "needs the properties x, y and z"},
      {"NoVertices", "ply\nformat ascii 1.0\nend_header\n", "the file has no vertices"},
      {"HugeVertexCount",
       "ply\nformat ascii 1.0\nelement vertex 1099511627776\n" + xyz + "end_header\n",
       "the header claims 1099511627776 elements \"vertex\", more than the file's size can hold"},
      {"HugeFaceCount",
       "ply\nformat binary_little_endian 1.0\nelement vertex 0\n" + xyz +
           "element face 1099511627776\nproperty list uchar int vertex_indices\nend_header\n",
       "the header claims 1099511627776 elements \"face\""},
      {"NotANumber", head + "0 0 0\n1 zero 0\n0 1 0\n3 0 1 2\n",
       "line 11: vertex 1: \"zero\" is not a finite number"},
      {"Nan", head + "0 0 0\n1 nan 0\n0 1 0\n3 0 1 2\n", "line 11: vertex 1: \"nan\""},
      {"FloatOverflow", head + "0 0 0\n1 1e39 0\n0 1 0\n3 0 1 2\n", "vertex 1: y is not a finite"},
      {"IndexRange", head + "0 0 0\n1 0 0\n0 1 0\n3 0 1 3\n",
       "triangle 0 uses vertex 3, but there are only 3 vertices"},
      {"NegativeIndex", head + "0 0 0\n1 0 0\n0 1 0\n3 0 1 -2\n", "face 0: -2 is not the index"},
      {"TwoCorners", head + "0 0 0\n1 0 0\n0 1 0\n2 0 1\n", "face 0 has 2 vertices"},
      {"TruncatedList", head + "0 0 0\n1 0 0\n0 1 0\n3 0 1\n", "face 0: the file ends too early"},
  };
}
INSTANTIATE_TEST_SUITE_P(Diagnostics, BadPlyTest, ::testing::ValuesIn(BadMeshes()),
                         [](const auto& test) { return std::string(test.param.name); });

PlyMesh ReadWhole(const std::string& text) {
  absl::StatusOr<PlyMesh> read = ReadPly(WriteMesh(text), {});
  EXPECT_TRUE(read.ok()) << read.status().message();
  return read.ok() ? *std::move(read) : PlyMesh();
}

double AreaOf(const TriangleMesh& mesh) {
  double area = 0;
  for (size_t i = 0; i < mesh.indices.size(); i += 3) {
    const Vec3d a = ToDouble(mesh.positions[mesh.indices[i]]);
    area += 0.5 * Length(Cross(ToDouble(mesh.positions[mesh.indices[i + 1]]) - a,
                               ToDouble(mesh.positions[mesh.indices[i + 2]]) - a));
  }
  return area;
}

std::vector<std::string> SkippedBy(const PlyMesh& read) {
  std::vector<std::string> lines;
  for (const PlySkipped& skipped : read.skipped) {
    lines.push_back(absl::StrCat(skipped.line, ": ", skipped.before,
                                 skipped.count > 0 ? absl::StrCat(skipped.count) : "",
                                 skipped.after));
  }
  return lines;
}

TEST(PlyReaderTest, ConcaveFacesAreCoveredOnce) {
  // A chevron of area 1, from every corner, with the faces before the vertices too.
  const std::string corners[] = {"-1 -1 0\n", "0 0 0\n", "1 -1 0\n", "0 1 0\n"};
  const std::string vertices =
      "element vertex 4\nproperty float x\nproperty float y\nproperty float z\n";
  const std::string faces = "element face 1\nproperty list uchar int vertex_indices\n";
  for (int first = 0; first < 4; ++first) {
    std::string rows;
    for (int i = 0; i < 4; ++i) rows += corners[(first + i) % 4];
    for (const bool is_first : {true, false}) {
      const PlyMesh read = ReadWhole(
          absl::StrCat("ply\nformat ascii 1.0\n", is_first ? vertices + faces : faces + vertices,
                       "end_header\n", is_first ? rows + "4 0 1 2 3\n" : "4 0 1 2 3\n" + rows));
      EXPECT_EQ(AreaOf(read.mesh), 1) << first;
      EXPECT_EQ(read.skipped.size(), 0u);
    }
  }
}

TEST(PlyReaderTest, FacesThatCrossThemselvesAreCounted) {
  const PlyMesh read = ReadWhole(
      "ply\nformat ascii 1.0\nelement vertex 4\nproperty float x\nproperty float y\n"
      "property float z\nelement face 2\nproperty list uchar int vertex_indices\nend_header\n"
      "0 0 0\n1 1 0\n1 0 0\n0 1 0\n4 0 1 2 3\n4 0 2 1 3\n");
  EXPECT_EQ(read.mesh.indices.size(), 12u);
  ASSERT_EQ(read.skipped.size(), 1u);
  EXPECT_EQ(read.skipped[0].count, 1u);
  EXPECT_THAT(SkippedBy(read)[0], HasSubstr("1 faces cross themselves or lie in no plane"));
}

TEST(PlyReaderTest, ReadsTriangleStrips) {
  const std::string head =
      "ply\nformat ascii 1.0\nelement vertex 6\nproperty float x\nproperty float y\n"
      "property float z\nelement tristrips 1\nproperty list int int vertex_indices\n"
      "end_header\n0 0 0\n1 0 0\n0 1 0\n1 1 0\n0 2 0\n1 2 0\n";
  // Two strips; the second has an odd start.
  PlyMesh read = ReadWhole(head + "9 0 1 2 3 -1 2 3 4 5\n");
  EXPECT_EQ(read.mesh.indices, (std::vector<uint32_t>{0, 1, 2, 2, 1, 3, 2, 3, 4, 4, 3, 5}));
  EXPECT_EQ(AreaOf(read.mesh), 2);
  EXPECT_EQ(read.skipped.size(), 0u);
  // Joined by triangles without area, which keep the turn.
  read = ReadWhole(head + "10 0 1 2 3 3 2 2 3 4 5\n");
  EXPECT_EQ(AreaOf(read.mesh), 2);
  for (size_t i = 0; i < read.mesh.indices.size(); i += 3) {
    const auto at = [&](size_t k) {
      return ToDouble(read.mesh.positions[read.mesh.indices[i + k]]);
    };
    EXPECT_GT(Cross(at(1) - at(0), at(2) - at(0)).z, 0) << i;
  }
  const std::string unsigned_head = absl::StrReplaceAll(head, {{"int int", "int uint"}});
  read = ReadWhole(unsigned_head + "9 0 1 2 3 4294967295 2 3 4 5\n");
  EXPECT_EQ(AreaOf(read.mesh), 2);
  EXPECT_THAT(std::string(ReadMesh(WriteMesh(head + "3 0 1 -2\n"), {}).status().message()),
              HasSubstr("tristrips 0: -2 is not the index of a vertex"));
  EXPECT_THAT(std::string(ReadMesh(WriteMesh(head + "3 0 1 6\n"), {}).status().message()),
              HasSubstr("triangle 0 uses vertex 6"));
}

TEST(PlyReaderTest, FacesOfSeveralElementsAreJoined) {
  const PlyMesh read = ReadWhole(
      "ply\nformat ascii 1.0\nelement vertex 4\nproperty float x\nproperty float y\n"
      "property float z\nelement face 1\nproperty list uchar int vertex_index\n"
      "element face 1\nproperty list uchar int vertex_index\nend_header\n"
      "0 0 0\n1 0 0\n1 1 0\n0 1 0\n3 0 1 2\n3 0 2 3\n");
  EXPECT_EQ(read.mesh.indices.size(), 6u);
}

TEST(PlyReaderTest, ListsWhatHasNoEffect) {
  const PlyMesh read = ReadWhole(
      "ply\nformat ascii 1.0\ncomment TextureFile wood.png\nelement vertex 3\n"
      "property float x\nproperty float y\nproperty float z\nproperty float nx\n"
      "property uchar red\nproperty float s\nelement face 1\n"
      "property list uchar int vertex_indices\nproperty list uchar float texcoord\n"
      "element edge 1\nproperty int vertex1\nend_header\n"
      "0 0 0 1 9 0\n1 0 0 1 9 0\n0 1 0 1 9 0\n3 0 1 2 6 0 0 1 0 0 1\n7\nmore\n");
  EXPECT_EQ(
      SkippedBy(read),
      (std::vector<std::string>{
          "8: the properties nx, red, s of 3 rows of the element \"vertex\" have no effect",
          "13: the property texcoord of 1 rows of the element \"face\" has no effect",
          "14: the element \"edge\" with 1 rows is left out",
          "3: the comment names the texture \"wood.png\", which has no effect; give it to the "
          "material as a texture",
          "0: more follows the last element, and is not read; the counts in the header may be "
          "wrong"}));
}

TEST(PlyReaderTest, ColorsAreReadOnRequest) {
  const auto file = [](const std::string& type) {
    return WriteMesh(
        "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\n"
        "property float z\nproperty " +
        type +
        " red\nproperty float green\nproperty float blue\nelement face 1\n"
        "property list uchar int vertex_indices\nend_header\n"
        "0 0 0 1 0.5 -2\n1 0 0 0 0.25 0\n0 1 0 1 1 3\n3 0 1 2\n");
  };
  const absl::StatusOr<PlyMesh> read = ReadPly(file("float"), {}, std::nullopt, PlyColors::kRead);
  ASSERT_TRUE(read.ok()) << read.status();
  EXPECT_EQ(read->mesh.colors,
            (std::vector<VertexColor>{{1, 0.5f, -2, 1}, {0, 0.25f, 0, 1}, {1, 1, 3, 1}}));
  EXPECT_TRUE(read->skipped.empty());
  EXPECT_TRUE(ReadPly(file("float"), {})->mesh.colors.empty());
  EXPECT_THAT(
      std::string(ReadPly(file("uchar"), {}, std::nullopt, PlyColors::kRead).status().message()),
      ::testing::HasSubstr("needs the properties red, green and blue, floats"));
}

TEST(PlyReaderTest, PointsWithoutFacesAreAWarning) {
  const PlyMesh read = ReadWhole(
      "ply\nformat ascii 1.0\nelement vertex 2\nproperty float x\nproperty float y\n"
      "property float z\nend_header\n0 0 0\n1 0 0\n");
  ASSERT_EQ(read.skipped.size(), 1u);
  EXPECT_TRUE(read.skipped[0].is_warning);
  EXPECT_EQ(SkippedBy(read)[0],
            "0: there are no faces, only points, and its 2 vertices are not shown; export it with "
            "faces, or remove the shape");
}

TEST(PlyReaderTest, ErrorsNameLimits) {
  SceneReaderLimits limits;
  limits.memory_bytes_max = 40;
  const std::string path = WriteMesh(BinarySquare(false));
  EXPECT_THAT(std::string(ReadMesh(path, limits).status().message()),
              HasSubstr("memory_bytes_max"));
  limits = {};
  limits.triangles_max = 1;
  EXPECT_THAT(std::string(ReadMesh(path, limits).status().message()), HasSubstr("triangles_max"));
}

}  // namespace
}  // namespace sheaf
