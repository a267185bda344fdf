// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Feeds arbitrary bytes to the reader of spectrum files, through a scene that names one in each
// role of a color. Accepted spectra convert to finite colors.
#include <cmath>
#include <string>
#include <variant>

#include "common/scene/file_source.h"
#include "common/scene/pbrt/scene_reader.h"
#include "common/scene/spectrum/spectrum.h"
#include "tests/fuzz/fuzz_target.h"

namespace sheaf {
namespace {

constexpr char kScene[] =
    "WorldBegin\n"
    "AttributeBegin AreaLightSource \"diffuse\" \"spectrum L\" \"a.spd\" Shape \"sphere\" "
    "AttributeEnd\n"
    "Material \"diffuse\" \"spectrum reflectance\" \"a.spd\" Shape \"sphere\"\n"
    "Material \"dielectric\" \"spectrum eta\" \"a.spd\" Shape \"sphere\"\n"
    "Material \"conductor\" \"spectrum eta\" \"a.spd\" \"spectrum k\" \"a.spd\" Shape \"sphere\"\n";

void CheckColor(const ColorSpec& color, ColorRole role) {
  const Rgb rgb = SpectrumToRgb(color, role);
  SHEAF_CHECK(std::isfinite(rgb.r) && std::isfinite(rgb.g) && std::isfinite(rgb.b));
}

}  // namespace

SHEAF_FUZZ_TARGET(spectrum) {
  const testing::MemoryFile scene(kScene), spectrum(bytes);
  TableFileSource files({{"main.pbrt", scene.Path()}, {"a.spd", spectrum.Path()}});
  SceneReaderLimits limits;
  limits.file_bytes_max = uint64_t{1} << 22;
  limits.memory_bytes_max = uint64_t{1} << 24;
  const absl::StatusOr<ReadSceneResult> read = ReadScene("main.pbrt", files, limits);
  if (!read.ok()) return;
  for (const MaterialDescription& described : read->scene.materials) {
    if (const auto* diffuse = std::get_if<DiffuseMaterial>(&described.material)) {
      CheckColor(diffuse->reflectance.value, ColorRole::kReflectance);
      CheckColor(diffuse->reflectance.value, ColorRole::kIlluminant);
    }
    if (const auto* glass = std::get_if<DielectricMaterial>(&described.material)) {
      SHEAF_CHECK(std::isfinite(glass->eta.mean) && glass->eta.mean > 0);
    }
  }
}

}  // namespace sheaf
