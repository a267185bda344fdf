// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// learned_lights_bench SCENE [SAMPLES] [WIDTH] [LEAST] [TECHNIQUES]: gain of learned lights
// (docs/adr/0190), or of other ways of choosing lights, such as camera+product (docs/adr/0240). It
// renders the scene file by camera paths with lights that are chosen by the tree's estimates, and
// by the techniques (camera+learned-lights), by the same number of samples, and prints
// - relMSE, from the spread of the replicates, relative to the squares of the mean of both images,
// - the mean of the image, with its standard error,
// - the thread's seconds, and those of the training, which are part of them,
// - how many times smaller relMSE times seconds is by the techniques.
// Exits with 1 where that is below LEAST, or where the training takes more than a fiftieth of the
// time of 64 samples. WIDTH: of the image, in pixels; 0: as in the file.
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <string>
#include <vector>

#include "common/film/film_tile.h"
#include "tests/bench/bench_scene.h"
#include "worker/render/guiding_training.h"
#include "worker/render/scene/compile_scene.h"

namespace sheaf::render {
namespace {

constexpr double kTrainingMax = 0.02, kTrainingSamples = 64;

struct Measured {
  std::vector<double> means, variances;  // By pixel, of the luminance of the image.
  double seconds = 0, training_seconds = 0;
  uint64_t rays = 0;
};

void NoteErrors(const FilmTile& film, Measured* measured) {
  const double count = film.replicate_count();
  for (size_t pixel = 0; pixel < film.plane_size(); ++pixel) {
    double sum = 0, squares = 0;
    for (uint32_t r = 0; r < film.replicate_count(); ++r) {
      const Rgb rgb{film.replicate(r, 0)[pixel], film.replicate(r, 1)[pixel],
                    film.replicate(r, 2)[pixel]};
      const double mean =
          static_cast<double>(Luminance(rgb)) / static_cast<double>(film.replicate(r, 3)[pixel]);
      sum += mean;
      squares += mean * mean;
    }
    measured->means.push_back(sum / count);
    measured->variances.push_back((squares - sum * sum / count) / (count * (count - 1)));
  }
}

absl::StatusOr<Measured> Measure(const std::filesystem::path& path, uint64_t samples,
                                 int32_t width_px, TechniqueSet techniques) {
  ReadFile file(path);
  if (absl::Status status = ReadSceneFile(path, samples, &file); !status.ok()) return status;
  FrameSettings& settings = file.settings;
  if (width_px > 0) {
    settings.height_px = std::max(1, settings.height_px * width_px / settings.width_px);
    settings.width_px = width_px;
    settings.window = {0, 0, settings.width_px, settings.height_px};
  }
  settings.techniques = techniques;
  const absl::StatusOr<CompiledScenePtr> scene =
      CompileScene(std::move(file.scene), settings, file.files);
  if (!scene.ok()) return scene.status();
  Measured measured;
  const double start_seconds = ThreadCpuSeconds();
  if (NeedsTraining(techniques)) {
    const absl::StatusOr<std::string> fields = TrainGuiding(**scene, 1, {}, nullptr);
    if (!fields.ok()) return fields.status();
    if (absl::Status status = SetGuiding(**scene, *fields); !status.ok()) return status;
    measured.training_seconds = ThreadCpuSeconds() - start_seconds;
    std::printf("%zu bytes of learned fields\n", fields->size());
  }
  for (const PixelRect& tile : SomeTiles(settings.window, 64, 1 << 20)) {
    RenderStats stats;
    const absl::StatusOr<FilmTile> film =
        RenderTilePass(**scene, tile, {0, settings.samples}, {}, &stats);
    if (!film.ok()) return film.status();
    NoteErrors(*film, &measured);
    measured.rays += stats.rays;
  }
  measured.seconds = ThreadCpuSeconds() - start_seconds;
  return measured;
}

int Run(const std::filesystem::path& path, uint64_t samples, int32_t width_px, double least,
        TechniqueSet other) {
  std::array<Measured, 2> sides;
  const std::array<TechniqueSet, 2> techniques{TechniqueSet::kCamera, other};
  for (size_t side = 0; side < 2; ++side) {
    absl::StatusOr<Measured> measured = Measure(path, samples, width_px, techniques[side]);
    if (!measured.ok()) {
      PrintNotRendered(path, measured.status());
      return 1;
    }
    sides[side] = *std::move(measured);
  }
  const size_t pixels = sides[0].means.size();
  double whole = 0;
  for (size_t i = 0; i < pixels; ++i) {
    whole += (sides[0].means[i] + sides[1].means[i]) / 2 / static_cast<double>(pixels);
  }
  std::array<double, 2> errors{};
  for (size_t side = 0; side < 2; ++side) {
    for (size_t i = 0; i < pixels; ++i) {
      const double mean = (sides[0].means[i] + sides[1].means[i]) / 2;
      errors[side] += sides[side].variances[i] / (mean * mean + 0.01 * whole * whole) /
                      static_cast<double>(pixels);
    }
    double mean = 0, variance = 0;
    for (size_t i = 0; i < pixels; ++i) {
      mean += sides[side].means[i] / static_cast<double>(pixels);
      variance += sides[side].variances[i] / static_cast<double>(pixels * pixels);
    }
    std::printf("%-24s relMSE %10.3e  %8.2f s  training %6.3f s  %llu rays  mean %.5g +- %.2g\n",
                techniques[side].Name().c_str(), errors[side], sides[side].seconds,
                sides[side].training_seconds, static_cast<unsigned long long>(sides[side].rays),
                mean, std::sqrt(variance));
  }
  const double gain = errors[0] * sides[0].seconds / (errors[1] * sides[1].seconds);
  const double of_samples = sides[1].seconds - sides[1].training_seconds,
               share = sides[1].training_seconds /
                       (of_samples * kTrainingSamples / static_cast<double>(samples));
  std::printf(
      "relMSE %.2f times smaller, relMSE x CPU %.2f times; training %.2f %% of %g samples\n",
      errors[0] / errors[1], gain, 100 * share, kTrainingSamples);
  return gain >= least && share <= kTrainingMax ? 0 : 1;
}

}  // namespace
}  // namespace sheaf::render

int main(int argc, char** argv) {
  const long samples = argc > 2 ? std::atol(argv[2]) : 16;
  const auto techniques = sheaf::TechniqueSet::Parse(argc > 5 ? argv[5] : "camera+learned-lights");
  if (argc < 2 || samples < 16 || !techniques.ok()) {
    std::fprintf(stderr,
                 "learned_lights_bench SCENE [SAMPLES] [WIDTH] [LEAST] [TECHNIQUES]: at least 16 "
                 "samples of a pixel, and names as of --techniques\n");
    return 1;
  }
  return sheaf::render::Run(argv[1], static_cast<uint64_t>(samples),
                            argc > 3 ? std::atoi(argv[3]) : 0, argc > 4 ? std::atof(argv[4]) : 0,
                            *techniques);
}
