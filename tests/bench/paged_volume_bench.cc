// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// paged_volume_bench SCENE SAMPLES BUDGET_MIB: renders a scene in one thread with that memory for
// pages of volumes, and prints as JSON a digest of all tiles and what they cost.
// paged_volume_bench --pack VOLUME PAGES: makes a page file. tests/bench/paged_volume.py runs it.
#include <sys/resource.h>

#include <cstdio>
#include <cstdlib>
#include <string>
#include <utility>

#include "common/base/digest.h"
#include "common/base/steady_time.h"
#include "common/film/exr/exr_codec.h"
#include "common/volume/page_maker.h"
#include "tests/bench/bench_scene.h"

namespace sheaf::render {
namespace {

int Failed(const absl::Status& status) {
  std::fprintf(stderr, "%s\n", std::string(status.message()).c_str());
  return 1;
}

double PeakMib() {
  rusage usage{};
  getrusage(RUSAGE_SELF, &usage);
  return static_cast<double>(usage.ru_maxrss) / 1024;
}

double SecondsSince(SteadyTime begin) { return absl::ToDoubleSeconds(SteadyTime::Now() - begin); }

int Render(const std::string& path, uint64_t samples, uint64_t budget_mib) {
  const SteadyTime begin = SteadyTime::Now();
  ReadFile file(path);
  if (absl::Status read = ReadSceneFile(path, samples, &file); !read.ok()) return Failed(read);
  CompileLimits limits;
  limits.build_threads = 1;
  limits.volume_memory_bytes_max = budget_mib << 20;
  const auto scene = CompileScene(std::move(file.scene), file.settings, file.files, limits, {});
  if (!scene.ok()) return Failed(scene.status());
  const double load_seconds = SecondsSince(begin), load_cpu_seconds = ProcessCpuSeconds();
  double first_seconds = 0;
  RenderStats sum;
  Sha256 digest;
  for (const PixelRect& tile : CutTiles(file.settings.window, 32)) {
    RenderStats stats;
    const auto film = RenderTilePass(**scene, tile, {0, file.settings.samples}, {}, &stats);
    if (!film.ok()) return Failed(film.status());
    digest.Update(EncodePart(*film, {}));
    sum.volume_pages += stats.volume_pages;
    sum.volume_bytes += stats.volume_bytes;
    sum.rays += stats.rays;
    if (first_seconds == 0) first_seconds = SecondsSince(begin);
  }
  if (absl::Status volumes = CheckVolumes(**scene); !volumes.ok()) return Failed(volumes);
  std::printf(
      "{\"sha256\": \"%s\", \"load_seconds\": %.2f, \"load_cpu_seconds\": %.2f, "
      "\"first_tile_seconds\": %.2f, \"seconds\": %.2f, \"cpu_seconds\": %.2f, "
      "\"peak_mib\": %.0f, \"rays\": %llu, \"pages_read\": %llu, \"mib_read\": %.1f}\n",
      digest.FinishHex().c_str(), load_seconds, load_cpu_seconds, first_seconds,
      SecondsSince(begin), ProcessCpuSeconds(), PeakMib(),
      static_cast<unsigned long long>(sum.rays), static_cast<unsigned long long>(sum.volume_pages),
      static_cast<double>(sum.volume_bytes) / (1 << 20));
  return 0;
}

int Pack(const std::string& volume, const std::string& pages) {
  const SteadyTime begin = SteadyTime::Now();
  const auto made = MakePageFile(volume, volume, pages);
  if (!made.ok()) return Failed(made.status());
  std::printf("{\"seconds\": %.2f, \"cpu_seconds\": %.2f, \"peak_mib\": %.0f}\n",
              SecondsSince(begin), ProcessCpuSeconds(), PeakMib());
  return 0;
}

}  // namespace
}  // namespace sheaf::render

int main(int argc, char** argv) {
  if (argc == 4 && std::string(argv[1]) == "--pack") return sheaf::render::Pack(argv[2], argv[3]);
  if (argc != 4) {
    std::fprintf(stderr, "usage: paged_volume_bench SCENE SAMPLES BUDGET_MIB\n");
    return 2;
  }
  return sheaf::render::Render(argv[1], std::strtoull(argv[2], nullptr, 10),
                               std::strtoull(argv[3], nullptr, 10));
}
