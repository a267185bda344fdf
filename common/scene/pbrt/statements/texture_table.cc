// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "common/scene/pbrt/statements/texture_table.h"

#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "common/base/check.h"
#include "common/scene/formats/number.h"
#include "common/scene/pbrt/statements/color_parameters.h"
#include "common/scene/pbrt/statements/supported_names.h"
#include "common/scene/spectrum/spectrum.h"

namespace sheaf {
namespace {

TextureWrap GetWrap(ParameterList& parameters) {
  const std::string wrap = parameters.GetString("wrap", "repeat");
  if (wrap == "repeat") return TextureWrap::kRepeat;
  if (wrap == "black") return TextureWrap::kBlack;
  if (wrap == "clamp") return TextureWrap::kClamp;
  if (wrap == "octahedralsphere") return TextureWrap::kOctahedral;
  parameters.ErrorAt(*parameters.Find("wrap"),
                     absl::StrCat("is \"", wrap,
                                  "\"; it must be repeat, black, clamp or "
                                  "octahedralsphere"));
  return TextureWrap::kRepeat;
}

ImageTexture::Filter GetFilter(ParameterList& parameters) {
  const std::string filter = parameters.GetString("filter", "bilinear");
  if (filter == "point") return ImageTexture::Filter::kPoint;
  if (filter == "bilinear") return ImageTexture::Filter::kBilinear;
  if (filter == "trilinear") return ImageTexture::Filter::kTrilinear;
  if (filter == "ewa" || filter == "EWA") return ImageTexture::Filter::kEwa;
  parameters.ErrorAt(
      *parameters.Find("filter"),
      absl::StrCat("is \"", filter, "\"; it must be point, bilinear, trilinear or ewa"));
  return ImageTexture::Filter::kBilinear;
}

void GetEncoding(ParameterList& parameters, ImageTexture* image) {
  const std::string encoding = parameters.GetString("encoding", "");
  if (encoding.empty()) return;
  if (encoding == "sRGB") {
    image->encoding = ColorEncoding::kSrgb;
  } else if (encoding == "linear") {
    image->encoding = ColorEncoding::kLinear;
  } else if (encoding.rfind("gamma ", 0) == 0 &&
             ParseFloat(std::string_view(encoding).substr(6), &image->encoding_gamma) &&
             image->encoding_gamma > 0) {
    image->encoding = ColorEncoding::kGamma;
  } else {
    parameters.ErrorAt(*parameters.Find("encoding"),
                       absl::StrCat("is \"", encoding,
                                    "\"; it must be sRGB, linear or gamma with a number, such as "
                                    "\"gamma 2.2\""));
  }
}

const std::map<std::string, NoiseTexture::Kind> kNoiseKinds = {
    {"fbm", NoiseTexture::Kind::kFbm},
    {"wrinkled", NoiseTexture::Kind::kWrinkled},
    {"windy", NoiseTexture::Kind::kWindy}};

// Recomputes rgb for another role.
void SetRole(ColorSpec* color, ColorRole role) { color->rgb = SpectrumToRgb(*color, role); }

}  // namespace

Matrix4 TextureFromWorld(ParameterList& parameters, const Matrix4& world_from_texture) {
  Matrix4 texture_from_world;
  if (!Invert(world_from_texture, &texture_from_world)) {
    parameters.Error(absl::StrCat(parameters.owner(), ": the transformation is singular"));
  }
  return texture_from_world;
}

UvMapping GetUvMapping(ParameterList& parameters, const Matrix4& world_from_texture) {
  UvMapping mapping;
  const std::string kind = parameters.GetString("mapping", "uv");
  mapping.texture_from_world = TextureFromWorld(parameters, world_from_texture);
  if (kind == "uv") {
    mapping.scale_u = parameters.GetFloat("uscale", 1);
    mapping.scale_v = parameters.GetFloat("vscale", 1);
  } else if (kind == "planar") {
    mapping.kind = UvMapping::Kind::kPlanar;
    mapping.planar_u = parameters.GetVector3("v1", {1, 0, 0});
    mapping.planar_v = parameters.GetVector3("v2", {0, 1, 0});
  } else if (kind == "spherical") {
    mapping.kind = UvMapping::Kind::kSpherical;
  } else if (kind == "cylindrical") {
    mapping.kind = UvMapping::Kind::kCylindrical;
  } else {
    parameters.ErrorAt(
        *parameters.Find("mapping"),
        absl::StrCat("is \"", kind, "\"; it must be uv, planar, spherical or cylindrical"));
  }
  if (mapping.kind == UvMapping::Kind::kUv || mapping.kind == UvMapping::Kind::kPlanar) {
    mapping.offset_u = parameters.GetFloat("udelta", 0);
    mapping.offset_v = parameters.GetFloat("vdelta", 0);
  }
  return mapping;
}

void TextureTable::Declare(const std::string& name, const std::string& type,
                           const std::string& kind, const Matrix4& world_from_texture,
                           ParameterList parameters) {
  parameters.set_owner(absl::StrCat("texture \"", name, "\""));
  if (type != "float" && type != "spectrum") {
    parameters.Error(absl::StrCat(parameters.owner(), " has the unknown type \"", type,
                                  "\"; it must be float or spectrum"));
    return;
  }
  TextureDescription texture;
  texture.name = name;
  texture.is_color = type == "spectrum";
  texture.location = parameters.location();
  is_declaring_ = true;
  auto made = Make(parameters, kind, texture.is_color, world_from_texture);
  is_declaring_ = false;
  if (made.has_value()) {
    texture.texture = *std::move(made);
    parameters.ReportUnused();
  }
  Slot& slot = SlotFor(texture.is_color, ColorRole::kReflectance, name, texture.location);
  if (slot.is_declared) {
    parameters.Error(absl::StrCat(
        parameters.owner(), " is declared twice; the first is at ",
        FormatLocation(*scene_, scene_->textures[static_cast<size_t>(slot.index)].location)));
    return;
  }
  slot.is_declared = true;
  scene_->textures[static_cast<size_t>(slot.index)] = std::move(texture);
}

std::optional<decltype(TextureDescription::texture)> TextureTable::Make(
    ParameterList& parameters, const std::string& kind, bool is_color,
    const Matrix4& world_from_texture) {
  if (kind == "constant") return MakeConstant(parameters, is_color);
  if (kind == "imagemap") return MakeImage(parameters, world_from_texture);
  if (kind == "checkerboard") return MakeCheckerboard(parameters, is_color, world_from_texture);
  if (kind == "scale") return MakeScale(parameters, is_color);
  if (kind == "mix") return MakeMix(parameters, is_color);
  if (kind == "directionmix") return MakeDirectionMix(parameters, is_color, world_from_texture);
  if (kind == "bilerp") return MakeBilerp(parameters, is_color, world_from_texture);
  if (kind == "dots") return MakeDots(parameters, is_color, world_from_texture);
  if (kind == "node") return MakeNode(parameters, world_from_texture);
  if (kind == "ramp") return MakeRamp(parameters, is_color);
  const auto noise = kNoiseKinds.find(kind);
  if (noise != kNoiseKinds.end() || kind == "marble") {
    const bool wants_color = kind == "marble";
    if (is_color != wants_color) {
      parameters.Error(absl::StrCat(
          parameters.owner(), ": class \"", kind, "\" is a ", wants_color ? "spectrum" : "float",
          " texture",
          wants_color ? "" : "; for a color, give it to \"mix\" as \"texture amount\""));
      return std::nullopt;
    }
    if (wants_color) return MakeMarble(parameters, world_from_texture);
    return MakeNoise(parameters, noise->second, world_from_texture);
  }
  parameters.Error(absl::StrCat(
      parameters.owner(), ": class \"", kind, "\" is not supported",
      SupportedNamesHint(
          kind, {"constant", "imagemap", "checkerboard", "scale", "mix", "directionmix", "bilerp",
                 "dots", "fbm", "wrinkled", "windy", "marble", "node", "ramp"})));
  return std::nullopt;
}

int32_t TextureTable::GetNormalMap(ParameterList& parameters) {
  const std::string filename = parameters.GetString("normalmap", "");
  if (filename.empty()) return kNone;
  ImageTexture image;
  image.file = CanonicalFileName(filename);
  image.encoding = ColorEncoding::kLinear;
  const Parameter& parameter = *parameters.Find("normalmap");
  if (const auto path = files_->LocalPath(image.file); !path.ok()) {
    parameters.ErrorAt(parameter, absl::StrCat("cannot be read: ", path.status().message()));
  }
  // No texture of a file has this name, as it contains quotes.
  Slot& slot = SlotFor(true, ColorRole::kUnbounded, absl::StrCat("normal map \"", image.file, "\""),
                       parameter.location);
  slot.is_declared = true;
  scene_->textures[static_cast<size_t>(slot.index)].texture = std::move(image);
  return slot.index;
}

ConstantTexture TextureTable::MakeConstant(ParameterList& parameters, bool is_color) {
  ConstantTexture constant;
  if (is_color) {
    constant.color =
        GetColor(parameters, "value", ColorRole::kReflectance, RgbColor(Rgb::Gray(1)), *files_);
  } else {
    constant.value = parameters.GetFloat("value", 1);
  }
  return constant;
}

ImageTexture TextureTable::MakeImage(ParameterList& parameters, const Matrix4& world_from_texture) {
  ImageTexture image;
  image.mapping = GetUvMapping(parameters, world_from_texture);
  const std::string filename = parameters.GetString("filename", "");
  image.file = CanonicalFileName(filename);
  if (filename.empty()) {
    parameters.Error(absl::StrCat(parameters.owner(), " needs \"string filename\""));
  } else if (const auto path = files_->LocalPath(image.file); !path.ok()) {
    parameters.ErrorAt(*parameters.Find("filename"),
                       absl::StrCat("cannot be read: ", path.status().message()));
  }
  image.wrap = GetWrap(parameters);
  image.filter = GetFilter(parameters);
  GetEncoding(parameters, &image);
  image.scale = parameters.GetFloat("scale", 1);
  image.invert = parameters.GetBool("invert", false);
  parameters.NoteWithoutEffect("maxanisotropy", "texture filters follow camera rays only");
  return image;
}

CheckerboardTexture TextureTable::MakeCheckerboard(ParameterList& parameters, bool is_color,
                                                   const Matrix4& world_from_texture) {
  CheckerboardTexture board;
  board.dimensions = parameters.GetInteger("dimension", 2);
  if (board.dimensions == 2) {
    board.mapping = GetUvMapping(parameters, world_from_texture);
  } else if (board.dimensions == 3) {
    board.mapping.texture_from_world = TextureFromWorld(parameters, world_from_texture);
  } else {
    parameters.ErrorAt(*parameters.Find("dimension"), "must be 2 or 3");
  }
  for (int i = 0; i < 2; ++i) {
    const std::string name = i == 0 ? "tex1" : "tex2";
    const float fallback = i == 0 ? 1.f : 0.f;
    if (is_color) {
      board.color[i] =
          GetColorInput(parameters, name, ColorRole::kReflectance, RgbColor(Rgb::Gray(fallback)));
    } else {
      board.value[i] = GetFloatInput(parameters, name, fallback);
    }
  }
  return board;
}

ScaleTexture TextureTable::MakeScale(ParameterList& parameters, bool is_color) {
  ScaleTexture scale;
  if (is_color) {
    scale.color = GetColorInput(parameters, "tex", ColorRole::kReflectance, RgbColor(Rgb::Gray(1)));
  } else {
    scale.value = GetFloatInput(parameters, "tex", 1);
  }
  scale.scale = GetFloatInput(parameters, "scale", 1);
  return scale;
}

MixTexture TextureTable::MakeMix(ParameterList& parameters, bool is_color) {
  MixTexture mix;
  for (int i = 0; i < 2; ++i) {
    const std::string name = i == 0 ? "tex1" : "tex2";
    const float fallback = i == 0 ? 0.f : 1.f;
    if (is_color) {
      mix.color[i] =
          GetColorInput(parameters, name, ColorRole::kReflectance, RgbColor(Rgb::Gray(fallback)));
    } else {
      mix.value[i] = GetFloatInput(parameters, name, fallback);
    }
  }
  mix.amount = GetFloatInput(parameters, "amount", 0.5f);
  return mix;
}

FloatInput TextureTable::GetFloatInput(ParameterList& parameters, const std::string& name,
                                       float fallback) {
  FloatInput input;
  input.value = fallback;
  const Parameter* parameter = parameters.Find(name);
  if (parameter == nullptr) return input;
  if (parameter->type == ParameterType::kTexture) {
    input.texture = Refer(parameters, *parameter, false, ColorRole::kUnbounded);
  } else {
    input.value = parameters.GetFloat(name, fallback);
  }
  return input;
}

ColorInput TextureTable::GetColorInput(ParameterList& parameters, const std::string& name,
                                       ColorRole role, const ColorSpec& fallback) {
  ColorInput input;
  input.value = fallback;
  const Parameter* parameter = parameters.Find(name);
  if (parameter == nullptr) return input;
  if (parameter->type == ParameterType::kTexture) {
    input.texture = Refer(parameters, *parameter, true, role);
  } else {
    input.value = GetColor(parameters, name, role, fallback, *files_);
  }
  return input;
}

int32_t TextureTable::Refer(ParameterList& parameters, const Parameter& parameter, bool is_color,
                            ColorRole role) {
  if (parameter.strings.size() != 1) {
    parameters.ErrorAt(parameter, absl::StrCat("needs the name of one texture but has ",
                                               parameter.strings.size()));
    return kNone;
  }
  const std::string& name = parameter.strings[0];
  // Float textures have only one role.
  const ColorRole wanted = is_color ? role : ColorRole::kReflectance;
  if (is_declaring_) {
    const auto found = slots_.find(Key(is_color, ColorRole::kReflectance, name));
    if (found == slots_.end() || !found->second.is_declared) {
      parameters.ErrorAt(
          parameter, absl::StrCat("refers to the ", is_color ? "spectrum" : "float", " texture \"",
                                  name, "\", which is not declared before this line"));
      return kNone;
    }
  }
  return SlotFor(is_color, wanted, name, parameter.location).index;
}

TextureTable::Slot& TextureTable::SlotFor(bool is_color, ColorRole role, const std::string& name,
                                          SourceLocation location) {
  Slot& slot = slots_[Key(is_color, role, name)];
  if (slot.index == kNone) {
    slot.index = static_cast<int32_t>(scene_->textures.size());
    TextureDescription texture;
    texture.name = name;
    texture.is_color = is_color;
    texture.role = role;
    texture.location = location;
    scene_->textures.push_back(std::move(texture));
  }
  return slot;
}

void TextureTable::Finish() {
  // Copies may request further copies, which are appended.
  for (size_t i = 0; i < scene_->textures.size() && !diagnostics_->Exhausted(); ++i) {
    const bool is_color = scene_->textures[i].is_color;
    const ColorRole role = scene_->textures[i].role;
    const std::string name = scene_->textures[i].name;
    Slot& slot = slots_[Key(is_color, role, name)];
    if (slot.is_declared) continue;
    const auto base = slots_.find(Key(is_color, ColorRole::kReflectance, name));
    if (base == slots_.end() || !base->second.is_declared) {
      diagnostics_->Error(scene_->textures[i].location,
                          absl::StrCat("the ", is_color ? "spectrum" : "float", " texture \"", name,
                                       "\" is used here but not declared"));
      continue;
    }
    slot.is_declared = true;
    CopyForRole(base->second.index, static_cast<int32_t>(i), role);
  }
}

void TextureTable::CopyForRole(int32_t source, int32_t target, ColorRole role) {
  TextureDescription copy = scene_->textures[static_cast<size_t>(source)];
  copy.role = role;
  const auto convert = [&](ColorInput* input) {
    SetRole(&input->value, role);
    if (input->texture == kNone) return;
    const TextureDescription& inner = scene_->textures[static_cast<size_t>(input->texture)];
    const std::string inner_name = inner.name;
    input->texture = SlotFor(true, role, inner_name, copy.location).index;
  };
  if (auto* constant = std::get_if<ConstantTexture>(&copy.texture)) SetRole(&constant->color, role);
  if (auto* scale = std::get_if<ScaleTexture>(&copy.texture)) convert(&scale->color);
  if (auto* board = std::get_if<CheckerboardTexture>(&copy.texture)) {
    convert(&board->color[0]);
    convert(&board->color[1]);
  }
  if (auto* mix = std::get_if<MixTexture>(&copy.texture)) {
    convert(&mix->color[0]);
    convert(&mix->color[1]);
  }
  if (auto* mix = std::get_if<DirectionMixTexture>(&copy.texture)) {
    for (ColorInput& color : mix->color) convert(&color);
  }
  if (auto* dots = std::get_if<DotsTexture>(&copy.texture)) {
    for (ColorInput& color : dots->color) convert(&color);
  }
  if (auto* bilerp = std::get_if<BilerpTexture>(&copy.texture)) {
    for (ColorSpec& color : bilerp->color) SetRole(&color, role);
  }
  scene_->textures[static_cast<size_t>(target)] = std::move(copy);
}

}  // namespace sheaf
