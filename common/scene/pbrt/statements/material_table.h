// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// MaterialTable: the materials of a scene, named and unnamed. Shapes and mixes may use a named
// material that the file makes later; the table reserves its index until then.
#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <vector>

#include "common/scene/pbrt/statements/texture_table.h"
#include "common/scene/pbrt/syntax/parameter_list.h"
#include "common/scene/scene_description.h"

namespace sheaf {

class MaterialTable {
 public:
  // Requires: all pointers outlive this.
  MaterialTable(SceneDescription* scene, TextureTable* textures, SceneFiles* files,
                Diagnostics* diagnostics, uint32_t mix_depth_max)
      : scene_(scene),
        textures_(textures),
        files_(files),
        diagnostics_(diagnostics),
        mix_depth_max_(mix_depth_max) {}

  // Material "type" ...: the index of a new unnamed material.
  int32_t Add(const std::string& type, ParameterList parameters);
  // MakeNamedMaterial "name" "string type" "type" ...
  void AddNamed(const std::string& name, ParameterList parameters);
  // The index of the material of that name.
  int32_t Refer(const std::string& name, SourceLocation location);
  // The material of shapes before any Material directive: diffuse, reflectance 0.5.
  int32_t Default();
  // Whether the material is "interface". Named materials count once they are made.
  bool IsInterface(int32_t material) const;

  // Interiors of subsurface materials, indexed by the material's `medium` until they are added to
  // the scene's media.
  const std::vector<MediumDescription>& subsurface() const { return subsurface_; }

  // Reports undefined names and mixes that contain themselves. Call once, at the end.
  void Finish();

 private:
  struct Slot {
    int32_t index = kNone;
    bool is_made = false;
  };
  using Variant = decltype(MaterialDescription::material);

  // Without name and location.
  MaterialDescription Make(const std::string& type, ParameterList& parameters);
  // Whether it is of a described material's type. Sets the material then.
  bool MakeDescribed(const std::string& type, ParameterList& parameters, Variant* material);
  DiffuseTransmissionMaterial MakeDiffuseTransmission(ParameterList& parameters);
  ConductorMaterial MakeConductor(ParameterList& parameters);
  DielectricMaterial MakeDielectric(ParameterList& parameters);
  ThinDielectricMaterial MakeThinDielectric(ParameterList& parameters);
  CoatedDiffuseMaterial MakeCoatedDiffuse(ParameterList& parameters);
  CoatedConductorMaterial MakeCoatedConductor(ParameterList& parameters);
  HairMaterial MakeHair(ParameterList& parameters);
  MeasuredMaterial MakeMeasured(ParameterList& parameters);
  SubsurfaceMaterial MakeSubsurface(ParameterList& parameters);
  PrincipledMaterial MakePrincipled(ParameterList& parameters);
  // The absorption inside of a principled material.
  void GetInterior(ParameterList& parameters, PrincipledMaterial* material);
  // A principled material with an alpha becomes a mix of an interface and itself, which are added.
  MaterialDescription WithAlpha(MaterialDescription description);
  MixMaterial MakeMix(ParameterList& parameters);
  // Fills in the parameters of a coat, independent of its base. eta_name: parameter of its index of
  // refraction.
  void GetCoat(ParameterList& parameters, const std::string& eta_name, ClearCoat* coat);
  // Parameters may share a prefix, such as "conductor.".
  void GetConductor(ParameterList& parameters, const std::string& prefix,
                    ConductorMaterial* conductor);
  RoughnessInput GetRoughness(ParameterList& parameters, const std::string& prefix = "");
  RoughnessInput GetConstantRoughness(ParameterList& parameters, const std::string& prefix);
  RefractiveIndex GetIndex(ParameterList& parameters, const std::string& name = "eta");
  float GetConstant(ParameterList& parameters, const std::string& name, float fallback);
  void GetBumps(ParameterList& parameters, MaterialDescription* description);
  Slot& SlotFor(const std::string& name, SourceLocation location);

  SceneDescription* scene_;
  TextureTable* textures_;
  SceneFiles* files_;
  Diagnostics* diagnostics_;
  const uint32_t mix_depth_max_;
  std::map<std::string, Slot> slots_;
  std::map<std::string, int32_t> unnamed_;  // By what is written: the first.
  std::vector<MediumDescription> subsurface_;
  int32_t default_ = kNone;
};

}  // namespace sheaf
