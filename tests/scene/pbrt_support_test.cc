// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Checks docs/pbrt-v4.md: every row of its tables is read as a scene, and the result must match the
// row.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <filesystem>
#include <fstream>
#include <string>
#include <vector>

#include "common/scene/file_source.h"
#include "common/scene/pbrt/scene_reader.h"
#include "tests/support/measured_builder.h"
#include "tests/support/volume/volume_writers.h"

namespace sheaf {
namespace {

struct Row {
  int line = 0;
  std::string example, verdict, words;
};

std::string Trim(const std::string& text) {
  const size_t first = text.find_first_not_of(" `");
  if (first == std::string::npos) return "";
  return text.substr(first, text.find_last_not_of(" `") - first + 1);
}

// The tables' rows whose first cell is code.
std::vector<Row> ReadRows(const std::string& path) {
  std::ifstream file(path);
  std::vector<Row> rows;
  std::string line;
  for (int number = 1; std::getline(file, line); ++number) {
    if (line.rfind("| `", 0) != 0) continue;
    Row row{number, "", "", ""};
    std::array<std::string*, 3> cells = {&row.example, &row.verdict, &row.words};
    size_t begin = 1;
    for (std::string* cell : cells) {
      const size_t end = std::min(line.find(" |", begin), line.size());
      *cell = Trim(line.substr(begin, end - begin));
      begin = std::min(end + 2, line.size());
    }
    rows.push_back(row);
  }
  return rows;
}

bool StandsBeforeTheWorld(const std::string& example) {
  for (const char* directive : {"Camera", "Film", "PixelFilter", "Sampler", "Integrator", "Option",
                                "Accelerator", "ColorSpace", "TransformTimes"}) {
    if (example.rfind(std::string(directive) + " ", 0) == 0) return true;
  }
  return false;
}

std::string SceneOf(const std::string& example) {
  if (StandsBeforeTheWorld(example)) return example + "\nWorldBegin\n";
  return "WorldBegin\nTexture \"c\" \"spectrum\" \"constant\" \"rgb value\" [.5 .5 .5]\n"
         "Texture \"f\" \"float\" \"constant\" \"float value\" 0.1\n" +
         example + "\nShape \"sphere\"\n";
}

class PbrtSupportTest : public ::testing::Test {
 protected:
  PbrtSupportTest() {
    std::filesystem::create_directories(directory_);
    Write("empty.pbrt", "# nothing\n");
    for (const char* name : {"map.png", "a.png", "smoke.nvdb"}) Write(name, "x");
    Write("smoke.vdb", testing::VdbFile({{.value = [](const testing::Voxel& v) {
                                            return v[0] > 4 ? 1.f : 0.f;
                                          }}},
                                        {}));
    Write("lens.dat", "# A lens before its stop.\n50 4 1.5 20\n-50 5 1 20\n0 45 0 10\n");
    Write("lamp.ies",
          "IES:LM-63-2019\nTILT=NONE\n1 1000 1 3 1 1 2 0 0 0\n1 1 60\n0 45 90\n0\n"
          "100 50 15\n");
    testing::MeasuredFileBuilder().Write(directory_ + "/paint.bsdf");
    Write("mesh.ply",
          "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\n"
          "property float z\nelement face 1\nproperty list uchar int vertex_indices\nend_header\n"
          "0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n");
  }
  ~PbrtSupportTest() override { std::filesystem::remove_all(directory_); }

  void Write(const std::string& name, const std::string& text) {
    std::ofstream(directory_ + "/" + name, std::ios::binary) << text;
  }

  // The result of reading the scene; *said receives its messages, each with its place.
  std::string VerdictOn(const std::string& scene, std::string* said) {
    Write("main.pbrt", scene);
    DirectoryFileSource files(directory_);
    const absl::StatusOr<ReadSceneResult> result = ReadScene("main.pbrt", files);
    if (!result.ok()) {
      *said = std::string(result.status().message());
      return "refused";
    }
    for (const SceneDiagnostic& d : result->diagnostics) *said += d.text + "\n";
    return result->diagnostics.empty() ? "yes" : "noted";
  }

  const std::string directory_ = ::testing::TempDir() + "sheaf-pbrt-support";
};

TEST_F(PbrtSupportTest, EveryTableRowHolds) {
  const std::vector<Row> rows = ReadRows(SHEAF_PBRT_TABLE);
  EXPECT_GT(rows.size(), 200u);
  for (const Row& row : rows) {
    SCOPED_TRACE("docs/pbrt-v4.md:" + std::to_string(row.line) + ": " + row.example);
    std::string said;
    EXPECT_EQ(VerdictOn(SceneOf(row.example), &said), row.verdict) << said;
    EXPECT_NE(said.find(row.words), std::string::npos) << said;
    EXPECT_EQ(row.words.empty(), row.verdict == "yes");
    if (row.verdict == "refused") {
      EXPECT_NE(said.find("main.pbrt:"), std::string::npos) << said;
    }
  }
}

}  // namespace
}  // namespace sheaf
