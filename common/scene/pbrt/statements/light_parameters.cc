// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "common/scene/pbrt/statements/light_parameters.h"

#include <cmath>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "common/scene/formats/ies_reader.h"
#include "common/scene/pbrt/statements/color_parameters.h"
#include "common/scene/pbrt/statements/ray_visibility.h"
#include "common/scene/pbrt/statements/supported_names.h"

namespace sheaf {
namespace {

// The default color of lights: the white of sRGB.
ColorSpec White() { return RgbColor(Rgb::Gray(1)); }

LightScale GetScale(ParameterList& parameters, bool has_power) {
  LightScale scale;
  scale.scale = parameters.GetFloat("scale", 1);
  if (!(scale.scale >= 0)) {
    parameters.ErrorAt(*parameters.Find("scale"), "is negative; light must be 0 or more");
  }
  if (has_power) scale.power_w = parameters.GetFloat("power", -1);
  return scale;
}

// Sheaf's own parameter: the light group to which the light belongs.
std::string GetGroup(ParameterList& parameters) {
  const std::string group = parameters.GetString("lightgroup", kDefaultLightGroup);
  const std::string why_not = WhyNotLightGroup(group);
  if (why_not.empty()) return group;
  parameters.ErrorAt(*parameters.Find("lightgroup"), absl::StrCat("\"", group, "\" ", why_not));
  return kDefaultLightGroup;
}

// Sheaf's own parameter: the kinds of rays that do not see a light without a shape.
RayKinds GetInvisibleOfLight(ParameterList& parameters) {
  RayKinds invisible = GetInvisible(parameters);
  if ((invisible & BitOf(RayKind::kShadow)) == 0) return invisible;
  parameters.ErrorAt(*parameters.Find("invisible"),
                     "has \"shadow\", but a light without a shape casts none; remove it");
  return 0;
}

// Older scenes give the number of light samples per point.
void PassOverSampleCount(ParameterList& parameters) {
  const Parameter* count = parameters.Find("nsamples");
  if (count == nullptr) return;
  parameters.diagnostics().Warning(
      count->location, absl::StrCat(parameters.owner(),
                                    ": parameter \"nsamples\" has no effect: lights have no number "
                                    "of samples of their own in pbrt-v4"));
}

void CheckDirection(ParameterList& parameters, Vec3d from, Vec3d to) {
  if (LengthSquared(to - from) > 0) return;
  parameters.Error(absl::StrCat(parameters.owner(),
                                ": \"from\" and \"to\" are the same point, "
                                "which gives no direction"));
}

// Canonical name of the parameter's file, whose readability has been checked (failures are
// reported); empty if there is no parameter.
std::string GetFile(ParameterList& parameters, SceneFiles& files) {
  const std::string filename = parameters.GetString("filename", "");
  if (filename.empty()) return "";
  std::string file = CanonicalFileName(filename);
  if (const auto path = files.LocalPath(file); !path.ok()) {
    parameters.ErrorAt(*parameters.Find("filename"),
                       absl::StrCat("cannot be read: ", path.status().message()));
  }
  return file;
}

// Corners of a rectangle; empty if there is no portal or it was invalid (reported).
std::vector<Vec3d> GetPortal(ParameterList& parameters) {
  std::vector<Vec3d> corners;
  for (const Vec3f& corner : parameters.GetTriples("portal", ParameterType::kPoint3)) {
    corners.push_back(ToDouble(corner));
  }
  if (corners.empty()) return corners;
  // On cosines, as in pbrt-v4. The test also fails if an edge has no length.
  constexpr double kTolerance = 1e-3;
  const auto is_cosine = [](Vec3d a, Vec3d b, double expected) {
    return std::fabs(Dot(a, b) / (Length(a) * Length(b)) - expected) <= kTolerance;
  };
  if (corners.size() != 4 || !(is_cosine(corners[3] - corners[0], corners[2] - corners[1], 1) &&
                               is_cosine(corners[1] - corners[0], corners[2] - corners[3], 1) &&
                               is_cosine(corners[1] - corners[0], corners[3] - corners[0], 0))) {
    parameters.ErrorAt(*parameters.Find("portal"),
                       "is not a rectangle; give its four corners in order around it");
    corners.clear();
  }
  return corners;
}

InfiniteLight GetInfinite(ParameterList& parameters, SceneFiles& files) {
  InfiniteLight light;
  light.radiance = GetColor(parameters, "L", ColorRole::kIlluminant, White(), files);
  light.illuminance_lx = parameters.GetFloat("illuminance", -1);
  light.file = GetFile(parameters, files);
  light.portal = GetPortal(parameters);
  if (light.file.empty() && !light.portal.empty()) {
    parameters.ErrorAt(*parameters.Find("portal"),
                       "needs the image that is seen through it; give \"string filename\" a map");
  }
  if (!light.file.empty() && parameters.Has("L")) {
    parameters.ErrorAt(*parameters.Find("filename"), "excludes \"L\"; give one or the other");
  }
  return light;
}

DistantLight GetDistant(ParameterList& parameters, SceneFiles& files) {
  DistantLight light;
  light.radiance = GetColor(parameters, "L", ColorRole::kIlluminant, White(), files);
  light.from = parameters.GetPoint3("from", {0, 0, 0});
  light.to = parameters.GetPoint3("to", {0, 0, 1});
  light.illuminance_lx = parameters.GetFloat("illuminance", -1);
  CheckDirection(parameters, light.from, light.to);
  return light;
}

PointLight GetPoint(ParameterList& parameters, SceneFiles& files) {
  PointLight light;
  light.intensity = GetColor(parameters, "I", ColorRole::kIlluminant, White(), files);
  light.from = parameters.GetPoint3("from", {0, 0, 0});
  return light;
}

SpotLight GetSpot(ParameterList& parameters, SceneFiles& files) {
  SpotLight light;
  light.intensity = GetColor(parameters, "I", ColorRole::kIlluminant, White(), files);
  light.from = parameters.GetPoint3("from", {0, 0, 0});
  light.to = parameters.GetPoint3("to", {0, 0, 1});
  light.cone_angle_degrees = parameters.GetFloat("coneangle", 30);
  light.cone_delta_angle_degrees = parameters.GetFloat("conedeltaangle", 5);
  CheckDirection(parameters, light.from, light.to);
  if (!(light.cone_angle_degrees > 0 && light.cone_angle_degrees <= 180)) {
    parameters.Error(absl::StrCat(parameters.owner(), ": coneangle ", light.cone_angle_degrees,
                                  " is outside (0, 180] degrees"));
  }
  if (!(light.cone_delta_angle_degrees >= 0 &&
        light.cone_delta_angle_degrees <= light.cone_angle_degrees)) {
    parameters.Error(absl::StrCat(parameters.owner(), ": conedeltaangle ",
                                  light.cone_delta_angle_degrees, " is outside [0, coneangle]"));
  }
  return light;
}

GoniometricLight GetGoniometric(ParameterList& parameters, SceneFiles& files) {
  GoniometricLight light;
  light.intensity = GetColor(parameters, "I", ColorRole::kIlluminant, White(), files);
  light.file = GetFile(parameters, files);
  if (light.file.empty()) {
    parameters.diagnostics().Warning(
        parameters.location(),
        absl::StrCat(parameters.owner(),
                     ": without \"string filename\" it emits equally in all directions"));
  }
  if (!IsIesFileName(light.file)) return light;
  if (!files.LocalPath(light.file).ok()) return light;  // Reported already.
  const absl::StatusOr<const CandelaTable*> table = files.Candelas(light.file);
  if (table.ok()) {
    light.table = **table;
    if (light.table.dims_when_tilted) {
      parameters.diagnostics().Note(
          parameters.Find("filename")->location,
          absl::StrCat(parameters.owner(), ": \"", light.file,
                       "\" describes how the lamp dims when it is tilted (TILT); Sheaf uses the "
                       "measured emission at any tilt"));
    }
  } else {
    parameters.ErrorAt(*parameters.Find("filename"),
                       absl::StrCat("cannot be read: ", table.status().message()));
  }
  return light;
}

ProjectionLight GetProjection(ParameterList& parameters, SceneFiles& files) {
  ProjectionLight light;
  light.file = GetFile(parameters, files);
  if (light.file.empty()) {
    parameters.Error(absl::StrCat(parameters.owner(),
                                  " needs an image to project; give \"string filename\" an image"));
  }
  light.fov_degrees = parameters.GetFloat("fov", 90);
  if (!(light.fov_degrees > 0 && light.fov_degrees < 180)) {
    parameters.Error(absl::StrCat(parameters.owner(), ": fov ", light.fov_degrees,
                                  " is outside (0, 180) degrees"));
  }
  return light;
}

}  // namespace

std::optional<LightDescription> GetLight(const std::string& type, const Matrix4& world_from_light,
                                         ParameterList& parameters, SceneFiles& files) {
  LightDescription light;
  light.location = parameters.location();
  light.world_from_light = world_from_light;
  bool has_power = false;
  if (type == "infinite") {
    light.light = GetInfinite(parameters, files);
  } else if (type == "distant") {
    light.light = GetDistant(parameters, files);
  } else if (type == "point") {
    has_power = true;
    light.light = GetPoint(parameters, files);
  } else if (type == "spot") {
    has_power = true;
    light.light = GetSpot(parameters, files);
  } else if (type == "goniometric") {
    has_power = true;
    light.light = GetGoniometric(parameters, files);
  } else if (type == "projection") {
    has_power = true;
    light.light = GetProjection(parameters, files);
  } else {
    parameters.Error(absl::StrCat(parameters.owner(), " is not supported",
                                  SupportedNamesHint(type, {"infinite", "distant", "point", "spot",
                                                            "goniometric", "projection"})));
    return std::nullopt;
  }
  Matrix4 inverse;
  if (!Invert(world_from_light, &inverse)) {
    parameters.Error(absl::StrCat(parameters.owner(), ": the transformation is singular"));
  }
  light.scale = GetScale(parameters, has_power);
  light.group = GetGroup(parameters);
  light.invisible = GetInvisibleOfLight(parameters);
  PassOverSampleCount(parameters);
  parameters.ReportUnused();
  return light;
}

std::optional<AreaLightDescription> GetAreaLight(const std::string& type, ParameterList& parameters,
                                                 SceneFiles& files) {
  if (type != "diffuse") {
    parameters.Error(absl::StrCat(parameters.owner(), " is not supported",
                                  SupportedNamesHint(type, {"diffuse"})));
    return std::nullopt;
  }
  AreaLightDescription light;
  light.location = parameters.location();
  light.radiance = GetColor(parameters, "L", ColorRole::kIlluminant, White(), files);
  light.scale = GetScale(parameters, true);
  light.group = GetGroup(parameters);
  PassOverSampleCount(parameters);
  light.two_sided = parameters.GetBool("twosided", false);
  light.file = GetFile(parameters, files);
  if (!light.file.empty() && parameters.Has("L")) {
    parameters.ErrorAt(*parameters.Find("filename"), "excludes \"L\"; give one or the other");
  }
  parameters.ReportUnused();
  return light;
}

}  // namespace sheaf
