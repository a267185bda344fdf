// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// VisitFrameSettings: every field of FrameSettings with its names, described once. The messages'
// codec, JSON, the job store's columns and the frame digest follow from it. A new setting needs a
// member of FrameSettings, a line here, a field of v1::FrameSettings, a column in
// coordinator/store/job_schema.cc, and its source in ResolveSettings.
#pragma once

#include "common/scene/settings/render_settings.h"

namespace sheaf {

// How a field appears in the text of the frame digest (FrameDigestText).
struct DigestLine {
  int place = 0;  // Lines stand in this order; 0: none, because the field changes no sample.
  const char* name = "";
  bool always = false;   // Otherwise only where the value is not the default.
  const char* off = "";  // The values of a flag; this and the next.
  const char* on = "";
};

struct SettingField {
  const char* name;    // In v1::FrameSettings and in JSON.
  const char* column;  // In the job store's table of frames; a window has four columns.
  // Where JSON shows it: with the frame's shape, with the settings, or nowhere.
  enum class Shown { kNowhere, kWithShape, kWithSettings };
  Shown shown = Shown::kNowhere;
  DigestLine digest = {};
};

// Calls visit(field, member) for every field. Settings: FrameSettings or const FrameSettings. The
// lattice has one field, its stride: its seed is the frame's (LatticeOf). FrameDigestText itself
// writes the digest's lines of size and window.
template <typename Settings, typename Visitor>
void VisitFrameSettings(Settings& settings, const Visitor& visit) {
  using Field = SettingField;
  constexpr auto kWithShape = Field::Shown::kWithShape;
  constexpr auto kWithSettings = Field::Shown::kWithSettings;
  constexpr auto kNowhere = Field::Shown::kNowhere;
  visit(Field{"width_px", "width_px", kWithShape}, settings.width_px);
  visit(Field{"height_px", "height_px", kWithShape}, settings.height_px);
  visit(Field{"window", "", kWithShape}, settings.window);
  visit(Field{"sample_count", "samples", kWithShape}, settings.samples);
  visit(Field{"depth_max", "max_depth", kWithSettings, {1, "max_depth", true}}, settings.max_depth);
  visit(Field{"seed", "seed", kWithSettings, {2, "seed", true}}, settings.seed);
  visit(Field{"color", "color", kNowhere, {3, "color", true}}, settings.color);
  visit(Field{"single_scattering",
              "single_scattering",
              kNowhere,
              {4, "scattering", true, "full", "single"}},
        settings.single_scattering);
  visit(Field{"one_sequence",
              "one_sequence",
              kWithSettings,
              {5, "sampling", false, "", "one-sequence"}},
        settings.one_sequence);
  visit(Field{"similarity_after_count", "similarity_after", kWithSettings, {6, "similarity_after"}},
        settings.similarity_after);
  visit(Field{"light_samples_max", "light_samples_max", kWithSettings, {14, "light_samples_max"}},
        settings.light_samples);
  visit(Field{"techniques", "techniques", kWithSettings, {13, "techniques"}}, settings.techniques);
  visit(Field{"force_generic_variant", "force_generic"}, settings.force_generic_variant);
  visit(Field{"outputs", "outputs", kNowhere, {8, "outputs"}}, settings.outputs);
  visit(Field{"primaries", "primaries", kNowhere, {9, "primaries"}}, settings.primaries);
  visit(Field{"white_balance_k", "white_balance_k", kNowhere, {10, "white_balance_k"}},
        settings.white_balance_k);
  visit(Field{"sensor", "sensor", kWithSettings, {11, "sensor"}}, settings.sensor);
  visit(
      Field{
          "max_component_value", "max_component_value", kWithSettings, {12, "max_component_value"}},
      settings.max_component_value);
  visit(Field{"pixel_stride_px", "pixel_stride_px", kWithSettings, {7, "pixel_stride_px"}},
        settings.lattice);
}

// The lattice of a stride, which is 0 or 1 where all pixels are rendered.
inline PixelLattice LatticeOf(int32_t stride_px, uint64_t seed) {
  return stride_px <= 1 ? PixelLattice() : PixelLattice{stride_px, seed};
}

}  // namespace sheaf
