// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// SceneBuilder: the semantics of pbrt-v4 directives. One method for each, called in the order of
// the file; together they build the SceneDescription. Mistakes go to the diagnostics, after which
// the builder continues, so that one run finds them all.
#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <string_view>
#include <unordered_map>
#include <vector>

#include "common/scene/pbrt/scene_reader.h"
#include "common/scene/pbrt/statements/material_table.h"
#include "common/scene/pbrt/statements/option_parameters.h"
#include "common/scene/pbrt/statements/scene_files.h"
#include "common/scene/pbrt/statements/shape_table.h"
#include "common/scene/pbrt/statements/texture_table.h"
#include "common/scene/pbrt/syntax/diagnostics.h"
#include "common/scene/pbrt/syntax/graphics_state.h"
#include "common/scene/pbrt/syntax/parameter_list.h"
#include "common/scene/scene_description.h"

namespace sheaf {

class SceneBuilder {
 public:
  // Requires: all pointers outlive this.
  SceneBuilder(SceneDescription* scene, SceneFiles* files, Diagnostics* diagnostics,
               const SceneReaderLimits& limits);

  // The index of the file in SceneDescription::files.
  int32_t AddFile(const std::string& canonical_name);

  // Transformations. numbers: as many as the directive has.
  void Identity(const double* numbers, SourceLocation location);
  void Translate(const double* numbers, SourceLocation location);
  void Scale(const double* numbers, SourceLocation location);
  void Rotate(const double* numbers, SourceLocation location);
  void LookAt(const double* numbers, SourceLocation location);
  void Transform(const double* numbers, SourceLocation location);
  void ConcatTransform(const double* numbers, SourceLocation location);
  void TransformTimes(const double* numbers, SourceLocation location);
  bool ActiveTransform(std::string_view which);  // False if `which` is none of the three.
  void CoordinateSystem(const std::string& name, SourceLocation location);
  void CoordSysTransform(const std::string& name, SourceLocation location);

  // Options, before WorldBegin.
  void Option(const std::string& name, const std::string& value, SourceLocation location);
  void ColorSpace(const std::string& name, SourceLocation location);
  void Accelerator(const std::string& name, std::vector<Parameter> own, SourceLocation location);
  void Camera(const std::string& type, std::vector<Parameter> own, SourceLocation location);
  void Film(const std::string& type, std::vector<Parameter> own, SourceLocation location);
  void Integrator(const std::string& type, std::vector<Parameter> own, SourceLocation location);
  void PixelFilter(const std::string& type, std::vector<Parameter> own, SourceLocation location);
  void Sampler(const std::string& type, std::vector<Parameter> own, SourceLocation location);

  // Blocks.
  void WorldBegin(SourceLocation location);
  void AttributeBegin(SourceLocation location);
  void AttributeEnd(SourceLocation location);
  void TransformBegin(SourceLocation location);
  void TransformEnd(SourceLocation location);
  void ObjectBegin(const std::string& name, SourceLocation location);
  void ObjectEnd(SourceLocation location);
  bool ImportBegin(SourceLocation location);  // False (reported) if Import is not allowed.
  void ImportEnd(SourceLocation location);
  void EndOfScene();

  // The world.
  void Attribute(const std::string& target, std::vector<Parameter> own, SourceLocation location);
  void ReverseOrientation(SourceLocation location);
  void Material(const std::string& type, std::vector<Parameter> own, SourceLocation location);
  void MakeNamedMaterial(const std::string& name, std::vector<Parameter> own,
                         SourceLocation location);
  void NamedMaterial(const std::string& name, SourceLocation location);
  void Texture(const std::string& name, const std::string& type, const std::string& kind,
               std::vector<Parameter> own, SourceLocation location);
  void Shape(const std::string& type, std::vector<Parameter> own, SourceLocation location);
  void ObjectInstance(const std::string& name, std::vector<Parameter> own, SourceLocation location);
  void LightSource(const std::string& type, std::vector<Parameter> own, SourceLocation location);
  void AreaLightSource(const std::string& type, std::vector<Parameter> own,
                       SourceLocation location);
  void MediumInterface(const std::string& inside, const std::string& outside,
                       SourceLocation location);
  void MakeNamedMedium(const std::string& name, std::vector<Parameter> own,
                       SourceLocation location);

 private:
  struct Block {
    enum class Kind { kAttribute, kTransform, kObject, kImport } kind;
    SourceLocation location;
    GraphicsState saved;
    std::map<std::string, std::pair<Matrix4, Matrix4>> saved_coordinate_systems;  // kImport only.
  };

  bool RequireWorld(std::string_view directive, SourceLocation location);
  bool RequireOptions(std::string_view directive, SourceLocation location);
  void Push(Block::Kind kind, SourceLocation location);
  bool Pop(Block::Kind kind, std::string_view directive, SourceLocation location);
  void ReportOpenBlocks(size_t first);
  void Concatenate(const Matrix4& matrix);
  bool RequireFinite(const double* numbers, size_t count, SourceLocation location);
  TransformOverTime CurrentTransform() const;
  ParameterList Parameters(const std::string& owner, const std::string& attribute_target,
                           std::vector<Parameter> own, SourceLocation location);
  void FinishMedia();
  // Adds the interiors of subsurface materials to the media, and sets them inside the shapes of
  // those materials.
  void FinishSubsurface();
  void FinishObjects();
  // The index of "string name" in SceneDescription::matte_names; kNone without one, or where it
  // cannot be a name (reported).
  int32_t MatteName(ParameterList& parameters);
  // Reports what an emissive shape cannot do.
  void CheckEmitter(const ShapeDescription& shape, ParameterList& parameters);
  bool ObjectSlot(const std::string& name, SourceLocation location, int32_t* object);
  // The index of the medium of that name, defined or not; kNone for an empty name.
  int32_t MediumSlot(const std::string& name, SourceLocation location);

  SceneDescription* scene_;
  std::unordered_map<std::string, int32_t> file_indices_;  // In SceneDescription::files.
  SceneFiles* files_;
  Diagnostics* diagnostics_;
  uint64_t memory_bytes_max_;
  TextureTable textures_;
  MaterialTable materials_;
  ShapeTable shapes_;
  GraphicsState state_;
  std::vector<Block> blocks_;
  PendingFrame frame_;
  bool is_world_ = false;
  bool missed_world_ = false;  // The missing WorldBegin has been reported.
  bool has_noted_power_ = false;
  float start_time_ = 0, end_time_ = 1;
  int32_t open_object_ = kNone;
  std::map<std::string, std::pair<Matrix4, Matrix4>> coordinate_systems_;
  std::map<std::string, int32_t> objects_;
  std::map<std::string, int32_t> matte_names_;  // Indices in SceneDescription::matte_names.
  std::vector<bool> object_is_defined_;         // Parallel to SceneDescription::objects.
  std::map<std::string, int32_t> media_;        // Indices in SceneDescription::media.
  struct MediumUse {
    bool is_made = false, is_used = false;
  };
  std::vector<MediumUse> medium_uses_;  // Parallel to SceneDescription::media.
};

}  // namespace sheaf
