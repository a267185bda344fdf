// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// ImageTextures: textures of a glTF file as those of SceneDescription (glTF 2.0 specification, sec.
// 3.8). Images within the file become files of their own, which are uploaded like others.
#pragma once

#include "common/scene/gltf/tinygltf_door.h"

#include <map>
#include <optional>
#include <set>
#include <string>

#include "common/scene/file_source.h"
#include "common/scene/gltf/accessors.h"
#include "common/scene/pbrt/syntax/diagnostics.h"
#include "common/scene/scene_description.h"

namespace sheaf::gltf {

// A reference to a texture by a material.
struct TextureRef {
  int index = -1;  // -1: none.
  int uv_set = 0;
  UvMapping mapping;  // KHR_texture_transform, for uv whose v points upwards.

  bool IsSet() const { return index >= 0; }
};
TextureRef RefOf(int index, int uv_set, const tinygltf::ExtensionMap& extensions);
// The texture of an extension's member, such as "clearcoatTexture".
TextureRef RefOf(const tinygltf::Value* extension, const std::string& key);

class ImageTextures {
 public:
  // All arguments must outlive this.
  ImageTextures(const tinygltf::Model* model, const std::string& main_file, FileSource* files,
                Accessors* accessors, Diagnostics* diagnostics, SceneDescription* scene)
      : model_(model),
        main_file_(main_file),
        files_(files),
        accessors_(accessors),
        diagnostics_(diagnostics),
        scene_(scene) {}

  // Index in SceneDescription::textures of an sRGB image times tint, or of a linear one. kNone
  // after an error, which is reported.
  int32_t Color(const TextureRef& ref, Rgb tint, const std::string& what);
  int32_t NormalMap(const TextureRef& ref, const std::string& what);
  // One channel (0: red ... 3: alpha) times scale; with a threshold: 1 from there on, else 0.
  int32_t Channel(const TextureRef& ref, int channel, float scale, std::optional<float> threshold,
                  const std::string& what);
  // Sets the light's image and its place on the surface. False after an error.
  bool SetEmission(const TextureRef& ref, const std::string& what, AreaLightDescription* light);

 private:
  std::optional<ImageTexture> Image(const TextureRef& ref, const std::string& what);
  // Canonical name of the image's file. Empty after an error.
  std::string FileOf(const TextureRef& ref, const std::string& what);
  std::string FileOfImage(int image, const std::string& what);
  std::string Derive(int image, const unsigned char* bytes, size_t size, const std::string& what);
  int32_t Add(const std::string& what, bool is_color, ColorRole role, ImageTexture image);
  std::string Fail(const std::string& what, const std::string& problem);
  // The refusal of KTX2, once for the file. which: what is in it.
  std::string FailKtx2(const std::string& what, const std::string& which);

  const tinygltf::Model* model_;
  const std::string main_file_;
  FileSource* files_;
  Accessors* accessors_;  // For its budget of memory.
  Diagnostics* diagnostics_;
  SceneDescription* scene_;
  std::map<int, std::string> files_of_images_;
  bool has_ktx2_ = false;  // It was refused.
};

}  // namespace sheaf::gltf
