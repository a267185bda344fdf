// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Materials: glTF's metallic-roughness materials with their extensions as principled materials,
// area lights and opacities (glTF 2.0 specification, sec. 3.9, and the KHR_materials_* extensions).
#pragma once

#include "common/scene/gltf/tinygltf_door.h"

#include <map>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "common/scene/gltf/image_textures.h"
#include "common/scene/gltf/meshes.h"
#include "common/scene/gltf/skipped_parts.h"
#include "common/scene/gltf/values.h"
#include "common/scene/pbrt/syntax/diagnostics.h"
#include "common/scene/scene_description.h"

namespace sheaf::gltf {

// Properties that a shape gets from its material. Indices as in ShapeDescription.
struct Surface {
  int32_t material = kNone, area_light = kNone;
  FloatInput alpha{.value = 1};
  bool has_alpha = false;
  UvSets uv_sets = {};  // Which TEXCOORDs its textures use.
  // In place of area_light: what an unlit material emits times the colors of the vertices.
  std::optional<AreaLightDescription> light_of_colors = {};
};

class Materials {
 public:
  // All arguments must outlive this.
  Materials(const tinygltf::Model* model, ImageTextures* textures, SkippedParts* skipped,
            Diagnostics* diagnostics, SceneDescription* scene)
      : model_(model),
        textures_(textures),
        skipped_(skipped),
        diagnostics_(diagnostics),
        scene_(scene) {}

  // index: of the file's materials, or -1 for the default one. has_colors: whether the vertices
  // have colors, which multiply the base color. Made once for each; mistakes are reported.
  const Surface& Get(int index, bool has_colors);

  // Makes glass that disperses a dielectric of the spectrum of its index. Call once, at the end:
  // what is inside of the glass follows from the principled material.
  void MakeDispersive();

 private:
  Surface Make(const tinygltf::Material& source, const std::string& what);
  void SetBase(const tinygltf::Material& source, const std::string& what,
               PrincipledMaterial* material);
  void SetOpacity(const tinygltf::Material& source, const std::string& what, Surface* surface);
  void SetEmission(const tinygltf::Material& source, const std::string& what, Surface* surface);
  void SetUnlit(const tinygltf::Material& source, const std::string& what, Surface* surface,
                PrincipledMaterial* material);
  void AddLight(Rgb radiance, TextureRef texture, const std::string& what,
                const tinygltf::Material& source, Surface* surface);
  // material_layers.cc: what the extensions describe.
  void SetLayers(const tinygltf::Material& source, const std::string& what,
                 PrincipledMaterial* material);
  void SetTransmission(const tinygltf::Material& source, const std::string& what,
                       PrincipledMaterial* material);
  void SetSpecular(const tinygltf::Material& source, const std::string& what,
                   PrincipledMaterial* material);
  void SetSpecularGlossiness(const tinygltf::Material& source, const std::string& what,
                             PrincipledMaterial* material);
  // Whether the material, which will be the next one of the scene, is glass that disperses.
  void NoteDispersion(const tinygltf::Material& source, const std::string& what,
                      PrincipledMaterial* material);
  // Adds the base color to what glass with a volume absorbs.
  void AbsorbBaseColor(const tinygltf::Material& source, const std::string& what,
                       PrincipledMaterial* material);
  void SetIridescence(const tinygltf::Material& source, const std::string& what,
                      PrincipledMaterial* material);
  void SetCoat(const tinygltf::Material& source, const std::string& what,
               PrincipledMaterial* material);
  void SetAnisotropy(const tinygltf::Material& source, const std::string& what,
                     PrincipledMaterial* material);
  // After the normal map: the coat's normals, if they are others.
  void SetCoatNormals(const tinygltf::Material& source, const std::string& what,
                      MaterialDescription* description);

  // The input times the colors, or the alpha, of the vertices, if they have any.
  void TimesVertexColor(const std::string& what, ColorInput* input);
  void TimesVertexAlpha(const std::string& what, FloatInput* input);
  template <typename Texture>
  int32_t AddTexture(const std::string& what, Texture texture, bool is_color);
  // The set of uv that textures use which cannot be of the second one: -1 if there is none.
  static int FirstSetOf(const tinygltf::Material& source);
  // Whether a texture's reference can be used, whose mapping becomes that of its set of uv.
  // Vertices with colors have no second set, and neither has what counts at sampled points of
  // lights.
  bool Uses(const std::string& what, bool may_be_second, TextureRef* ref);
  FloatInput Number(float factor, TextureRef ref, int channel, const std::string& what);
  ColorInput ColorTimes(Rgb factor, TextureRef ref, const std::string& what);
  void Ignore(const std::string& what, const std::string& problem) { skipped_->Add(what, problem); }

  const tinygltf::Model* model_;
  ImageTextures* textures_;
  SkippedParts* skipped_;
  Diagnostics* diagnostics_;
  SceneDescription* scene_;
  std::map<std::pair<int, bool>, Surface> known_;
  // Whether the vertices of the material that is being made have colors.
  bool has_colors_ = false;
  // Materials of the scene, and their dispersion.
  std::vector<std::pair<int32_t, double>> dispersive_;
  // The sets of the material that is being made; -1 until a texture is used.
  int uv_set_ = -1, second_uv_set_ = -1;
};

template <typename Texture>
int32_t Materials::AddTexture(const std::string& what, Texture texture, bool is_color) {
  TextureDescription description;
  description.name = what;
  description.is_color = is_color;
  description.location = kFile;
  description.texture = std::move(texture);
  scene_->textures.push_back(std::move(description));
  return static_cast<int32_t>(scene_->textures.size()) - 1;
}

}  // namespace sheaf::gltf
