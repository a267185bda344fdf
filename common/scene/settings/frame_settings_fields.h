// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// VisitFrameSettings: every field of FrameSettings with its names, described once. The messages'
// codec, JSON, the job store's columns, the frame digest, the metadata of images and RenderCommand
// follow from it. A new setting needs a member of FrameSettings, a line here, a field of
// v1::FrameSettings, a column in coordinator/store/job_schema.cc, its source in ResolveSettings,
// and its option in cli/commands/options.cc.
#pragma once

#include <cstdint>
#include <string>

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

// A name by which users see a field; empty: none.
struct SettingName {
  const char* name = "";
  bool always = false;  // Otherwise only where the value is not the default.
};

struct SettingField {
  const char* name;    // In v1::FrameSettings and in JSON.
  const char* column;  // In the job store's table of frames; a window has four columns.
  // Where JSON shows it: with the frame's shape, with the settings, or nowhere.
  enum class Shown { kNowhere, kWithShape, kWithSettings };
  Shown shown = Shown::kNowhere;
  DigestLine digest = {};
  SettingName flag = {};      // The option of `sheaf render`, without "--" (RenderCommand).
  SettingName metadata = {};  // The key in delivered images.
  const char* bias = "";      // The cause of a bias, in delivered images, where not the default.
};

// The parts of VisitFrameSettings, in order.
template <typename Settings, typename Visitor>
void VisitSamplingSettings(Settings& settings, const Visitor& visit) {
  using Field = SettingField;
  constexpr auto kWithShape = Field::Shown::kWithShape;
  constexpr auto kWithSettings = Field::Shown::kWithSettings;
  visit(Field{.name = "width_px", .column = "width_px", .shown = kWithShape}, settings.width_px);
  visit(Field{.name = "height_px", .column = "height_px", .shown = kWithShape}, settings.height_px);
  visit(Field{.name = "window", .column = "", .shown = kWithShape}, settings.window);
  visit(Field{.name = "sample_count", .column = "samples", .shown = kWithShape}, settings.samples);
  visit(Field{.name = "depth_max",
              .column = "max_depth",
              .shown = kWithSettings,
              .digest = {1, "max_depth", true},
              .flag = {"max-depth", true},
              .metadata = {"depthMax", true}},
        settings.max_depth);
  visit(Field{.name = "seed",
              .column = "seed",
              .shown = kWithSettings,
              .digest = {2, "seed", true},
              .flag = {"seed", true},
              .metadata = {"seed", true}},
        settings.seed);
  visit(Field{.name = "color", .column = "color", .digest = {3, "color", true}, .flag = {"color"}},
        settings.color);
  visit(Field{.name = "single_scattering",
              .column = "single_scattering",
              .digest = {4, "scattering", true, "full", "single"},
              .flag = {"single-scattering"}},
        settings.single_scattering);
  visit(Field{.name = "one_sequence",
              .column = "one_sequence",
              .shown = kWithSettings,
              .digest = {5, "sampling", false, "", "one-sequence"},
              .flag = {"one-sequence"},
              .metadata = {"sampling"}},
        settings.one_sequence);
  visit(Field{.name = "similarity_after_count",
              .column = "similarity_after",
              .shown = kWithSettings,
              .digest = {6, "similarity_after"},
              .flag = {"similarity"},
              .metadata = {"similarityAfter"},
              .bias = "similarity"},
        settings.similarity_after);
  visit(Field{.name = "light_samples_max",
              .column = "light_samples_max",
              .shown = kWithSettings,
              .digest = {14, "light_samples_max"},
              .flag = {"light-samples"},
              .metadata = {"lightSamplesMax"}},
        settings.light_samples);
  // Always a flag: the scene may name other techniques.
  visit(Field{.name = "techniques",
              .column = "techniques",
              .shown = kWithSettings,
              .digest = {13, "techniques"},
              .flag = {"techniques", true},
              .metadata = {"techniques"}},
        settings.techniques);
  // RenderCommand makes one option of both.
  visit(Field{.name = "eye_distance",
              .column = "eye_distance",
              .shown = kWithSettings,
              .digest = {15, "eye_distance"},
              .metadata = {"eyeDistance"}},
        settings.eye_distance);
  visit(Field{.name = "eye_convergence",
              .column = "eye_convergence",
              .shown = kWithSettings,
              .digest = {16, "eye_convergence"},
              .metadata = {"eyeConvergence"}},
        settings.eye_convergence);
  visit(Field{.name = "force_generic_variant", .column = "force_generic", .flag = {"generic"}},
        settings.force_generic_variant);
}
template <typename Settings, typename Visitor>
void VisitFilmSettings(Settings& settings, const Visitor& visit) {
  using Field = SettingField;
  constexpr auto kWithSettings = Field::Shown::kWithSettings;
  visit(Field{.name = "outputs", .column = "outputs", .digest = {8, "outputs"}}, settings.outputs);
  visit(Field{.name = "primaries",
              .column = "primaries",
              .digest = {9, "primaries"},
              .flag = {"primaries"},
              .metadata = {"primaries"}},
        settings.primaries);
  visit(Field{.name = "white_balance_k",
              .column = "white_balance_k",
              .digest = {10, "white_balance_k"},
              .metadata = {"whiteBalanceK"}},
        settings.white_balance_k);
  visit(Field{.name = "sensor",
              .column = "sensor",
              .shown = kWithSettings,
              .digest = {11, "sensor"},
              .metadata = {"sensor"}},
        settings.sensor);
  visit(Field{.name = "max_component_value",
              .column = "max_component_value",
              .shown = kWithSettings,
              .digest = {12, "max_component_value"},
              .metadata = {"maxComponentValue"},
              .bias = "clamped samples"},
        settings.max_component_value);
  visit(Field{.name = "pixel_stride_px",
              .column = "pixel_stride_px",
              .shown = kWithSettings,
              .digest = {7, "pixel_stride_px"}},
        settings.lattice);
}

// Calls visit(field, member) for every field. Settings: FrameSettings or const FrameSettings. The
// lattice has one field, its stride: its seed is the frame's (LatticeOf). FrameDigestText itself
// writes the digest's lines of size and window.
template <typename Settings, typename Visitor>
void VisitFrameSettings(Settings& settings, const Visitor& visit) {
  VisitSamplingSettings(settings, visit);
  VisitFilmSettings(settings, visit);
}

// Whether the value is that of frames before the setting existed.
template <typename T>
bool IsDefaultSetting(const T& value) {
  return value == T{};
}
inline bool IsDefaultSetting(const FilmOutputs& outputs) { return outputs.empty(); }
inline bool IsDefaultSetting(const PixelLattice& lattice) { return lattice.All(); }

// The value as users see it in flags and metadata; of a flag, digest.on or digest.off.
std::string SettingText(const SettingField& field, bool value);
std::string SettingText(const SettingField& field, int32_t value);
std::string SettingText(const SettingField& field, uint64_t value);
std::string SettingText(const SettingField& field, float value);
std::string SettingText(const SettingField& field, const std::string& value);
std::string SettingText(const SettingField& field, ColorTransport value);
std::string SettingText(const SettingField& field, TechniqueSet value);
std::string SettingText(const SettingField& field, Primaries value);
std::string SettingText(const SettingField& field, const FilmOutputs& value);
std::string SettingText(const SettingField& field, const PixelLattice& value);
std::string SettingText(const SettingField& field, const PixelRect& value);

// The lattice of a stride, which is 0 or 1 where all pixels are rendered.
inline PixelLattice LatticeOf(int32_t stride_px, uint64_t seed) {
  return stride_px <= 1 ? PixelLattice() : PixelLattice{stride_px, seed};
}

}  // namespace sheaf
