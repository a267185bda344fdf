// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "common/scene/pbrt/statements/material_table.h"

#include <algorithm>
#include <utility>
#include <variant>
#include <vector>

#include "absl/strings/str_cat.h"
#include "common/scene/pbrt/statements/color_parameters.h"
#include "common/scene/pbrt/statements/mix_graph.h"
#include "common/scene/pbrt/statements/supported_names.h"
#include "common/scene/spectrum/spectrum.h"

namespace sheaf {
namespace {

constexpr float kDefaultSheetFraction = 0.25f;  // Reflected by and crossing a diffuse sheet.
constexpr float kDefaultIndex = 1.5f;

ColorSpec NamedColor(const std::string& name) {
  ColorSpec color;
  color.kind = ColorSpec::Kind::kNamed;
  color.name = name;
  color.rgb = SpectrumToRgb(color, ColorRole::kUnbounded);
  return color;
}

// Calls visit(Material{}) for each described material.
template <typename Visit>
void ForEachDescribed(const Visit& visit) {
  const auto visit_all = [&]<typename... Materials>(const std::variant<Materials...>*) {
    const auto visit_one = [&]<typename Material>(Material material) {
      if constexpr (DescribedMaterial<Material>) visit(material);
    };
    (visit_one(Materials{}), ...);
  };
  visit_all(static_cast<const decltype(MaterialDescription::material)*>(nullptr));
}

std::vector<std::string> KnownTypes() {
  std::vector<std::string> types;
  ForEachDescribed(
      [&]<typename Material>(const Material&) { types.emplace_back(Material::kType); });
  for (const char* type :
       {"diffusetransmission", "conductor", "dielectric", "thindielectric", "coateddiffuse",
        "coatedconductor", "hair", "measured", "principled", "subsurface", "mix", "interface"}) {
    types.emplace_back(type);
  }
  return types;
}

}  // namespace

int32_t MaterialTable::Add(const std::string& type, ParameterList parameters) {
  parameters.set_owner(absl::StrCat("material \"", type, "\""));
  std::string name = parameters.GetString("name", "");  // Before Make reports what is unused.
  const std::string written = absl::StrCat(type, ":", parameters.Written());
  MaterialDescription material = Make(type, parameters);
  material.location = parameters.location();
  material = WithAlpha(std::move(material));
  material.name = std::move(name);
  const auto index = static_cast<int32_t>(scene_->materials.size());
  material.first_alike = unnamed_.try_emplace(written, index).first->second;
  scene_->materials.push_back(std::move(material));
  return index;
}

void MaterialTable::AddNamed(const std::string& name, ParameterList parameters) {
  parameters.set_owner(absl::StrCat("named material \"", name, "\""));
  Slot& slot = SlotFor(name, parameters.location());
  if (slot.is_made) {
    const auto& first = scene_->materials[static_cast<size_t>(slot.index)];
    parameters.Error(absl::StrCat(parameters.owner(), " is defined twice; the first is at ",
                                  FormatLocation(*scene_, first.location)));
    return;
  }
  slot.is_made = true;
  const auto index = static_cast<size_t>(slot.index);
  scene_->materials[index].location = parameters.location();
  const std::string type = parameters.GetString("type", "");
  if (type.empty()) {
    parameters.Error(
        absl::StrCat(parameters.owner(), " needs \"string type\", such as \"diffuse\""));
    return;
  }
  // Make may refer to further materials, which moves the vector.
  MaterialDescription made = Make(type, parameters);
  made.location = parameters.location();
  made = WithAlpha(std::move(made));
  made.name = std::move(scene_->materials[index].name);
  made.location = scene_->materials[index].location;
  scene_->materials[index] = std::move(made);
}

int32_t MaterialTable::Refer(const std::string& name, SourceLocation location) {
  return SlotFor(name, location).index;
}

int32_t MaterialTable::Default() {
  if (default_ != kNone) return default_;
  default_ = static_cast<int32_t>(scene_->materials.size());
  MaterialDescription material;
  DiffuseMaterial diffuse;
  diffuse.reflectance.value = RgbColor(Rgb::Gray(kDefaultReflectance));
  material.material = diffuse;
  scene_->materials.push_back(std::move(material));
  return default_;
}

bool MaterialTable::IsInterface(int32_t material) const {
  return material != kNone && std::holds_alternative<InterfaceMaterial>(
                                  scene_->materials[static_cast<size_t>(material)].material);
}

MaterialTable::Slot& MaterialTable::SlotFor(const std::string& name, SourceLocation location) {
  Slot& slot = slots_[name];
  if (slot.index == kNone) {
    slot.index = static_cast<int32_t>(scene_->materials.size());
    MaterialDescription material;
    material.name = name;
    material.location = location;
    scene_->materials.push_back(std::move(material));
  }
  return slot;
}

bool MaterialTable::MakeDescribed(const std::string& type, ParameterList& parameters,
                                  Variant* material) {
  struct Reader {
    void Reflectance(const char* name, ColorInput& input, float fallback) {
      input = table.textures_->GetColorInput(parameters, name, ColorRole::kReflectance,
                                             RgbColor(Rgb::Gray(fallback)));
    }
    void Roughness(RoughnessInput& input) { input = table.GetRoughness(parameters); }
    MaterialTable& table;
    ParameterList& parameters;
  } reader{*this, parameters};
  bool found = false;
  ForEachDescribed([&]<typename Material>(Material described) {
    if (type != Material::kType) return;
    found = true;
    Material::ForEachInput(described, reader);
    *material = described;
  });
  return found;
}

MaterialDescription MaterialTable::Make(const std::string& type, ParameterList& parameters) {
  MaterialDescription description;
  Variant& material = description.material;
  if (MakeDescribed(type, parameters, &material)) {
    // All of it is read.
  } else if (type == "diffusetransmission") {
    material = MakeDiffuseTransmission(parameters);
  } else if (type == "conductor") {
    material = MakeConductor(parameters);
  } else if (type == "dielectric") {
    material = MakeDielectric(parameters);
  } else if (type == "thindielectric") {
    material = MakeThinDielectric(parameters);
  } else if (type == "coateddiffuse") {
    material = MakeCoatedDiffuse(parameters);
  } else if (type == "coatedconductor") {
    material = MakeCoatedConductor(parameters);
  } else if (type == "hair") {
    material = MakeHair(parameters);
  } else if (type == "measured") {
    material = MakeMeasured(parameters);
  } else if (type == "subsurface") {
    material = MakeSubsurface(parameters);
  } else if (type == "principled") {
    material = MakePrincipled(parameters);
  } else if (type == "mix") {
    material = MakeMix(parameters);
  } else if (type == "interface" || type.empty() || type == "none") {
    if (type != "interface") {
      diagnostics_->Warning(parameters.location(), absl::StrCat("material \"", type,
                                                                "\" is an old "
                                                                "spelling; write \"interface\""));
    }
    material = InterfaceMaterial{};
  } else {
    parameters.Error(absl::StrCat(parameters.owner(), ": type \"", type, "\" is unknown",
                                  SupportedNamesHint(type, KnownTypes())));
    return description;
  }
  if (std::holds_alternative<DielectricMaterial>(material) ||
      std::holds_alternative<SubsurfaceMaterial>(material) ||
      std::holds_alternative<InterfaceMaterial>(material)) {
    if (parameters.Has("priority")) description.priority = parameters.GetInteger("priority", 0);
  }
  if (!std::holds_alternative<InterfaceMaterial>(material)) GetBumps(parameters, &description);
  parameters.ReportUnused();
  return description;
}

void MaterialTable::GetBumps(ParameterList& parameters, MaterialDescription* description) {
  if (std::holds_alternative<MixMaterial>(description->material)) {
    const char* why = "a mix has no surface of its own; give it to the materials it mixes";
    parameters.NoteWithoutEffect("displacement", why);
    parameters.NoteWithoutEffect("normalmap", why);
    return;
  }
  if (std::holds_alternative<HairMaterial>(description->material)) {
    const char* why = "hair scatters light regardless of its normal";
    parameters.NoteWithoutEffect("displacement", why);
    parameters.NoteWithoutEffect("normalmap", why);
    return;
  }
  description->normal_map = textures_->GetNormalMap(parameters);
  if (description->normal_map != kNone) {
    parameters.NoteWithoutEffect("displacement", "the normal map replaces it");
    return;
  }
  description->displacement = textures_->GetFloatInput(parameters, "displacement", 0);
}

DiffuseTransmissionMaterial MaterialTable::MakeDiffuseTransmission(ParameterList& parameters) {
  DiffuseTransmissionMaterial sheet;
  const ColorSpec fallback = RgbColor(Rgb::Gray(kDefaultSheetFraction));
  sheet.reflectance =
      textures_->GetColorInput(parameters, "reflectance", ColorRole::kReflectance, fallback);
  sheet.transmittance =
      textures_->GetColorInput(parameters, "transmittance", ColorRole::kReflectance, fallback);
  sheet.scale = parameters.GetFloat("scale", 1);
  if (!(sheet.scale >= 0)) parameters.Error(parameters.owner() + ": scale is negative");
  if (sheet.reflectance.texture != kNone || sheet.transmittance.texture != kNone) return sheet;
  const Rgb sum = (sheet.reflectance.value.rgb + sheet.transmittance.value.rgb) * sheet.scale;
  // Sums such as 0.7 + 0.3 may exceed 1 by rounding, which is not reported.
  constexpr float kSumMax = 1.0001f;
  if (MaxComponent(sum) > kSumMax) {
    diagnostics_->Warning(
        parameters.location(),
        absl::StrCat(parameters.owner(), ": reflectance and transmittance add up to ",
                     MaxComponent(sum), "; a surface cannot scatter more light than it receives"));
  }
  return sheet;
}

RoughnessInput MaterialTable::GetRoughness(ParameterList& parameters, const std::string& prefix) {
  RoughnessInput roughness;
  const FloatInput both = textures_->GetFloatInput(parameters, prefix + "roughness", 0);
  const auto along = [&](const std::string& name) {
    return parameters.Has(name) ? textures_->GetFloatInput(parameters, name, 0) : both;
  };
  roughness.u = along(prefix + "uroughness");
  roughness.v = along(prefix + "vroughness");
  roughness.remap_roughness = parameters.GetBool("remaproughness", true);
  for (const FloatInput& input : {both, roughness.u, roughness.v}) {
    if (input.texture == kNone && input.value < 0) {
      parameters.Error(
          absl::StrCat(parameters.owner(), ": roughness ", input.value, " is negative"));
    }
  }
  return roughness;
}

RoughnessInput MaterialTable::GetConstantRoughness(ParameterList& parameters,
                                                   const std::string& prefix) {
  RoughnessInput roughness = GetRoughness(parameters, prefix);
  for (const char* name : {"roughness", "uroughness", "vroughness"}) {
    const Parameter* parameter = parameters.Find(prefix + name);
    if (parameter == nullptr || parameter->type != ParameterType::kTexture) continue;
    parameters.ErrorAt(*parameter, "is not supported as a texture; give a number");
    roughness.u = roughness.v = {};
  }
  return roughness;
}

ConductorMaterial MaterialTable::MakeConductor(ParameterList& parameters) {
  ConductorMaterial conductor;
  conductor.roughness = GetRoughness(parameters);
  GetConductor(parameters, "", &conductor);
  return conductor;
}

void MaterialTable::GetConductor(ParameterList& parameters, const std::string& prefix,
                                 ConductorMaterial* conductor) {
  const std::string eta = prefix + "eta", k = prefix + "k";
  conductor->has_reflectance = parameters.Has("reflectance");
  if (conductor->has_reflectance) {
    if (parameters.Has(eta) || parameters.Has(k)) {
      parameters.Error(absl::StrCat(parameters.owner(), ": reflectance excludes ", eta, " and ", k,
                                    "; give one or the other"));
    }
    conductor->reflectance = textures_->GetColorInput(
        parameters, "reflectance", ColorRole::kReflectance, RgbColor(Rgb::Gray(1)));
    return;
  }
  conductor->eta =
      textures_->GetColorInput(parameters, eta, ColorRole::kUnbounded, NamedColor("metal-Cu-eta"));
  conductor->k =
      textures_->GetColorInput(parameters, k, ColorRole::kUnbounded, NamedColor("metal-Cu-k"));
}

RefractiveIndex MaterialTable::GetIndex(ParameterList& parameters, const std::string& name) {
  RefractiveIndex index{kDefaultIndex, {}};
  const Parameter* parameter = parameters.Find(name);
  if (parameter == nullptr) return index;
  if (parameter->type == ParameterType::kFloat) {
    index.mean = parameters.GetFloat(name, kDefaultIndex);
  } else if (parameter->type == ParameterType::kSpectrum) {
    const ColorSpec eta = GetColor(parameters, name, ColorRole::kUnbounded,
                                   RgbColor(Rgb::Gray(kDefaultIndex)), *files_);
    index.mean = MeanIndex(eta);
    if (VariesWithWavelength(eta)) index.spectrum = eta;
  } else {
    parameters.ErrorAt(*parameter, "must be of type float or spectrum");
  }
  if (!(index.mean > 0)) {
    parameters.ErrorAt(*parameter,
                       absl::StrCat("is ", index.mean, "; an index must be greater than 0"));
    return {kDefaultIndex, {}};
  }
  return index;
}

DielectricMaterial MaterialTable::MakeDielectric(ParameterList& parameters) {
  DielectricMaterial dielectric;
  dielectric.roughness = GetRoughness(parameters);
  dielectric.eta = GetIndex(parameters);
  return dielectric;
}

ThinDielectricMaterial MaterialTable::MakeThinDielectric(ParameterList& parameters) {
  return ThinDielectricMaterial{GetIndex(parameters)};
}

float MaterialTable::GetConstant(ParameterList& parameters, const std::string& name,
                                 float fallback) {
  const Parameter* parameter = parameters.Find(name);
  if (parameter != nullptr && parameter->type == ParameterType::kTexture) {
    parameters.ErrorAt(*parameter, "is not supported as a texture; give a number");
    return fallback;
  }
  return parameters.GetFloat(name, fallback);
}

CoatedDiffuseMaterial MaterialTable::MakeCoatedDiffuse(ParameterList& parameters) {
  CoatedDiffuseMaterial coated;
  coated.roughness = GetRoughness(parameters);
  coated.reflectance = textures_->GetColorInput(parameters, "reflectance", ColorRole::kReflectance,
                                                RgbColor(Rgb::Gray(kDefaultReflectance)));
  GetCoat(parameters, "eta", &coated);
  return coated;
}

CoatedConductorMaterial MaterialTable::MakeCoatedConductor(ParameterList& parameters) {
  CoatedConductorMaterial coated;
  coated.roughness = GetConstantRoughness(parameters, "interface.");
  coated.conductor.roughness = GetConstantRoughness(parameters, "conductor.");
  GetConductor(parameters, "conductor.", &coated.conductor);
  GetCoat(parameters, "interface.eta", &coated);
  return coated;
}

MixMaterial MaterialTable::MakeMix(ParameterList& parameters) {
  MixMaterial mix;
  mix.amount = textures_->GetFloatInput(parameters, "amount", 0.5f);
  const std::vector<std::string> names = parameters.GetStrings("materials");
  if (names.size() != 2) {
    parameters.Error(absl::StrCat(parameters.owner(),
                                  " needs \"string materials\" with the names of "
                                  "2 named materials, but has ",
                                  names.size()));
    return mix;
  }
  for (size_t i = 0; i < 2; ++i) mix.material[i] = Refer(names[i], parameters.location());
  return mix;
}

void MaterialTable::Finish() {
  for (const auto& [name, slot] : slots_) {
    const MaterialDescription& material = scene_->materials[static_cast<size_t>(slot.index)];
    if (!slot.is_made) {
      std::vector<std::string> names;
      for (const auto& [other, other_slot] : slots_) {
        if (other_slot.is_made) names.push_back(other);
      }
      diagnostics_->Error(material.location,
                          absl::StrCat("material \"", name, "\" is used here but not defined",
                                       NearestNameHint(name, names)));
    }
    if (diagnostics_->Exhausted()) return;
  }
  CheckMixes(*scene_, mix_depth_max_, diagnostics_);
  for (const MaterialDescription& material : scene_->materials) {
    const auto* mix = std::get_if<MixMaterial>(&material.material);
    if (mix == nullptr) continue;
    for (const int32_t part : mix->material) {
      if (part == kNone) continue;
      const MaterialDescription& mixed = scene_->materials[static_cast<size_t>(part)];
      const bool is_subsurface = std::holds_alternative<SubsurfaceMaterial>(mixed.material);
      if (!is_subsurface && !mixed.priority.has_value()) continue;
      diagnostics_->Error(
          material.location,
          absl::StrCat("a mix cannot hold \"", mixed.name, "\", which ",
                       is_subsurface ? "is subsurface" : "has a priority",
                       ": a path must leave an interior by the material through which it entered"));
    }
  }
}

}  // namespace sheaf
