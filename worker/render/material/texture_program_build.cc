// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Builds TextureProgram: children before parents, constants folded.
#include <algorithm>
#include <array>
#include <utility>

#include "absl/strings/str_cat.h"
#include "common/base/log.h"
#include "common/base/status.h"
#include "common/scene/named_as_in_scene.h"
#include "worker/render/color/file_primaries.h"
#include "worker/render/material/node_textures.h"
#include "worker/render/material/texture_program.h"

namespace sheaf::render {
namespace {

TexelEncoding EncodingOf(const ImageTexture& image) {
  switch (image.encoding) {
    case ColorEncoding::kLinear:
      return {TexelEncoding::Kind::kLinear};
    case ColorEncoding::kSrgb:
      return {TexelEncoding::Kind::kSrgb};
    case ColorEncoding::kGamma:
      return {TexelEncoding::Kind::kGamma, image.encoding_gamma};
  }
  return {};
}

}  // namespace

class TextureProgram::Builder {
 public:
  Builder(const SceneDescription& scene, FileSource& files, TextureCache& cache, bool spectral)
      : scene_(scene),
        files_(files),
        cache_(cache),
        states_(scene.textures.size()),
        costs_(scene.textures.size(), 1),
        is_normal_map_(scene.textures.size()) {
    const auto note = [this](int32_t texture) {
      if (texture != kNone) is_normal_map_[static_cast<size_t>(texture)] = true;
    };
    for (const MaterialDescription& material : scene.materials) {
      note(material.normal_map);
      if (material.coat_normals) note(material.coat_normals->map);
      const auto* principled = std::get_if<PrincipledMaterial>(&material.material);
      if (principled != nullptr) note(principled->anisotropy_direction);
    }
    program_.cache_ = &cache;
    program_.spectral_ = spectral;
    program_.nodes_.resize(scene.textures.size());
  }

  absl::StatusOr<TextureProgram> Build() {
    for (size_t i = 0; i < scene_.textures.size(); ++i) {
      if (absl::Status status = Add(static_cast<int32_t>(i)); !status.ok()) return status;
    }
    return std::move(program_);
  }

 private:
  enum class State : uint8_t { kNew, kOpen, kDone };

  absl::Status Error(int32_t texture, absl::StatusCode code, const std::string& what) const {
    const TextureDescription& description = scene_.textures[static_cast<size_t>(texture)];
    return absl::Status(code, absl::StrCat(FormatLocation(scene_, description.location),
                                           ": texture \"", description.name, "\": ", what));
  }

  // Recursion ends after at most kEvaluationsMax levels: each level adds one to the cost above.
  absl::Status Add(int32_t texture, uint64_t level = 0) {
    State& state = states_[static_cast<size_t>(texture)];
    if (state == State::kDone) return absl::OkStatus();
    if (state == State::kOpen) {
      return Error(texture, absl::StatusCode::kInvalidArgument, "refers to itself");
    }
    if (level > kEvaluationsMax) return TooDeep(texture);
    state = State::kOpen;
    const TextureDescription& description = scene_.textures[static_cast<size_t>(texture)];
    Node node;
    node.is_color = description.is_color;
    node.role = description.role;
    absl::Status status = std::visit([&](const auto& t) { return Fill(texture, t, level, &node); },
                                     description.texture);
    if (!status.ok()) return status;
    if (costs_[static_cast<size_t>(texture)] > kEvaluationsMax) return TooDeep(texture);
    program_.nodes_[static_cast<size_t>(texture)] = node;
    states_[static_cast<size_t>(texture)] = State::kDone;
    return absl::OkStatus();
  }

  absl::Status TooDeep(int32_t texture) const {
    return Error(texture, absl::StatusCode::kInvalidArgument,
                 absl::StrCat("nests textures so deep that one look-up evaluates more than ",
                              kEvaluationsMax, "; bake it into an image"));
  }

  template <typename Input>
  absl::Status AddInput(int32_t owner, const Input& input, uint64_t level) {
    if (input.texture == kNone) return absl::OkStatus();
    if (absl::Status status = Add(input.texture, level + 1); !status.ok()) return status;
    costs_[static_cast<size_t>(owner)] += costs_[static_cast<size_t>(input.texture)];
    return absl::OkStatus();
  }
  absl::Status AddPair(int32_t owner, const ColorInput& color, const FloatInput& value, size_t slot,
                       uint64_t level, Node* node) {
    absl::Status status =
        node->is_color ? AddInput(owner, color, level) : AddInput(owner, value, level);
    if (!status.ok()) return status;
    if (node->is_color) {
      node->color[slot] = program_.Operand(color, node->role);
    } else {
      node->value[slot] = program_.Operand(value);
    }
    return absl::OkStatus();
  }
  static bool Varies(const Node& node, size_t slot) {
    return node.is_color ? node.color[slot].texture != kNone : node.value[slot].texture != kNone;
  }
  // Replaces a node of constants by its value: the weighted sum of its colors or numbers.
  void Fold(Node* node, std::array<float, 2> weights) const {
    node->kind = Kind::kConstant;
    ColorOperand& a = node->color[0];
    const ColorOperand& b = node->color[1];
    if (node->is_color && program_.spectral_) {
      a.spectrum = SpectralColor::Tabulate([&](double nm) {
        const auto at = static_cast<float>(nm);
        return weights[0] * a.spectrum.At(at) + weights[1] * b.spectrum.At(at);
      });
    }
    a.value = a.value * weights[0] + b.value * weights[1];
    node->value[0].value = node->value[0].value * weights[0] + node->value[1].value * weights[1];
  }

  // As pbrt-v4 does, so that colors end at 1 before they become spectra.
  void FoldIntoImage(Node* node) const {
    const float amount = node->amount.value;
    const Node& image = program_.nodes_[static_cast<size_t>(node->color[0].texture)];
    if (image.kind != Kind::kImage) return;
    *node = image;
    node->factor *= amount;
  }

  void SetMapping(const UvMapping& mapping, Node* node) {
    Mapping m;
    m.scale_u = mapping.scale_u;
    m.scale_v = mapping.scale_v;
    m.offset_u = mapping.offset_u;
    m.offset_v = mapping.offset_v;
    m.turn_u = mapping.turn_u;
    m.turn_v = mapping.turn_v;
    m.planar_u = ToDouble(mapping.planar_u);
    m.planar_v = ToDouble(mapping.planar_v);
    for (size_t row = 0; row < 3; ++row) {
      const auto& from = mapping.texture_from_world.m[row];
      m.rows[row] = {from[0], from[1], from[2]};
      m.origin[row] = from[3];
    }
    node->mapping = mapping.kind;
    node->mapping_index = static_cast<int32_t>(program_.mappings_.size());
    program_.mappings_.push_back(m);
  }

  absl::Status Fill(int32_t, const ConstantTexture& t, uint64_t, Node* node) {
    node->kind = Kind::kConstant;
    node->color[0] = program_.Operand(ColorInput{t.color}, node->role);
    node->value[0] = {kNone, t.value};
    return absl::OkStatus();
  }
  absl::Status Fill(int32_t texture, const ImageTexture& t, uint64_t, Node* node) {
    const absl::StatusOr<std::string> path = files_.LocalPath(t.file);
    if (!path.ok()) {
      return Error(texture, path.status().code(), std::string(path.status().message()));
    }
    const absl::StatusOr<TextureImage> image = cache_.Open(*path, EncodingOf(t));
    if (!image.ok()) {
      const absl::Status status = NamedAsInScene(image.status(), *path, t.file);
      return Error(texture, status.code(), std::string(status.message()));
    }
    if (image->non_finite_texels > 0) {
      LogWarning(absl::StrCat(Error(texture, absl::StatusCode::kInvalidArgument, t.file).message(),
                              ": ", image->non_finite_texels,
                              " texels are not numbers; they count as 0"));
    }
    SetMapping(t.mapping, node);
    node->kind = Kind::kImage;
    node->wrap = t.wrap;
    node->wrap_v = t.wrap_v.value_or(t.wrap);
    node->channel = static_cast<int8_t>(t.channel.value_or(kNone));
    node->is_threshold = t.threshold.has_value();
    node->threshold = t.threshold.value_or(0);
    node->tint = t.tint;
    node->nearest = t.filter == ImageTexture::Filter::kPoint;
    node->invert = t.invert;
    node->scale = t.scale;
    node->image = *image;
    if (node->is_color && !is_normal_map_[static_cast<size_t>(texture)])
      SetPrimaries(texture, t, node);
    return absl::OkStatus();
  }
  void SetPrimaries(int32_t texture, const ImageTexture& t, Node* node) {
    const std::string place(Error(texture, absl::StatusCode::kInvalidArgument, t.file).message());
    const auto srgb_from_file = SrgbFromFile(node->image.chromaticities, node->role, place);
    if (!srgb_from_file) return;
    node->primaries_index = static_cast<int32_t>(program_.primaries_.size());
    program_.primaries_.push_back(*srgb_from_file);
    if (cache_.opens_by_header()) return;
    const uint64_t outside = CountOutside(node->image, *srgb_from_file);
    if (outside == 0) return;
    LogWarning(absl::StrCat(place, ": ", outside,
                            " texels are colors outside sRGB, which are clipped to its gamut"));
  }
  uint64_t CountOutside(const TextureImage& image, const Matrix4& srgb_from_file) const {
    uint64_t outside = 0;
    const auto width = static_cast<size_t>(image.width);
    std::vector<TexelIndex> where(width);
    std::vector<Texel> texels(width);
    for (int y = 0; y < image.height; ++y) {
      for (size_t x = 0; x < width; ++x) where[x] = {static_cast<int>(x), y};
      cache_.ReadTexels(image.index, where, texels);
      for (const Texel& texel : texels) {
        Rgb color{texel[0], texel[1], texel[2]};
        outside += !MoveToSrgb(srgb_from_file, &color);
      }
    }
    return outside;
  }
  absl::Status Fill(int32_t texture, const CheckerboardTexture& t, uint64_t level, Node* node) {
    for (size_t i = 0; i < 2; ++i) {
      absl::Status status = AddPair(texture, t.color[i], t.value[i], i, level, node);
      if (!status.ok()) return status;
    }
    SetMapping(t.mapping, node);
    node->kind = t.dimensions == 3 ? Kind::kCheckerboard3 : Kind::kCheckerboard2;
    return absl::OkStatus();
  }
  absl::Status Fill(int32_t texture, const ScaleTexture& t, uint64_t level, Node* node) {
    absl::Status status = AddPair(texture, t.color, t.value, 0, level, node);
    if (status.ok()) status = AddInput(texture, t.scale, level);
    if (!status.ok()) return status;
    node->kind = Kind::kScale;
    node->amount = program_.Operand(t.scale);
    if (node->amount.texture != kNone) return absl::OkStatus();
    if (!Varies(*node, 0)) {
      Fold(node, {node->amount.value, 0});
    } else if (node->is_color) {
      FoldIntoImage(node);
    }
    return absl::OkStatus();
  }
  absl::Status Fill(int32_t texture, const MixTexture& t, uint64_t level, Node* node) {
    for (size_t i = 0; i < 2; ++i) {
      absl::Status status = AddPair(texture, t.color[i], t.value[i], i, level, node);
      if (!status.ok()) return status;
    }
    if (absl::Status status = AddInput(texture, t.amount, level); !status.ok()) return status;
    node->kind = Kind::kMix;
    node->amount = program_.Operand(t.amount);
    if (!Varies(*node, 0) && !Varies(*node, 1) && node->amount.texture == kNone) {
      Fold(node, {1 - node->amount.value, node->amount.value});
    }
    return absl::OkStatus();
  }

  absl::Status Fill(int32_t texture, const VertexColorTexture& t, uint64_t level, Node* node) {
    node->kind = Kind::kVertexColor;
    return AddPair(texture, t.color, t.value, 0, level, node);
  }

  // Octaves cost about as much as other textures.
  Pattern& AddPattern(int32_t texture, Kind kind, int32_t octaves, float roughness, Node* node) {
    costs_[static_cast<size_t>(texture)] += static_cast<uint64_t>(octaves);
    node->kind = kind;
    node->pattern_index = static_cast<int32_t>(program_.patterns_.size());
    Pattern& pattern = program_.patterns_.emplace_back();
    pattern.octaves = octaves;
    pattern.roughness = static_cast<double>(roughness);
    return pattern;
  }
  absl::Status Fill(int32_t texture, const NoiseTexture& t, uint64_t, Node* node) {
    AddPattern(texture, Kind::kNoise, t.octaves, t.roughness, node).noise = t.kind;
    SetMapping({.texture_from_world = t.texture_from_world}, node);
    return absl::OkStatus();
  }
  absl::Status Fill(int32_t texture, const MarbleTexture& t, uint64_t, Node* node) {
    Pattern& pattern = AddPattern(texture, Kind::kMarble, t.octaves, t.roughness, node);
    pattern.scale = static_cast<double>(t.scale);
    pattern.variation = static_cast<double>(t.variation);
    SetMapping({.texture_from_world = t.texture_from_world}, node);
    return absl::OkStatus();
  }
  absl::Status Fill(int32_t texture, const DotsTexture& t, uint64_t level, Node* node) {
    for (size_t i = 0; i < 2; ++i) {
      absl::Status status = AddPair(texture, t.color[i], t.value[i], i, level, node);
      if (!status.ok()) return status;
    }
    SetMapping(t.mapping, node);
    node->kind = Kind::kDots;
    return absl::OkStatus();
  }
  absl::Status Fill(int32_t texture, const DirectionMixTexture& t, uint64_t level, Node* node) {
    for (size_t i = 0; i < 2; ++i) {
      absl::Status status = AddPair(texture, t.color[i], t.value[i], i, level, node);
      if (!status.ok()) return status;
    }
    AddPattern(texture, Kind::kDirectionMix, 0, 0, node).direction = t.direction;
    return absl::OkStatus();
  }
  absl::Status Fill(int32_t texture, const BilerpTexture& t, uint64_t, Node* node) {
    Pattern& pattern = AddPattern(texture, Kind::kBilerp, 0, 0, node);
    for (size_t i = 0; i < 4; ++i) {
      pattern.corner_color[i] = program_.Operand(ColorInput{t.color[i]}, node->role);
      pattern.corner_value[i] = t.value[i];
    }
    SetMapping(t.mapping, node);
    return absl::OkStatus();
  }

  absl::Status Fill(int32_t texture, const NodeTexture& t, uint64_t, Node* node) {
    costs_[static_cast<size_t>(texture)] += static_cast<uint64_t>(NodeOctaves(t));
    SetMapping({.texture_from_world = t.texture_from_place}, node);
    node->kind = Kind::kNode;
    node->pattern_index = static_cast<int32_t>(program_.node_textures_.size());
    program_.node_textures_.push_back(t);
    return absl::OkStatus();
  }
  absl::Status Fill(int32_t texture, const RampTexture& t, uint64_t level, Node* node) {
    if (absl::Status status = AddInput(texture, t.input, level); !status.ok()) return status;
    node->amount = program_.Operand(t.input);
    if (node->amount.texture == kNone) {
      ConstantTexture constant;
      constant.color.rgb = RampAt(t, node->amount.value, true);
      constant.value = RampAt(t, node->amount.value, false).r;
      return Fill(texture, constant, level, node);
    }
    node->kind = Kind::kRamp;
    node->pattern_index = static_cast<int32_t>(program_.ramps_.size());
    program_.ramps_.push_back(t);
    return absl::OkStatus();
  }

  const SceneDescription& scene_;
  FileSource& files_;
  TextureCache& cache_;
  TextureProgram program_;
  std::vector<State> states_;
  std::vector<uint64_t> costs_;
  std::vector<bool> is_normal_map_;  // Its texels are directions, not colors.
};

absl::StatusOr<TextureProgram> TextureProgram::Build(const SceneDescription& scene,
                                                     FileSource& files, TextureCache& cache,
                                                     bool spectral) {
  return Builder(scene, files, cache, spectral).Build();
}

}  // namespace sheaf::render
