// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Builds a MaterialTable from a SceneDescription.
#include <algorithm>
#include <cmath>
#include <string>
#include <utility>
#include <variant>

#include "absl/strings/str_cat.h"
#include "common/base/log.h"
#include "common/scene/spectrum/spectrum.h"
#include "worker/render/bsdf/lobes.h"
#include "worker/render/material/material_impl.h"

namespace sheaf::render {
namespace {

constexpr Ggx kAllAlphas{-1, -1};

class MaterialBuilder {
 public:
  MaterialBuilder(const SceneDescription& scene, FileSource& files, const TextureProgram& textures,
                  ScatteringTables& tables, const MaterialOptions& options)
      : scene_(scene), files_(files), textures_(textures), tables_(tables), options_(options) {}

  absl::StatusOr<CompiledMaterial> Make(int32_t material) {
    description_ = &scene_.materials[static_cast<size_t>(material)];
    CompiledMaterial m;
    absl::Status status =
        std::visit([&](const auto& d) { return Fill(d, &m); }, description_->material);
    if (!status.ok()) return status;
    if (status = SetBumps(&m); !status.ok()) return status;
    m.varies = m.color.texture != kNone || m.conductor_eta.texture != kNone ||
               m.conductor_k.texture != kNone || RoughnessVaries(m);
    if (m.is_mix || m.hair != nullptr || m.measured != nullptr || m.principled != nullptr) return m;
    m.constant =
        MakeBsdf(m, SurfaceInputs<Rgb>{m.color.value, m.conductor_eta.value, m.conductor_k.value,
                                       m.roughness_u.value, m.roughness_v.value});
    if (options_.spectral && !m.varies && !m.constant.specular) SetSpectralTint(&m);
    return m;
  }

 private:
  absl::Status Error(const std::string& what) const {
    const std::string name =
        description_->name.empty() ? "" : absl::StrCat(" \"", description_->name, "\"");
    return absl::InvalidArgumentError(absl::StrCat(FormatLocation(scene_, description_->location),
                                                   ": material", name, ": ", what));
  }
  static bool RoughnessVaries(const CompiledMaterial& m) {
    return m.roughness_u.texture != kNone || m.roughness_v.texture != kNone;
  }

  absl::Status SetBumps(CompiledMaterial* m) const {
    m->coat_normals = description_->coat_normals;
    if (m->coat_normals && m->coat_normals->map != kNone &&
        textures_.ImageChannels(m->coat_normals->map) < 3) {
      return Error("its coat's normal map has no red, green and blue; give an image in color");
    }
    m->normal_map = description_->normal_map;
    m->normal_scale = description_->normal_scale;
    if (m->normal_map != kNone) {
      const int channels = textures_.ImageChannels(m->normal_map);
      if (channels >= 3) return absl::OkStatus();
      return Error("its normal map has no red, green and blue; give an image in color");
    }
    m->displacement = textures_.Operand(description_->displacement);
    m->slope_scale = textures_.SlopeScaleOf(m->displacement);
    return absl::OkStatus();
  }
  absl::Status SetReflectance(const ColorInput& input, CompiledMaterial* m) {
    return SetFraction("reflectance", input, &m->color);
  }
  // Sets a fraction of light per channel that a surface reflects or transmits.
  absl::Status SetFraction(const char* name, const ColorInput& input, ColorOperand* fraction) {
    *fraction = textures_.Operand(input, ColorRole::kReflectance);
    if (fraction->texture != kNone) return absl::OkStatus();
    for (size_t c = 0; c < 3; ++c) {
      const float value = fraction->value[c];
      if (!std::isfinite(value)) return Error(absl::StrCat(name, " is not a finite number"));
      if (value < 0 || value > 1) {
        LogWarning(
            absl::StrCat(Error(absl::StrCat(name, " ", value, " is clamped to [0, 1]")).message()));
        break;
      }
    }
    return absl::OkStatus();
  }
  absl::Status SetRoughness(const RoughnessInput& input, CompiledMaterial* m) {
    m->remap_roughness = input.remap_roughness;
    m->roughness_u = textures_.Operand(input.u);
    m->roughness_v = textures_.Operand(input.v);
    for (const FloatOperand& roughness : {m->roughness_u, m->roughness_v}) {
      if (roughness.texture != kNone) continue;
      if (!std::isfinite(roughness.value) || roughness.value < 0) {
        return Error(absl::StrCat("roughness ", roughness.value, " must be 0 or more"));
      }
    }
    return absl::OkStatus();
  }
  absl::Status SetIndex(float eta, CompiledMaterial* m) {
    if (!std::isfinite(eta) || eta <= 0) {
      return Error(absl::StrCat("index of refraction ", eta, " must be greater than 0"));
    }
    m->eta = eta;
    return absl::OkStatus();
  }
  absl::Status SetIndex(const RefractiveIndex& eta, CompiledMaterial* m) {
    m->disperses = options_.spectral && eta.Disperses();
    if (m->disperses) {
      m->index = SpectralColor::Tabulate([&](double nm) { return IndexAt(eta.spectrum, nm); });
    }
    return SetIndex(eta.mean, m);
  }
  // A boundary between equal indices neither bends nor reflects, rough or not: an interface.
  static absl::Status MakeInvisible(CompiledMaterial* m) {
    *m = CompiledMaterial{};
    m->kind = BsdfKind::kInterface;
    return absl::OkStatus();
  }

  // The roughness that a table must cover; kAllAlphas where it varies.
  static Ggx TableAlpha(const CompiledMaterial& m) {
    if (RoughnessVaries(m)) return kAllAlphas;
    const Bsdf bsdf =
        MakeBsdf(m, SurfaceInputs<Rgb>{{}, {}, {}, m.roughness_u.value, m.roughness_v.value});
    return {bsdf.alpha_x, bsdf.alpha_y};
  }
  static bool IsSmooth(const Ggx& ggx) { return ggx.alpha_x >= 0 && ggx.IsSmooth(); }

  // Sets BsdfOf::color per wavelength for a constant rough conductor, coated or not.
  static void SetSpectralTint(CompiledMaterial* m) {
    if (m->kind == BsdfKind::kCoatedConductor) {
      m->constant_tint = SpectralColor::Tabulate([&](double nm) -> double {
        return m->conductor_coat->Tint(AverageReflectance(*m, nm, m->eta));
      });
    } else if (m->kind == BsdfKind::kConductor && m->constant.conductor_energy != nullptr) {
      const float loss = m->constant.conductor_energy->lobe.average_loss;
      m->constant_tint = SpectralColor::Tabulate(
          [&](double nm) -> double { return TintOfReturn(AverageReflectance(*m, nm, 1), loss); });
    }
  }
  // Reflectance of a constant conductor at a wavelength, against a medium of index `outside`.
  static float AverageReflectance(const CompiledMaterial& m, double nm, float outside) {
    const auto at = static_cast<float>(nm);
    float eta = m.conductor_eta.spectrum.At(at), k = m.conductor_k.spectrum.At(at);
    if (m.from_reflectance) {
      eta = 1;
      k = AbsorptionOf(m.color.spectrum.At(at));
    }
    return AverageConductorFresnel(AgainstCoat(eta, outside), AgainstCoat(k, outside));
  }

  // Finds or makes a table: one row, or all.
  template <typename Row, typename MakeRow, typename MakeAll>
  static const std::vector<Row>* FindTable(std::map<ScatteringTables::Key, std::vector<Row>>& known,
                                           ScatteringTables::Key key, MakeRow make_row,
                                           MakeAll make_all) {
    const auto [found, is_new] = known.try_emplace(key);
    if (is_new) {
      if (std::get<0>(key) < 0) {
        found->second = make_all();
      } else {
        found->second.push_back(make_row());
      }
    }
    return &found->second;
  }

  template <DescribedMaterial Material>
  absl::Status Fill(const Material& d, CompiledMaterial* m) {
    struct Inputs {
      void Reflectance(const char* name, const ColorInput& input, float) {
        status.Update(builder.SetFraction(name, input, &m->color));
      }
      void Roughness(const RoughnessInput& input) { status.Update(builder.SetRoughness(input, m)); }
      MaterialBuilder& builder;
      CompiledMaterial* m;
      absl::Status status;
    } inputs{*this, m, absl::OkStatus()};
    m->kind = LobeOf<Material>::kKind;
    Material::ForEachInput(d, inputs);
    return inputs.status;
  }

  absl::Status Fill(const DiffuseTransmissionMaterial& d, CompiledMaterial* m) {
    m->kind = BsdfKind::kDiffuseTransmission;
    m->scale = d.scale;
    if (!std::isfinite(d.scale) || d.scale < 0) {
      return Error(absl::StrCat("scale ", d.scale, " must be 0 or more"));
    }
    absl::Status status = SetFraction("reflectance", d.reflectance, &m->color);
    if (!status.ok()) return status;
    return SetFraction("transmittance", d.transmittance, &m->conductor_eta);
  }

  // Sets the color inputs of a conductor. outside: index of the medium in front of it, which
  // decides the RGB of a measured metal; the stored index stays relative to vacuum.
  absl::Status SetMetal(const ConductorMaterial& d, float outside, CompiledMaterial* m) {
    m->from_reflectance = d.has_reflectance;
    if (d.has_reflectance) return SetReflectance(d.reflectance, m);
    m->conductor_eta = textures_.Operand(d.eta, ColorRole::kUnbounded);
    m->conductor_k = textures_.Operand(d.k, ColorRole::kUnbounded);
    if (d.eta.texture != kNone || d.k.texture != kNone) return absl::OkStatus();
    const ConductorConstants constants = ConductorRgb(d.eta.value, d.k.value, outside);
    m->conductor_eta.value = constants.eta;
    m->conductor_k.value = constants.k;
    if (!IsFinite(constants.eta) || !IsFinite(constants.k)) {
      return Error("eta and k must be finite numbers");
    }
    return absl::OkStatus();
  }

  absl::Status Fill(const ConductorMaterial& d, CompiledMaterial* m) {
    m->kind = BsdfKind::kConductor;
    if (absl::Status status = SetRoughness(d.roughness, m); !status.ok()) return status;
    if (absl::Status status = SetMetal(d, 1, m); !status.ok()) return status;
    const Ggx ggx = TableAlpha(*m);
    if (IsSmooth(ggx) || options_.single_scattering) return absl::OkStatus();
    m->conductor_rows = FindTable(
        tables_.conductors, {ggx.alpha_x, ggx.alpha_y, 0, 0},
        [&] { return MakeConductorEnergyRow(ggx); }, [] { return MakeConductorEnergyTable(); });
    return absl::OkStatus();
  }

  absl::Status Fill(const DielectricMaterial& d, CompiledMaterial* m) {
    m->kind = BsdfKind::kDielectric;
    if (absl::Status status = SetRoughness(d.roughness, m); !status.ok()) return status;
    if (absl::Status status = SetIndex(d.eta, m); !status.ok()) return status;
    const float eta = d.eta.mean;
    if (d.eta.IsMatched()) {
      if (!description_->priority.has_value()) return MakeInvisible(m);
      return absl::OkStatus();  // The outside index may differ.
    }
    const Ggx ggx = TableAlpha(*m);
    if (IsSmooth(ggx) || options_.single_scattering) return absl::OkStatus();
    m->dielectric_rows = FindTable(
        tables_.dielectrics, {ggx.alpha_x, ggx.alpha_y, eta, 0},
        [&] { return MakeDielectricEnergyRow(ggx, eta); },
        [&] { return MakeDielectricEnergyTable(eta); });
    return absl::OkStatus();
  }

  absl::Status Fill(const SubsurfaceMaterial& d, CompiledMaterial* m) {
    absl::Status status = Fill(DielectricMaterial{d.roughness, d.eta}, m);
    const MediumDescription& inside = scene_.media[static_cast<size_t>(d.medium)];
    if (!inside.reflectance || inside.reflectance->texture == kNone) return status;
    ColorInput scattering_texture;
    scattering_texture.texture = inside.reflectance->texture;
    m->subsurface_reflectance = textures_.Operand(scattering_texture, ColorRole::kReflectance);
    const float eta = inside.reflectance->eta, g = inside.g;
    m->subsurface_albedo = &tables_.subsurface_albedos.try_emplace({eta, g}, eta, g).first->second;
    return status;
  }

  absl::Status Fill(const ThinDielectricMaterial& d, CompiledMaterial* m) {
    m->kind = BsdfKind::kThinDielectric;
    if (absl::Status status = SetIndex(d.eta, m); !status.ok()) return status;
    return d.eta.IsMatched() ? MakeInvisible(m) : absl::OkStatus();
  }

  absl::Status SetCoat(const ClearCoat& d, CompiledMaterial* m) {
    if (!std::isfinite(d.thickness) || d.thickness < 0) {
      return Error(absl::StrCat("thickness ", d.thickness, " must be 0 or more"));
    }
    if (d.albedo.texture != kNone || !d.albedo.value.rgb.IsBlack()) {
      return Error("a scattering coat (albedo above 0) is not supported; remove \"albedo\"");
    }
    return SetIndex(d.eta, m);
  }

  absl::Status Fill(const CoatedDiffuseMaterial& d, CompiledMaterial* m) {
    m->kind = BsdfKind::kCoatedDiffuse;
    if (absl::Status status = SetReflectance(d.reflectance, m); !status.ok()) return status;
    if (absl::Status status = SetRoughness(d.roughness, m); !status.ok()) return status;
    if (absl::Status status = SetCoat(d, m); !status.ok()) return status;
    const Ggx ggx = TableAlpha(*m);
    const bool keeps_energy = !options_.single_scattering;
    m->coat_rows = FindTable(
        tables_.coats, {ggx.alpha_x, ggx.alpha_y, d.eta, d.thickness},
        [&] { return MakeCoatRow(ggx, d.eta, d.thickness, keeps_energy); },
        [&] { return MakeCoatTable(d.eta, d.thickness, keeps_energy); });
    return absl::OkStatus();
  }

  absl::Status Fill(const CoatedConductorMaterial& d, CompiledMaterial* m) {
    CompiledMaterial base;
    if (absl::Status s = SetRoughness(d.conductor.roughness, &base); !s.ok()) return s;
    if (absl::Status s = SetRoughness(d.roughness, m); !s.ok()) return s;
    if (RoughnessVaries(base) || RoughnessVaries(*m)) {
      return Error("a textured roughness of a coated conductor is not supported; give a number");
    }
    const Ggx interface_alpha = TableAlpha(*m), base_alpha = TableAlpha(base);
    if (absl::Status s = SetCoat(d, m); !s.ok()) return s;
    if (absl::Status s = SetMetal(d.conductor, d.eta, m); !s.ok()) return s;
    m->kind = BsdfKind::kCoatedConductor;
    const auto [row, is_new] = tables_.conductor_coats.try_emplace(
        {interface_alpha.alpha_x, interface_alpha.alpha_y, base_alpha.alpha_x, base_alpha.alpha_y,
         d.eta, d.thickness});
    if (is_new) {
      row->second = MakeConductorCoatRow(interface_alpha, base_alpha, d.eta, d.thickness,
                                         !options_.single_scattering);
    }
    m->conductor_coat = &row->second;
    return absl::OkStatus();
  }

  absl::Status Fill(const HairMaterial& d, CompiledMaterial* m) {
    m->kind = BsdfKind::kHair;
    absl::StatusOr<CompiledHair> compiled = CompileHair(d, textures_);
    if (!compiled.ok()) return Error(std::string(compiled.status().message()));
    CompiledHair& hair = tables_.hairs.emplace_back(*std::move(compiled));
    m->hair = &hair;
    if (d.pigment != HairMaterial::Pigment::kReflectance) return absl::OkStatus();
    return SetFraction("reflectance", d.color, &hair.color);
  }

  absl::Status Fill(const MeasuredMaterial& d, CompiledMaterial* m) {
    m->kind = BsdfKind::kMeasured;
    auto known = tables_.measured.find(d.file);
    if (known == tables_.measured.end()) {
      const absl::StatusOr<std::string> path = files_.LocalPath(d.file);
      if (!path.ok()) return Error(std::string(path.status().message()));
      absl::StatusOr<MeasuredData> data = ReadMeasuredFile(d.file, *path);
      if (!data.ok()) return Error(std::string(data.status().message()));
      known =
          tables_.measured.try_emplace(d.file, MeasuredBrdf(*std::move(data), options_.spectral))
              .first;
    }
    m->measured = &known->second;
    return absl::OkStatus();
  }

  absl::Status Fill(const PrincipledMaterial& d, CompiledMaterial* m) {
    m->kind = BsdfKind::kPrincipled;
    const PrincipledOptions options{options_.spectral, !options_.single_scattering,
                                    description_->coat_normals.has_value()};
    const absl::StatusOr<const CompiledPrincipled*> principled =
        CompilePrincipled(d, textures_, options, &tables_.principled);
    if (!principled.ok()) return Error(std::string(principled.status().message()));
    m->principled = *principled;
    return absl::OkStatus();
  }

  absl::Status Fill(const MixMaterial& d, CompiledMaterial* m) {
    m->is_mix = true;
    m->amount = textures_.Operand(d.amount);
    for (size_t i = 0; i < 2; ++i) {
      m->mix[i] = d.material[i];
      if (d.material[i] < 0 || static_cast<size_t>(d.material[i]) >= scene_.materials.size()) {
        return Error("mixes a material that does not exist");
      }
    }
    if (DepthOf(d) > MaterialTable::kMixDepthMax) {
      return Error(absl::StrCat("mixes itself, or mixes are nested more than ",
                                MaterialTable::kMixDepthMax, " deep"));
    }
    return absl::OkStatus();
  }

  absl::Status Fill(const InterfaceMaterial&, CompiledMaterial* m) { return MakeInvisible(m); }

  // Depth of the nested mixes including this one, counted only as far as needed to reject it.
  // Breadth first over sets, so that a shared graph of mixes does not take exponential time.
  int DepthOf(const MixMaterial& mix) const {
    std::vector<int32_t> level = {mix.material[0], mix.material[1]};
    int depth = 1;
    while (!level.empty() && depth <= MaterialTable::kMixDepthMax) {
      std::vector<int32_t> next;
      for (int32_t index : level) {
        if (index < 0 || static_cast<size_t>(index) >= scene_.materials.size()) continue;
        const auto* inner =
            std::get_if<MixMaterial>(&scene_.materials[static_cast<size_t>(index)].material);
        if (inner != nullptr) next.insert(next.end(), {inner->material[0], inner->material[1]});
      }
      if (next.empty()) break;
      std::sort(next.begin(), next.end());
      next.erase(std::unique(next.begin(), next.end()), next.end());
      level = std::move(next);
      ++depth;
    }
    return depth;
  }

  const SceneDescription& scene_;
  FileSource& files_;
  const TextureProgram& textures_;
  ScatteringTables& tables_;
  const MaterialOptions options_;
  const MaterialDescription* description_ = nullptr;
};

}  // namespace

absl::StatusOr<std::unique_ptr<MaterialTable>> MaterialTable::Build(
    const SceneDescription& scene, FileSource& files, const MaterialOptions& options) {
  std::unique_ptr<MaterialTable> table(new MaterialTable());
  Impl& impl = *table->impl_;
  impl.cache = std::make_unique<TextureCache>(options.texture_cache_bytes_max);
  if (options.spectral) PrepareUpsampling();
  absl::StatusOr<TextureProgram> textures =
      TextureProgram::Build(scene, files, *impl.cache, options.spectral);
  if (!textures.ok()) return textures.status();
  impl.textures = *std::move(textures);
  MaterialBuilder builder(scene, files, *impl.textures, impl.tables, options);
  for (size_t i = 0; i < scene.materials.size(); ++i) {
    absl::StatusOr<CompiledMaterial> material = builder.Make(static_cast<int32_t>(i));
    if (!material.ok()) return material.status();
    impl.materials.push_back(*std::move(material));
  }
  return table;
}

}  // namespace sheaf::render
