// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "common/scene/gltf/lights.h"

#include <algorithm>
#include <cmath>
#include <string>
#include <utility>

#include "absl/strings/str_cat.h"
#include "common/scene/gltf/gltf_view.h"
#include "common/scene/gltf/surrounding/surrounding.h"
#include "common/scene/gltf/values.h"

namespace sheaf::gltf {
namespace {

constexpr char kPunctual[] = "KHR_lights_punctual";
constexpr double kIntensityMax = 1e12;
constexpr float kWhiteRadiance = 0.5f;
// The map's name is that of the scene file and this.
constexpr char kSurroundingEnding[] = ".surrounding.pfm";
constexpr double kDegreesPerRadian = 57.29577951308232;

// Points along -z of the node, the direction in which the file's lights shine.
Vec3d DirectionOf(const Matrix4& world_from_node) {
  const Vec3d z = TransformVector(world_from_node, {0, 0, -1});
  const double length = Length(z);
  return length > 0 && std::isfinite(length) ? z / length : Vec3d{0, 0, -1};
}

SpotLight SpotOf(const tinygltf::Value* light, const ColorSpec& intensity, Vec3d from, Vec3d to) {
  const tinygltf::Value* spot = Member(light, "spot");
  const double limit = 0.5 * 3.141592653589793;
  const double outer =
      std::clamp(NumberOf(spot, "outerConeAngle", 0.7853981633974483), 1e-4, limit);
  const double inner = std::clamp(NumberOf(spot, "innerConeAngle", 0), 0.0, outer);
  return {intensity, from, to, static_cast<float>(outer * kDegreesPerRadian),
          static_cast<float>((outer - inner) * kDegreesPerRadian)};
}

}  // namespace

void AddLightOf(const tinygltf::Model& model, int node, const TransformOverTime& place,
                SkippedParts* skipped, Diagnostics* diagnostics, SceneDescription* scene) {
  const tinygltf::Node& source = model.nodes[static_cast<size_t>(node)];
  const tinygltf::Value* reference = Find(source.extensions, kPunctual);
  if (reference == nullptr) return;
  const std::string what = Named("the light of node", node, source.name);
  const tinygltf::Value* lights = Member(Find(model.extensions, kPunctual), "lights");
  const int index = IndexOf(reference, "light");
  if (lights == nullptr || index < 0 || static_cast<size_t>(index) >= lights->ArrayLen()) {
    diagnostics->Error(kFile, absl::StrCat(what, " does not exist; export the file again"));
    return;
  }
  const tinygltf::Value* light = &lights->Get(index);
  const double strength = std::clamp(NumberOf(light, "intensity", 1), 0.0, kIntensityMax);
  const ColorSpec intensity =
      Color(ColorOf(light, "color", Rgb::Gray(1)) * static_cast<float>(strength));
  const Vec3d from = TransformPoint(place.start, {0, 0, 0});
  const Vec3d to = from + DirectionOf(place.start);
  if (!(place.start == place.end)) {
    skipped->Add(what, "it stays where it is while the shutter is open");
  }
  LightDescription description;
  description.location = kFile;
  const std::string type = TextOf(light, "type");
  if (type == "directional") {
    description.light = DistantLight{intensity, from, to, -1};
  } else if (type == "point") {
    description.light = PointLight{intensity, from};
  } else if (type == "spot") {
    description.light = SpotOf(light, intensity, from, to);
  } else {
    diagnostics->Error(kFile, absl::StrCat(what, " has the type \"", type,
                                           "\"; it must be "
                                           "directional, point or spot"));
    return;
  }
  if (Member(light, "range") != nullptr) {
    skipped->Add(what, "its range has no effect: light falls off with the square of the distance");
  }
  scene->lights.push_back(std::move(description));
}

void AddEnvironment(const std::string& environment, const std::string& main_file, FileSource* files,
                    Diagnostics* diagnostics, SceneDescription* scene) {
  if (environment == GltfView::kNoEnvironment || diagnostics->HasErrors()) return;
  LightDescription description;
  description.location = kFile;
  InfiniteLight light;
  light.file = environment;
  light.radiance = Color(Rgb::Gray(kWhiteRadiance));
  if (environment.empty()) {
    if (!scene->lights.empty()) return;
    const std::string map = main_file + kSurroundingEnding;
    const absl::Status status = files->DerivedPath(map, SurroundingMap()).status();
    if (!status.ok() && !absl::IsNotFound(status)) {
      return diagnostics->Error(kFile, std::string(status.message()));
    }
    if (status.ok()) {
      light.file = map;
      description.world_from_light = WorldFromSurrounding();
    }
    diagnostics->Note(
        kFile, absl::StrCat("has no lights (KHR_lights_punctual); a ",
                            status.ok() ? "gray surrounding, bright above," : "white surrounding",
                            " lights it; choose another by --environment, or --environment none"));
  }
  description.light = std::move(light);
  scene->lights.push_back(std::move(description));
}

}  // namespace sheaf::gltf
