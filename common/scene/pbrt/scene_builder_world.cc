// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// The part of SceneBuilder that handles options and the contents of the world: materials, textures,
// shapes, instances and lights.
#include <algorithm>
#include <cmath>
#include <optional>
#include <utility>
#include <variant>

#include "absl/strings/str_cat.h"
#include "common/base/printable.h"
#include "common/scene/formats/number.h"
#include "common/scene/pbrt/scene_builder.h"
#include "common/scene/pbrt/statements/color_parameters.h"
#include "common/scene/pbrt/statements/light_parameters.h"
#include "common/scene/pbrt/statements/ray_visibility.h"
#include "common/scene/pbrt/statements/supported_names.h"

namespace sheaf {
ParameterList SceneBuilder::Parameters(const std::string& owner,
                                       const std::string& attribute_target,
                                       std::vector<Parameter> own, SourceLocation location) {
  for (Parameter& parameter : own) parameter.primaries = state_.primaries;
  std::vector<Parameter> defaults;
  const auto found = state_.attributes.find(attribute_target);
  if (found != state_.attributes.end()) defaults = found->second;
  return ParameterList(owner, location, std::move(own), std::move(defaults), diagnostics_);
}

// --- Options -----------------------------------------------------------------------------------

void SceneBuilder::Option(const std::string& name, const std::string& value,
                          SourceLocation location) {
  if (!RequireOptions("Option", location)) return;
  // Options may be written with the type in front, like parameters.
  const std::string option =
      name.substr(name.find(' ') == std::string::npos ? 0 : name.rfind(' ') + 1);
  if (option == "seed") {
    if (!ParseInteger(value, &scene_->sampling.seed)) {
      diagnostics_->Error(location,
                          absl::StrCat("option \"seed\": \"", value, "\" is not an integer"));
    }
  } else if (option == "displacementedgescale") {
    float scale = 0;
    if (!ParseFloat(value, &scale) || !(scale > 0 && std::isfinite(scale))) {
      diagnostics_->Error(location, absl::StrCat("option \"displacementedgescale\": \"", value,
                                                 "\" is not a number greater than 0"));
      return;
    }
    shapes_.set_displacement_edge_scale(scale);
  } else if (option == "disablewavelengthjitter" || option == "pixelstats" ||
             option == "wavefront" || option == "rendercoordsys" || option == "msereferenceimage" ||
             option == "msereferenceout") {
    diagnostics_->Note(location, absl::StrCat("option \"", option,
                                              "\" has no effect: it concerns "
                                              "how pbrt works, not the image"));
  } else if (value != "false") {
    diagnostics_->Error(location,
                        absl::StrCat("option \"", option, "\" is not supported; remove it"));
  }
}

void SceneBuilder::ColorSpace(const std::string& name, SourceLocation location) {
  const std::optional<Primaries> primaries = PrimariesFromName(name);
  if (!primaries.has_value()) {
    diagnostics_->Error(location, absl::StrCat("color space \"", name, "\" is unknown",
                                               SupportedNamesHint(name, PrimariesNames())));
    return;
  }
  state_.primaries = *primaries;
}

void SceneBuilder::Accelerator(const std::string& name, std::vector<Parameter> /*own*/,
                               SourceLocation location) {
  if (!RequireOptions("Accelerator", location)) return;
  diagnostics_->Note(location, absl::StrCat("accelerator \"", name,
                                            "\" and its parameters have no "
                                            "effect: Sheaf builds its own"));
}

void SceneBuilder::Camera(const std::string& type, std::vector<Parameter> own,
                          SourceLocation location) {
  if (!RequireOptions("Camera", location)) return;
  ParameterList parameters =
      Parameters(absl::StrCat("camera \"", type, "\""), "", std::move(own), location);
  CameraDescription camera;
  camera.location = location;
  SetCamera(type, parameters, *files_, &camera, &frame_);
  const TransformOverTime camera_from_world = CurrentTransform();
  camera.world_from_camera = camera_from_world;
  if (!Invert(camera_from_world.start, &camera.world_from_camera.start) ||
      !Invert(camera_from_world.end, &camera.world_from_camera.end)) {
    parameters.Error(absl::StrCat(parameters.owner(), ": the transformation is singular"));
  }
  coordinate_systems_["camera"] = {camera.world_from_camera.start, camera.world_from_camera.end};
  camera.medium = state_.media.outside;
  scene_->camera = std::move(camera);
}

void SceneBuilder::Film(const std::string& type, std::vector<Parameter> own,
                        SourceLocation location) {
  if (!RequireOptions("Film", location)) return;
  ParameterList parameters =
      Parameters(absl::StrCat("film \"", type, "\""), "", std::move(own), location);
  FilmDescription film;
  film.location = location;
  SetFilm(type, parameters, &film, &frame_);
  film.primaries = state_.primaries;
  scene_->film = std::move(film);
}

void SceneBuilder::Integrator(const std::string& type, std::vector<Parameter> own,
                              SourceLocation location) {
  if (!RequireOptions("Integrator", location)) return;
  ParameterList parameters =
      Parameters(absl::StrCat("integrator \"", type, "\""), "", std::move(own), location);
  scene_->sampling.integrator_location = location;
  SetIntegrator(type, parameters, &scene_->sampling);
}

void SceneBuilder::PixelFilter(const std::string& type, std::vector<Parameter> own,
                               SourceLocation location) {
  if (!RequireOptions("PixelFilter", location)) return;
  ParameterList parameters =
      Parameters(absl::StrCat("filter \"", type, "\""), "", std::move(own), location);
  FilterDescription filter;
  filter.location = location;
  SetFilter(type, parameters, &filter);
  scene_->filter = filter;
}

void SceneBuilder::Sampler(const std::string& type, std::vector<Parameter> own,
                           SourceLocation location) {
  if (!RequireOptions("Sampler", location)) return;
  ParameterList parameters =
      Parameters(absl::StrCat("sampler \"", type, "\""), "", std::move(own), location);
  scene_->sampling.sampler_location = location;
  SetSampler(type, parameters, &scene_->sampling);
}

// --- Materials and textures --------------------------------------------------------------------

void SceneBuilder::Attribute(const std::string& target, std::vector<Parameter> own,
                             SourceLocation location) {
  if (target != "shape" && target != "light" && target != "material" && target != "medium" &&
      target != "texture") {
    diagnostics_->Error(location, absl::StrCat("Attribute \"", target,
                                               "\" is unknown; it must be shape, "
                                               "light, material, medium or texture"));
    return;
  }
  // A longer list is a mistake, and every block copies it.
  constexpr size_t kAttributesMax = 256;
  std::vector<Parameter>& attributes = state_.attributes[target];
  for (Parameter& parameter : own) {
    parameter.primaries = state_.primaries;
    if (attributes.size() == kAttributesMax || parameter.ValueCount() > kAttributesMax) {
      diagnostics_->Error(
          parameter.location,
          absl::StrCat("Attribute holds more than the limit of ", kAttributesMax, " values"));
      return;
    }
    attributes.push_back(std::move(parameter));
  }
}

void SceneBuilder::ReverseOrientation(SourceLocation location) {
  if (!RequireWorld("ReverseOrientation", location)) return;
  state_.reverse_orientation = !state_.reverse_orientation;
}

void SceneBuilder::Material(const std::string& type, std::vector<Parameter> own,
                            SourceLocation location) {
  if (!RequireWorld("Material", location)) return;
  state_.material =
      materials_.Add(type, Parameters("material", "material", std::move(own), location));
}

void SceneBuilder::MakeNamedMaterial(const std::string& name, std::vector<Parameter> own,
                                     SourceLocation location) {
  if (!RequireWorld("MakeNamedMaterial", location)) return;
  materials_.AddNamed(name, Parameters("material", "material", std::move(own), location));
}

void SceneBuilder::NamedMaterial(const std::string& name, SourceLocation location) {
  if (!RequireWorld("NamedMaterial", location)) return;
  state_.material = materials_.Refer(name, location);
}

void SceneBuilder::Texture(const std::string& name, const std::string& type,
                           const std::string& kind, std::vector<Parameter> own,
                           SourceLocation location) {
  if (!RequireWorld("Texture", location)) return;
  if (state_.IsAnimated()) {
    diagnostics_->Warning(location,
                          "textures do not move; the transformation at the start is used");
  }
  textures_.Declare(name, type, kind, state_.start,
                    Parameters("texture", "texture", std::move(own), location));
}

// --- Shapes, instances, lights -----------------------------------------------------------------

int32_t SceneBuilder::MatteName(ParameterList& parameters) {
  const std::string name = parameters.GetString("name", "");
  if (name.empty()) return kNone;
  constexpr size_t kNameBytesMax = 255;
  if (name.size() > kNameBytesMax || FindUnprintable(name) != std::string::npos) {
    parameters.ErrorAt(*parameters.Find("name"),
                       absl::StrCat("cannot name a matte: names have at most ", kNameBytesMax,
                                    " bytes, all of printable UTF-8"));
    return kNone;
  }
  const auto [entry, is_new] =
      matte_names_.emplace(name, static_cast<int32_t>(scene_->matte_names.size()));
  if (is_new) {
    if (!shapes_.ChargeMemory(2 * sizeof name + name.size(), parameters.location())) return kNone;
    scene_->matte_names.push_back(name);
  }
  return entry->second;
}

void SceneBuilder::CheckEmitter(const ShapeDescription& shape, ParameterList& parameters) {
  const CameraDescription& camera = scene_->camera;
  if (shape.world_from_object.IsAnimated() && camera.shutter_close > camera.shutter_open) {
    parameters.Error(absl::StrCat(parameters.owner(),
                                  ": an area light cannot move while the shutter is open, as in "
                                  "pbrt-v4; give the emissive shape one transform"));
  }
  size_t faces = 1;
  if (const auto* mesh = std::get_if<MeshShape>(&shape.shape)) {
    faces = scene_->meshes[mesh->mesh].indices.size() / 3;
  } else if (const auto* patches = std::get_if<BilinearMeshShape>(&shape.shape)) {
    faces = scene_->bilinear_meshes[patches->mesh].indices.size() / 4;
  }
  if (faces < 2 || !(scene_->area_lights[shape.area_light].scale.power_w > 0)) return;
  if (std::exchange(has_noted_power_, true)) return;
  diagnostics_->Note(parameters.location(),
                     absl::StrCat(parameters.owner(),
                                  ": the \"power\" of its area light is that of "
                                  "the whole mesh; pbrt-v4 gives it to each of the ",
                                  faces, " faces"));
}

void SceneBuilder::Shape(const std::string& type, std::vector<Parameter> own,
                         SourceLocation location) {
  if (!RequireWorld("Shape", location)) return;
  const bool is_named = std::ranges::find(own, "name", &Parameter::name) != own.end();
  ParameterList parameters =
      Parameters(absl::StrCat("shape \"", type, "\""), "shape", std::move(own), location);
  ShapeDescription shape;
  shape.location = location;
  shape.world_from_object = CurrentTransform();
  shape.reverse_orientation = state_.reverse_orientation;
  shape.material = state_.material == kNone ? materials_.Default() : state_.material;
  Matrix4 inverse;
  if (!Invert(shape.world_from_object.start, &inverse) ||
      !Invert(shape.world_from_object.end, &inverse)) {
    parameters.Error(absl::StrCat(parameters.owner(), ": the transformation is singular"));
  }
  if (parameters.Has("alpha")) {
    shape.has_alpha = true;
    shape.alpha = textures_.GetFloatInput(parameters, "alpha", 1);
  }
  shape.invisible = GetInvisible(parameters);
  if (state_.area_light != kNone) {
    if (open_object_ != kNone) {
      diagnostics_->Warning(location,
                            "shapes of an object emit no light; the area light is ignored here. In "
                            "pbrt-v4 they shine "
                            "where they are seen, but light nothing");
    } else if (materials_.IsInterface(state_.material) && shape.invisible == 0) {
      diagnostics_->Warning(location,
                            "shapes of the material interface emit no light, as in pbrt-v4; the "
                            "area light is ignored here");
    } else {
      shape.area_light = state_.area_light;
    }
  }
  if (open_object_ == kNone) {
    shape.matte_name = MatteName(parameters);
  } else if (is_named) {
    parameters.NoteWithoutEffect("name", "mattes name the shapes of an object by its instances");
  }
  if (!shapes_.SetShape(type, parameters, &shape)) return;
  if (shape.area_light != kNone) CheckEmitter(shape, parameters);
  // Hair has no interior that a ray could be in.
  if (!std::holds_alternative<CurveShape>(shape.shape)) shape.media = state_.media;
  std::vector<int32_t>& shapes = open_object_ == kNone
                                     ? scene_->world_shapes
                                     : scene_->objects[static_cast<size_t>(open_object_)].shapes;
  if (shapes_.JoinCurves(shapes, shape)) return;
  shapes.push_back(static_cast<int32_t>(scene_->shapes.size()));
  scene_->shapes.push_back(std::move(shape));
}

void SceneBuilder::ObjectInstance(const std::string& name, std::vector<Parameter> own,
                                  SourceLocation location) {
  if (!RequireWorld("ObjectInstance", location)) return;
  if (open_object_ != kNone) {
    diagnostics_->Error(location,
                        "ObjectInstance inside of an object is not allowed by the format");
    return;
  }
  struct ObjectInstance instance;
  instance.location = location;
  if (!own.empty()) {
    ParameterList parameters =
        Parameters(absl::StrCat("instance of \"", name, "\""), "", std::move(own), location);
    instance.matte_name = MatteName(parameters);
    parameters.ReportUnused();
  }
  instance.world_from_instance = CurrentTransform();
  if (!ObjectSlot(name, location, &instance.object)) return;
  Matrix4 inverse;
  if (!Invert(instance.world_from_instance.start, &inverse) ||
      !Invert(instance.world_from_instance.end, &inverse)) {
    diagnostics_->Error(location,
                        absl::StrCat("object \"", name, "\": the transformation is singular"));
    return;
  }
  if (shapes_.ChargeMemory(sizeof instance, location)) scene_->instances.push_back(instance);
}

void SceneBuilder::FinishObjects() {
  std::vector<std::string> names;
  for (size_t i = 0; i < scene_->objects.size(); ++i) {
    if (object_is_defined_[i]) names.push_back(scene_->objects[i].name);
  }
  for (size_t i = 0; i < scene_->objects.size(); ++i) {
    if (object_is_defined_[i]) continue;
    const ObjectDefinition& object = scene_->objects[i];
    diagnostics_->Error(object.location,
                        absl::StrCat("object \"", object.name, "\" is used here but not defined",
                                     NearestNameHint(object.name, names)));
  }
}

void SceneBuilder::LightSource(const std::string& type, std::vector<Parameter> own,
                               SourceLocation location) {
  if (!RequireWorld("LightSource", location)) return;
  ParameterList parameters =
      Parameters(absl::StrCat("light \"", type, "\""), "light", std::move(own), location);
  if (state_.IsAnimated()) {
    diagnostics_->Warning(location, "lights do not move; the transformation at the start is used");
  }
  std::optional<LightDescription> light = GetLight(type, state_.start, parameters, *files_);
  if (light.has_value()) scene_->lights.push_back(std::move(*light));
}

void SceneBuilder::AreaLightSource(const std::string& type, std::vector<Parameter> own,
                                   SourceLocation location) {
  if (!RequireWorld("AreaLightSource", location)) return;
  ParameterList parameters =
      Parameters(absl::StrCat("area light \"", type, "\""), "light", std::move(own), location);
  std::optional<AreaLightDescription> light = GetAreaLight(type, parameters, *files_);
  if (!light.has_value()) return;
  state_.area_light = static_cast<int32_t>(scene_->area_lights.size());
  scene_->area_lights.push_back(std::move(*light));
}

}  // namespace sheaf
