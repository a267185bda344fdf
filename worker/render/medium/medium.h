// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// MediumTable: the scene's participating media in the form that transport uses: their absorption,
// scattering and emission per scene unit, and whether they are bounded in all directions.
#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "absl/status/statusor.h"
#include "common/scene/file_source.h"
#include "common/scene/scene_description.h"
#include "common/volume/volume_pages.h"
#include "worker/render/color/spectral_color.h"
#include "worker/render/geometry/bounds.h"
#include "worker/render/geometry/scene_geometry.h"
#include "worker/render/light/light_table.h"
#include "worker/render/medium/color_parts.h"
#include "worker/render/medium/distance_sampling.h"
#include "worker/render/medium/emission_points.h"
#include "worker/render/medium/emissive_volume_sampler.h"
#include "worker/render/medium/equiangular_mode.h"
#include "worker/render/medium/heterogeneous_medium.h"
#include "worker/render/medium/medium_emission.h"
#include "worker/render/medium/medium_set.h"
#include "worker/render/medium/medium_velocities.h"
#include "worker/render/medium/merged_medium.h"
#include "worker/render/medium/phase_function.h"

namespace sheaf::render {

class GridFiles;

class MediumTable {
 public:
  struct Options {
    bool spectral = false;    // PropertiesOf may be called for Spectral too.
    int thread_count = 1;     // For reading and bounding grids.
    bool bound_once = false;  // HeterogeneousMedium::Placement::bound_once.
    // Limit of memory for the pages of page files.
    uint64_t volume_memory_bytes_max = volume::VolumePages::kBytesMaxDefault;
  };
  // Errors: those of the grids' files; kInvalidArgument, with the location of the medium, for media
  // that cannot be rendered; kResourceExhausted over kMediaMax.
  static absl::StatusOr<std::unique_ptr<MediumTable>> Build(const SceneDescription& scene,
                                                            const SceneGeometry& geometry,
                                                            MediumVelocities velocities,
                                                            FileSource& files,
                                                            const Options& options);

  // All other functions use this index: media are sorted by their properties, so that their order
  // in the scene file changes no bit. medium: an index in SceneDescription::media.
  uint16_t IndexOf(int32_t medium) const { return index_of_[static_cast<size_t>(medium)]; }
  // The media that surround the camera.
  const MediumSet& camera_media() const { return camera_media_; }

  // Properties of the homogeneous media; MediumProperties::is_heterogeneous says that there are
  // others. texture_value: the fraction of the subsurface scattering that remains, the rest being
  // absorbed; null: all of it. Thread safety: any number of threads at once.
  template <typename Color>
  MediumProperties<Color> PropertiesOf(const MediumSet& media,
                                       const WavelengthsOf<Color>& wavelengths, MediumForm form,
                                       const Color* texture_value = nullptr) const;
  // Requires: `properties` are PropertiesOf the same arguments, and scatter. throughput weights the
  // media that overlap.
  template <typename Color>
  PhaseMixture<Color> PhaseOf(const MediumSet& media, const MediumProperties<Color>& properties,
                              const Color& throughput, const WavelengthsOf<Color>& wavelengths,
                              const Color* texture_value = nullptr) const;

  // --- Heterogeneous media. Each has one density or, if it is a grid of colors, one for each of
  // the components whose sum is the color.
  struct PartId {
    uint16_t medium, part;
  };
  // PartId::part of all parts of a merged medium together.
  static constexpr uint16_t kMergedPart = 0xffff;
  class PartList {
   public:
    uint32_t size() const { return size_; }
    PartId operator[](uint32_t i) const { return parts_[i]; }
    // Whether the i-th is a merged medium, which has its parts from MergedAt.
    bool IsMerged(uint32_t i) const { return parts_[i].part == kMergedPart; }

   private:
    friend class MediumTable;
    uint32_t size_ = 0;
    // Event streams identify parts by 8 bits.
    static_assert(kMediaAtOnceMax * kMediumPartsMax < 255);
    std::array<PartId, kMediaAtOnceMax * kMediumPartsMax> parts_;
  };
  PartList PartsOf(const MediumSet& media) const {
    PartList list;
    for (const uint16_t medium : media) {
      for (uint16_t part = 0; part < media_[medium].parts.size(); ++part) {
        list.parts_[list.size_++] = {medium, part};
      }
      if (media_[medium].merged) list.parts_[list.size_++] = {medium, kMergedPart};
    }
    return list;
  }
  const HeterogeneousMedium& DensityOf(PartId id) const { return PartAt(id).density; }
  // Null where the part does not emit.
  const MediumEmission* MediumEmissionOf(PartId id) const {
    return PartAt(id).kind == Part::Kind::kScatters ? nullptr
                                                    : media_[id.medium].medium_emission.get();
  }
  // All heterogeneous media that emit.
  const EmissiveVolumeSampler& emissive_volumes() const { return emissive_volumes_; }
  // The points of all emissive media at which light paths may begin.
  EmissionPoints MakeEmissionPoints(const SceneGeometry& geometry) const;
  // Whether light paths begin where the media are these: none of them emits without bounds. The
  // points of MakeEmissionPoints do not contain such a medium, so paths from the camera find all
  // light of the places where it is.
  bool BeginsLightPaths(const MediumSet& media) const {
    for (const uint16_t medium : media) {
      if (media_[medium].emits && !media_[medium].IsBody()) return false;
    }
    return true;
  }
  // For a density of 1, per scene unit.
  template <typename Color>
  struct Coefficients {
    Color sigma_t, sigma_s, sigma_a;
  };
  template <typename Color>
  Coefficients<Color> CoefficientsOf(PartId id, const WavelengthsOf<Color>& wavelengths,
                                     MediumForm form) const;

  // --- Media that overlap: medium_merging.cc. Puts one medium in the place of heterogeneous ones
  // whose boxes overlap, and one boundary in the place of theirs, where neither changes what is at
  // any point. camera_origins: where the camera's rays begin, in render space. Call once, before
  // ChooseEquiangular and before rays are traced.
  void MergeOverlapping(const SceneDescription& scene, const Bounds& camera_origins,
                        int thread_count, SceneGeometry* geometry);
  const MergedMedium& MergedAt(uint16_t medium) const { return *media_[medium].merged; }
  // The media that act where a path is in this one: itself, or those that it merges.
  std::span<const uint16_t> MembersOf(uint16_t medium) const { return media_[medium].members; }
  size_t merged_count() const;

  // At a point of render space. time: as for HeterogeneousMedium.
  template <typename Color, typename Time>
  Coefficients<Color> CoefficientsAt(uint16_t medium, Vec3d p, Time time,
                                     const WavelengthsOf<Color>& wavelengths,
                                     MediumForm form) const;
  float PhaseAsymmetryOf(uint16_t index, MediumForm form) const { return media_[index].In(form).g; }

  // --- Equiangular sampling in heterogeneous media: medium_equiangular.cc. Decides for each such
  // medium whether rays through it gather light; none does by default. Call once, before the table
  // is used.
  void ChooseEquiangular(const LightTable& lights, EquiangularMode mode);
  bool Gathers(uint16_t medium) const { return media_[medium].gathers; }
  bool gathers_always() const { return gathers_always_; }  // Whether or not it pays off.
  // The part of o + t d, t in [0, length], that passes through gathering heterogeneous media, and
  // their mean extinction over their boxes; d: unit. Empty where begin == end.
  struct EquiangularSpan {
    double begin = 0, end = 0, extinction = 0;
  };
  EquiangularSpan EquiangularSpanOf(const MediumSet& media, Vec3d o, Vec3d d, double length) const;
  uint64_t memory_bytes() const;
  // The pages of page files that are in memory now.
  uint64_t page_bytes() const { return pages_->page_bytes(); }
  // The first error of reading a page of a page file; the media are wrong from then on.
  volume::PageCounts page_counts() const { return pages_->counts(); }
  absl::Status PageStatus() const { return pages_->status(); }

 private:
  struct Part {
    // Its effect on light; a color's density does only one of the two, for one color component.
    enum class Kind : uint8_t { kBoth, kAbsorbs, kScatters };
    HeterogeneousMedium density;
    Kind kind = Kind::kBoth;
    ColorPart color = ColorPart::kGray;
  };
  const Part& PartAt(PartId id) const { return media_[id.medium].parts[id.part]; }

  // Factor of sigma_s and mean cosine in one form of a medium.
  struct Scattering {
    float sigma_s_factor = 1, g = 0;
  };
  struct Medium {
    const Scattering& In(MediumForm form) const { return scattering[static_cast<size_t>(form)]; }
    // Sets the forms. Backward scattering would become denser, so it stays as it is.
    void SetForms(float g) {
      scattering[static_cast<size_t>(MediumForm::kTrue)] = {1, g};
      scattering[static_cast<size_t>(MediumForm::kReduced)] = {1 - std::max(g, 0.0f),
                                                               std::min(g, 0.0f)};
    }
    // Closed surfaces alone bound it.
    bool IsBody() const { return is_bounded && !is_subsurface; }

    Rgb sigma_a, sigma_s, radiance;  // Scaled, per scene unit.
    SpectralColor sigma_a_spectrum, sigma_s_spectrum, radiance_spectrum;
    float scale = 1, radiance_scale = 1;   // Factors of the spectra.
    std::array<Scattering, 2> scattering;  // By MediumForm.
    bool emits = false;
    bool is_bounded = false;
    std::vector<Part> parts;                                // Empty if homogeneous.
    std::unique_ptr<const MediumEmission> medium_emission;  // If heterogeneous.
    bool gathers = false;                                   // As in MediumProperties.
    double extinction = 0;                          // If it gathers: the mean over its boxes.
    bool is_subsurface = false, is_hidden = false;  // As in MediumProperties.
    bool is_heterogeneous = false;
    bool has_emissive_grid = false;
    std::unique_ptr<const MergedMedium> merged;  // In the place of parts, if it merges media.
    std::vector<uint16_t> members;               // As MembersOf returns them.
  };
  // The motion of a medium while the shutter is open, if any.
  struct Movement {
    std::optional<VolumeGrid> velocities;
    double duration = 0;  // As for VolumeMotion::Make.
  };
  // Errors: see Build.
  static absl::StatusOr<std::vector<Part>> MakeParts(const std::string& where,
                                                     const MediumDescription& description,
                                                     const Affine& placement, Movement movement,
                                                     GridFiles& files, const Options& options);
  // Null where the medium does not emit. Errors: see Build.
  static absl::StatusOr<std::unique_ptr<const MediumEmission>> MakeEmission(
      const std::string& where, const MediumDescription& description, const Affine& placement,
      GridFiles& files, const Options& options);
  // For subsurface media given by their reflectance: converts each wavelength.
  static void SetSpectra(const SubsurfaceReflectance& reflectance, float g, Medium* medium);
  std::vector<EmissiveDensity> EmissiveDensities() const;
  struct MergeInput;  // A medium that can be merged: medium_merging.cc.
  std::vector<MergeInput> MergeInputs(const SceneDescription& scene,
                                      const SceneGeometry& geometry) const;
  // False, without effect, where the camera forbids it.
  bool Merge(std::span<const MergeInput> inputs, int32_t camera_medium,
             const Bounds& camera_origins, int thread_count, SceneGeometry* geometry);
  template <typename Color>
  static Color Evaluate(Rgb rgb, const SpectralColor& spectrum, float scale,
                        const WavelengthsOf<Color>& wavelengths) {
    if constexpr (std::is_same_v<Color, Spectral>) {
      return spectrum.At(wavelengths) * scale;
    } else {
      return rgb;
    }
  }

  std::shared_ptr<volume::VolumePages> pages_;
  std::vector<Medium> media_;
  std::vector<uint16_t> index_of_;
  MediumSet camera_media_;
  EmissiveVolumeSampler emissive_volumes_;
  bool gathers_always_ = false;
};

template <typename Color>
MediumProperties<Color> MediumTable::PropertiesOf(const MediumSet& media,
                                                  const WavelengthsOf<Color>& wavelengths,
                                                  MediumForm form,
                                                  const Color* texture_value) const {
  constexpr size_t kCount = kComponentCount<Color>;
  // Sums in double are the same in any order, except for coefficients that differ by a factor of
  // about 2^29.
  std::array<double, kCount> sigma_t{}, sigma_s{}, emission{};
  MediumProperties<Color> properties;
  properties.form = form;
  for (const uint16_t index : media) {
    const Medium& medium = media_[index];
    properties.is_bounded = properties.is_bounded || medium.is_bounded;
    properties.is_subsurface = properties.is_subsurface || medium.is_subsurface;
    properties.is_hidden = properties.is_hidden || medium.is_hidden;
    if (medium.is_heterogeneous) {
      properties.is_heterogeneous = true;
      properties.has_emissive_grid = properties.has_emissive_grid || medium.has_emissive_grid;
      properties.gathers = properties.gathers || medium.gathers;
      continue;
    }
    Color a = Evaluate<Color>(medium.sigma_a, medium.sigma_a_spectrum, medium.scale, wavelengths);
    Color s = Evaluate<Color>(medium.sigma_s, medium.sigma_s_spectrum, medium.scale, wavelengths);
    if (texture_value != nullptr && medium.is_subsurface) {
      const Color kept = s * *texture_value;
      a = MakeColor<Color>([&](size_t i) { return a[i] + (s[i] - kept[i]); });
      s = kept;
    }
    s *= medium.In(form).sigma_s_factor;
    for (size_t i = 0; i < kCount; ++i) {
      sigma_t[i] += static_cast<double>(a[i]) + static_cast<double>(s[i]);
      sigma_s[i] += static_cast<double>(s[i]);
    }
    if (!medium.emits) continue;
    const Color radiance = Evaluate<Color>(medium.radiance, medium.radiance_spectrum,
                                           medium.radiance_scale, wavelengths);
    for (size_t i = 0; i < kCount; ++i) {
      emission[i] += static_cast<double>(radiance[i]) * static_cast<double>(a[i]);
    }
  }
  for (size_t i = 0; i < kCount; ++i) {
    properties.sigma_t[i] = static_cast<float>(sigma_t[i]);
    properties.sigma_s[i] = static_cast<float>(sigma_s[i]);
    properties.emission[i] = static_cast<float>(emission[i]);
    properties.is_gray = properties.is_gray && properties.sigma_t[i] == properties.sigma_t[0] &&
                         properties.sigma_s[i] == properties.sigma_s[0];
  }
  properties.scatters = !properties.sigma_s.IsBlack();
  return properties;
}

template <typename Color>
PhaseMixture<Color> MediumTable::PhaseOf(const MediumSet& media,
                                         const MediumProperties<Color>& properties,
                                         const Color& throughput,
                                         const WavelengthsOf<Color>& wavelengths,
                                         const Color* texture_value) const {
  PhaseMixture<Color> phase;
  if (media.size() == 1) {
    phase.Add(media_[*media.begin()].In(properties.form).g, Color::Gray(1), 1);
    return phase;
  }
  const Color chosen_by = internal::ComponentProbabilities(throughput);
  for (const uint16_t index : media) {
    const Medium& medium = media_[index];
    if (medium.is_heterogeneous) continue;
    const auto [kept, g] = medium.In(properties.form);
    Color s =
        Evaluate<Color>(medium.sigma_s, medium.sigma_s_spectrum, medium.scale, wavelengths) * kept;
    if (texture_value != nullptr && medium.is_subsurface) s *= *texture_value;
    float probability = 0;
    const Color part = MakeColor<Color>([&](size_t i) {
      const float of_all = properties.sigma_s[i] > 0 ? s[i] / properties.sigma_s[i] : 0;
      probability += of_all * chosen_by[i];
      return of_all;
    });
    if (probability > 0) phase.Add(g, part, probability);
  }
  return phase;
}

template <typename Color>
MediumTable::Coefficients<Color> MediumTable::CoefficientsOf(
    PartId id, const WavelengthsOf<Color>& wavelengths, MediumForm form) const {
  const Medium& medium = media_[id.medium];
  const Part& part = PartAt(id);
  const float kept = medium.In(form).sigma_s_factor;
  if (part.kind != Part::Kind::kBoth) {
    const Color sigma = PartWeight<Color>(part.color, wavelengths) * medium.scale;
    if (part.kind == Part::Kind::kScatters) return {sigma * kept, sigma * kept, {}};
    return {sigma, {}, sigma};
  }
  const Color s =
      Evaluate<Color>(medium.sigma_s, medium.sigma_s_spectrum, medium.scale, wavelengths) * kept;
  const Color a =
      Evaluate<Color>(medium.sigma_a, medium.sigma_a_spectrum, medium.scale, wavelengths);
  return {s + a, s, a};
}

template <typename Color, typename Time>
MediumTable::Coefficients<Color> MediumTable::CoefficientsAt(
    uint16_t medium, Vec3d p, Time time, const WavelengthsOf<Color>& wavelengths,
    MediumForm form) const {
  Coefficients<Color> sum;
  for (uint16_t part = 0; part < media_[medium].parts.size(); ++part) {
    const auto its = CoefficientsOf<Color>({medium, part}, wavelengths, form);
    const auto density = static_cast<float>(DensityOf({medium, part}).DensityAt(p, time));
    sum.sigma_t += its.sigma_t * density;
    sum.sigma_s += its.sigma_s * density;
    sum.sigma_a += its.sigma_a * density;
  }
  return sum;
}

}  // namespace sheaf::render
