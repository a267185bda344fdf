// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// memory_bench PATH [MAX_RATIO]: memory of the scene file PATH, or of each one below the folder
// PATH, when it is ready to render: the growth of the process against the sum of Embree's own
// memory and the raw buffers (vertices, indices and curves of every shape, with those of a shared
// mesh counted once for each shape that is not an instance; images that are held whole, at three
// floats per texel). Memory that every scene needs is allocated before: the table of spectra and
// Embree's threads. Exits with 1 if the ratio of a scene of at least kJudgedBytes exceeds
// MAX_RATIO; for smaller scenes the page size dominates.
#include <sys/wait.h>
#include <unistd.h>

#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <string>
#include <variant>

#include "common/image/image_io.h"
#include "tests/bench/bench_scene.h"
#include "worker/render/color/spectral_color.h"
#include "worker/render/scene/compiled_scene.h"

namespace sheaf::render {
namespace {

constexpr double kJudgedBytes = 4e6;

template <typename T>
double BytesOf(const std::vector<T>& values) {
  return static_cast<double>(values.size() * sizeof(T));
}
double ImageBytes(FileSource& files, const std::string& name) {
  if (name.empty()) return 0;
  const auto path = files.LocalPath(name);
  if (!path.ok()) return 0;
  const auto image = ReadImage(*path);
  return image.ok() ? 3.0 * sizeof(float) * image->width * image->height : 0;
}

double BytesOfMesh(const TriangleMesh& mesh) {
  return BytesOf(mesh.positions) + BytesOf(mesh.normals) + BytesOf(mesh.uvs) +
         BytesOf(mesh.indices);
}
double BytesOfMesh(const BilinearMesh& mesh) {
  return BytesOf(mesh.positions) + BytesOf(mesh.normals) + BytesOf(mesh.uvs) +
         BytesOf(mesh.indices);
}
// As read, with each mesh counted once.
double ReadBytes(const SceneDescription& scene) {
  double bytes = 0;
  for (const TriangleMesh& mesh : scene.meshes) bytes += BytesOfMesh(mesh);
  for (const BilinearMesh& mesh : scene.bilinear_meshes) bytes += BytesOfMesh(mesh);
  for (const CurveSet& set : scene.curve_sets) {
    bytes += BytesOf(set.points) + BytesOf(set.widths) + BytesOf(set.normals);
  }
  return bytes;
}
// As placed: shared data counts for each shape that uses it.
double ShapeBytes(const SceneDescription& scene) {
  double bytes = ReadBytes(scene);
  std::vector<bool> is_counted(scene.meshes.size());
  for (const ShapeDescription& shape : scene.shapes) {
    const auto* placed = std::get_if<MeshShape>(&shape.shape);
    if (placed == nullptr) continue;
    const auto mesh = static_cast<size_t>(placed->mesh);
    if (is_counted[mesh]) bytes += BytesOfMesh(scene.meshes[mesh]);
    is_counted[mesh] = true;
  }
  return bytes;
}
double SkyBytes(const SceneDescription& scene, FileSource& files) {
  double bytes = 0;
  for (const LightDescription& light : scene.lights) {
    if (const auto* sky = std::get_if<InfiniteLight>(&light.light)) {
      bytes += ImageBytes(files, sky->file);
    }
  }
  return bytes;
}

// Loads all code and tables that every scene needs, by rendering a sphere.
void MakeReady() {
  PrepareUpsampling();
  SceneDescription scene;
  scene.shapes.emplace_back().shape = SphereShape{};
  scene.world_shapes.push_back(0);
  TableFileSource files({});
  FrameSettings settings;
  settings.width_px = settings.height_px = 1;
  settings.window = {0, 0, 1, 1};
  settings.samples = 1;
  const auto compiled = CompileScene(std::move(scene), settings, files);
  if (compiled.ok()) (void)RenderTilePass(**compiled, settings.window, {0, 1}, {}, nullptr);
}

// Called in a separate process, so that no scene reuses memory freed by another. Returns false if
// the ratio is exceeded.
bool MeasureFile(const std::filesystem::path& path, double ratio_max) {
  ReadFile file(path);
  if (const auto status = ReadSceneFile(path, 0, &file); !status.ok()) {
    PrintNotRendered(path, status);
    return true;
  }
  MakeReady();
  const double raw = ShapeBytes(file.scene) + SkyBytes(file.scene, file.files);
  // The data read so far is part of the scene's memory.
  const double before = ResidentBytes() - ReadBytes(file.scene);
  const auto scene = CompileScene(std::move(file.scene), file.settings, file.files);
  if (!scene.ok()) {
    PrintNotRendered(path, scene.status());
    return true;
  }
  const double grown = ResidentBytes() - before;
  const auto embree = static_cast<double>((*scene)->tracer->memory_bytes());
  const double ratio = grown / (embree + raw);
  const bool is_judged = embree + raw >= kJudgedBytes;
  std::printf(
      "%-36s %8.2f MB in the process, by its own account %.2f; Embree %.2f + raw %.2f: ratio %.2f"
      "%s\n",
      path.filename().c_str(), grown * 1e-6, static_cast<double>(MemoryBytesOf(**scene)) * 1e-6,
      embree * 1e-6, raw * 1e-6, ratio, is_judged ? "" : " (too small to judge)");
  return !is_judged || ratio <= ratio_max;
}

int Run(const std::string& path, double ratio_max) {
  bool is_good = true;
  for (const std::filesystem::path& file : SceneFilesAt(path)) {
    std::fflush(stdout);
    const pid_t child = fork();
    if (child < 0) return 2;
    if (child == 0) {
      const bool is_within = MeasureFile(file, ratio_max);
      std::fflush(stdout);
      _exit(is_within ? 0 : 1);
    }
    int status = 0;
    waitpid(child, &status, 0);
    is_good = is_good && WIFEXITED(status) && WEXITSTATUS(status) == 0;
  }
  return is_good ? 0 : 1;
}

}  // namespace
}  // namespace sheaf::render

int main(int argc, char** argv) {
  if (argc < 2) {
    std::fprintf(stderr, "usage: %s PATH [MAX_RATIO]\n", argv[0]);
    return 2;
  }
  return sheaf::render::Run(argv[1], argc > 2 ? std::strtod(argv[2], nullptr) : HUGE_VAL);
}
