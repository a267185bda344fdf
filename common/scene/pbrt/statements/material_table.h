// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// MaterialTable: the materials of a scene, named and unnamed. Shapes and mixes may use a named
// material that the file makes further on; the table keeps its place until then.
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
  // Requires: all outlive this.
  MaterialTable(SceneDescription* scene, TextureTable* textures, FileSource* files,
                Diagnostics* diagnostics)
      : scene_(scene), textures_(textures), files_(files), diagnostics_(diagnostics) {}

  // Material "type" ...: the index of a new unnamed material.
  int32_t Add(const std::string& type, ParameterList parameters);
  // MakeNamedMaterial "name" "string type" "type" ...
  void AddNamed(const std::string& name, ParameterList parameters);
  // The index of the material of that name.
  int32_t Refer(const std::string& name, SourceLocation location);
  // Of shapes before any Material directive: diffuse, reflecting one half.
  int32_t Default();
  // Whether the material is "interface". Named materials count once they are made.
  bool IsInterface(int32_t material) const;

  // What is inside of subsurface materials, by their `medium` until these take a place in the
  // scene.
  const std::vector<MediumDescription>& matter() const { return matter_; }

  // Reports names that lead nowhere and mixes that contain themselves. Call once, at the end.
  void Finish();

 private:
  struct Slot {
    int32_t index = kNone;
    bool is_made = false;
  };
  using Variant = decltype(MaterialDescription::material);

  // Without name and location.
  MaterialDescription Make(const std::string& type, ParameterList& parameters);
  DiffuseMaterial MakeDiffuse(ParameterList& parameters);
  DiffuseTransmissionMaterial MakeDiffuseTransmission(ParameterList& parameters);
  ConductorMaterial MakeConductor(ParameterList& parameters);
  DielectricMaterial MakeDielectric(ParameterList& parameters);
  ThinDielectricMaterial MakeThinDielectric(ParameterList& parameters);
  CoatedDiffuseMaterial MakeCoatedDiffuse(ParameterList& parameters);
  CoatedConductorMaterial MakeCoatedConductor(ParameterList& parameters);
  HairMaterial MakeHair(ParameterList& parameters);
  MeasuredMaterial MakeMeasured(ParameterList& parameters);
  SubsurfaceMaterial MakeSubsurface(ParameterList& parameters);
  MixMaterial MakeMix(ParameterList& parameters);
  // Fills in what a coat has whatever is below it. eta_name: of its index of refraction.
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
  bool ReachesItself(int32_t material) const;

  SceneDescription* scene_;
  TextureTable* textures_;
  FileSource* files_;
  Diagnostics* diagnostics_;
  std::map<std::string, Slot> slots_;
  std::vector<MediumDescription> matter_;
  int32_t default_ = kNone;
};

}  // namespace sheaf
