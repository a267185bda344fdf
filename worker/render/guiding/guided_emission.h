// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// GuidedEmission: LightEmission, guided by an EmissionField: rays leave the lights by a mixture of
// the field and of the lights' own choice, and all densities are those of the mixture. Without a
// field it is LightEmission, to the bit. See docs/adr/0128.
#pragma once

#include <cstdint>
#include <optional>

#include "worker/render/guiding/emission_field.h"
#include "worker/render/light/light_emission.h"

namespace sheaf::render {

// The share of rays that ignores the field: what the training has missed keeps a quarter of its
// rays, so that a weight is at most four times that of an unguided ray.
inline constexpr double kUnguidedEmission = 0.25;

// Where a light path began.
struct EmissionOrigin {
  uint32_t light = 0;
  EmissionPlace place;
  // The light's own density there, over that of uniform places.
  double own = 1;
};

class GuidedEmission {
 public:
  GuidedEmission() = default;
  // Both must outlive *this. field: null or empty where nothing has been learned.
  GuidedEmission(const LightEmission* emission, const EmissionField* field)
      : emission_(emission), field_(field != nullptr && !field->empty() ? field : nullptr) {}

  const LightEmission& lights() const { return *emission_; }

  // As LightEmission::SampleLe.
  template <typename Color = Rgb>
  std::optional<EmittedRayOf<Color>> SampleLe(const EmissionUniforms& u,
                                              const WavelengthsOf<Color>& wavelengths = {}) const;
  // The start of a path in the emission of media.
  struct MediaStart {
    double choice = 0;       // As LightEmission::ChooseMedia.
    Vec3f w;                 // The direction; unit.
    double probability = 0;  // MediaProbability(w).
  };
  // None where the sample chooses no media.
  std::optional<MediaStart> StartInMedia(const EmissionUniforms& u) const;
  // 4 pi times the density of choosing media and the direction w, in which the path leaves them.
  double MediaProbability(Vec3f w) const;

  // As LightEmission's. p_light: the point of a surface.
  double PdfLe(uint32_t light, Vec3f p, Vec3f p_light, Vec3f n, Vec3f w) const;
  double DensityAt(uint32_t light, Vec3f p, Vec3f p_light, Vec3f n, Vec3f w) const;
  double InfiniteDensityAt(Vec3f p, Vec3f w) const;

  // The origin of the ray that leaves the light along w, as LightEmission::PlaceOfRay; of a path
  // that begins in media, for light == lights().choice_count() - 1.
  EmissionOrigin OriginOf(uint32_t light, Vec3f p, Vec3f p_light, Vec3f n, Vec3f w) const;
  // The density of rays at the origin, over that of choosing the light by its power and then the
  // place uniformly.
  double DensityOf(const EmissionOrigin& origin) const {
    if (field_ == nullptr) return origin.own;
    return Mixed(origin.own, field_->CellOf(origin.light, origin.place));
  }

 private:
  // The same in the cell.
  double Mixed(double own, const EmissionField::Cell& cell) const {
    return kUnguidedEmission * own + (1 - kUnguidedEmission) * cell.density / ChoiceOf(cell);
  }
  // The probability with which the power alone chooses a light of the cell.
  double ChoiceOf(const EmissionField::Cell& cell) const {
    return emission_->ChoiceBegin(cell.last) - emission_->ChoiceBegin(cell.first);
  }
  // Probability by power.
  double ChoiceOf(uint32_t light) const {
    return emission_->ChoiceBegin(light + 1) - emission_->ChoiceBegin(light);
  }
  // A light of the cell, by power. v: in [0, 1).
  uint32_t LightOf(const EmissionField::Cell& cell, double v) const;
  uint32_t media() const { return emission_->choice_count() - 1; }

  const LightEmission* emission_ = nullptr;
  const EmissionField* field_ = nullptr;
};

}  // namespace sheaf::render
