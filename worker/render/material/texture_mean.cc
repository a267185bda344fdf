// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "worker/render/material/texture_mean.h"

#include <type_traits>
#include <variant>

#include "absl/status/statusor.h"
#include "common/scene/pbrt/statements/subsurface_reflectance.h"
#include "worker/render/material/material.h"
#include "worker/render/material/texture_program.h"

namespace sheaf::render {
namespace {

constexpr uint64_t kCacheBytesMax = uint64_t{64} << 20;
// Points along each side of the square; third coordinates follow their own sequence.
constexpr int kSteps = 64;
constexpr float kGoldenFraction = 0.618034f;

// Checkerboards repeat after at most two units; images that do not repeat occur once. Noise repeats
// after many cells, of which the square has thousands.
constexpr float kSideOfNoise = 61.8034f;
float SideOfMean(const SceneDescription& scene) {
  for (const TextureDescription& texture : scene.textures) {
    if (std::holds_alternative<NoiseTexture>(texture.texture) ||
        std::holds_alternative<MarbleTexture>(texture.texture) ||
        std::holds_alternative<DotsTexture>(texture.texture) ||
        std::holds_alternative<NodeTexture>(texture.texture)) {
      return kSideOfNoise;
    }
  }
  for (const TextureDescription& texture : scene.textures) {
    const auto* image = std::get_if<ImageTexture>(&texture.texture);
    if (image != nullptr && image->wrap != TextureWrap::kRepeat) return 1;
  }
  return 2;
}

class Replacer {
 public:
  Replacer(const TextureProgram& program, float side) : program_(program), side_(side) {}

  void Replace(FloatInput* input) const {
    if (input->texture == kNone) return;
    const FloatOperand operand = program_.Operand(*input);
    *input = {.value =
                  Mean<float>([&](const TexturePoint& p) { return program_.Float(operand, p); })};
  }
  void Replace(ColorInput* input) const {
    if (input->texture == kNone) return;
    const ColorOperand operand = program_.Operand(*input, ColorRole::kReflectance);
    const Rgb mean =
        Mean<Rgb>([&](const TexturePoint& p) { return program_.Value<Rgb>(operand, p, {}); });
    *input = {};
    input->value.rgb = mean;
  }
  void Replace(RoughnessInput* input) const {
    Replace(&input->u);
    Replace(&input->v);
  }
  // Replaces those of the inputs that a material has.
  template <typename Material>
  void Replace(Material* m) const {
    if constexpr (requires { m->roughness; }) Replace(&m->roughness);
    if constexpr (requires { m->reflectance; }) Replace(&m->reflectance);
    if constexpr (requires { m->transmittance; }) Replace(&m->transmittance);
    if constexpr (requires { m->eta; }) Replace(&m->eta);
    if constexpr (requires { m->k; }) Replace(&m->k);
    if constexpr (requires { m->albedo; }) Replace(&m->albedo);
    if constexpr (requires { m->conductor; }) Replace(&m->conductor);
    if constexpr (requires { m->amount; }) Replace(&m->amount);
    if constexpr (std::is_same_v<Material, PrincipledMaterial>) {
      for (ColorInput* input : {&m->base_color, &m->specular_tint, &m->sheen_color}) Replace(input);
      PrincipledMaterial::ForEachNumber(*m, [&](const char*, auto& input, float, float) {
        if constexpr (std::is_same_v<std::decay_t<decltype(input)>, FloatInput>) Replace(&input);
      });
    }
  }

 private:
  template <typename Value, typename Evaluate>
  Value Mean(const Evaluate& evaluate) const {
    Value sum{};
    for (int j = 0; j < kSteps; ++j) {
      for (int i = 0; i < kSteps; ++i) {
        const float u = side_ * (static_cast<float>(i) + 0.5f) / kSteps;
        const float v = side_ * (static_cast<float>(j) + 0.5f) / kSteps;
        const float turns = static_cast<float>(j * kSteps + i) * kGoldenFraction;
        const float w = side_ * (turns - static_cast<float>(static_cast<int>(turns)));
        sum += evaluate({{u, v}, ToDouble({u, v, w}), {}});
      }
    }
    return sum * (1.0f / (kSteps * kSteps));
  }

  const TextureProgram& program_;
  const float side_;
};

}  // namespace

absl::Status ReplaceTexturesByMeans(FileSource& files, SceneDescription* scene) {
  TextureCache cache(kCacheBytesMax);
  const absl::StatusOr<TextureProgram> program = TextureProgram::Build(*scene, files, cache, false);
  if (!program.ok()) return program.status();
  const Replacer replacer(*program, SideOfMean(*scene));
  for (MaterialDescription& description : scene->materials) {
    std::visit([&](auto& material) { replacer.Replace(&material); }, description.material);
  }
  for (ShapeDescription& shape : scene->shapes) replacer.Replace(&shape.alpha);
  for (MediumDescription& medium : scene->media) {
    if (!medium.reflectance || medium.reflectance->texture == kNone) continue;
    ColorInput color;
    color.texture = medium.reflectance->texture;
    replacer.Replace(&color);
    SubsurfaceReflectance reflectance = *medium.reflectance;
    reflectance.color = color.value;
    reflectance.texture = kNone;
    SetReflectance(reflectance, &medium);
  }
  return absl::OkStatus();
}

}  // namespace sheaf::render
