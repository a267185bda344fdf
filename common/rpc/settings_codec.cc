// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "common/rpc/settings_codec.h"

#include <google/protobuf/descriptor.h>
#include <google/protobuf/message.h>

#include <iterator>
#include <optional>
#include <string>
#include <utility>

#include "absl/strings/str_cat.h"
#include "common/base/check.h"
#include "common/scene/settings/frame_settings_fields.h"

namespace sheaf {
namespace {

// The wire and stored jobs use the same numbers.
static_assert(static_cast<int>(Primaries::kAcesCg) == v1::PRIMARIES_ACESCG &&
              v1::Primaries_ARRAYSIZE == kPrimariesCount);

static_assert(static_cast<int>(ColorTransport::kSpectral) == v1::COLOR_TRANSPORT_SPECTRAL &&
              v1::ColorTransport_ARRAYSIZE == 3);

static_assert(TechniqueSet::kCameraAndLight.Number() == v1::TECHNIQUES_CAMERA_AND_LIGHT &&
              TechniqueSet::kLight.Number() == v1::TECHNIQUES_LIGHT &&
              TechniqueSet::kCameraGuided.Number() == v1::TECHNIQUES_CAMERA_GUIDED &&
              TechniqueSet::kCameraAndLightGuided.Number() ==
                  v1::TECHNIQUES_CAMERA_AND_LIGHT_GUIDED &&
              TechniqueSet::kCameraGuidedSplit.Number() == v1::TECHNIQUES_CAMERA_GUIDED_SPLIT &&
              TechniqueSet::kCameraAndLightGuidedSplit.Number() ==
                  v1::TECHNIQUES_CAMERA_AND_LIGHT_GUIDED_SPLIT &&
              v1::Techniques_ARRAYSIZE == std::size(kNumberedTechniques));

const google::protobuf::FieldDescriptor* FieldOf(const SettingField& field) {
  const google::protobuf::FieldDescriptor* const found =
      v1::FrameSettings::descriptor()->FindFieldByName(field.name);
  SHEAF_CHECK(found != nullptr);
  return found;
}

// Writes members into the message's fields of their names.
class FieldWriter {
 public:
  explicit FieldWriter(v1::FrameSettings* wire)
      : wire_(*wire), reflection_(*wire->GetReflection()) {}

  void operator()(const SettingField& field, bool value) const {
    reflection_.SetBool(&wire_, FieldOf(field), value);
  }
  void operator()(const SettingField& field, int32_t value) const {
    reflection_.SetInt32(&wire_, FieldOf(field), value);
  }
  void operator()(const SettingField& field, uint64_t value) const {
    reflection_.SetUInt64(&wire_, FieldOf(field), value);
  }
  void operator()(const SettingField& field, float value) const {
    reflection_.SetFloat(&wire_, FieldOf(field), value);
  }
  void operator()(const SettingField& field, const std::string& value) const {
    reflection_.SetString(&wire_, FieldOf(field), value);
  }
  void operator()(const SettingField& field, ColorTransport value) const {
    reflection_.SetEnumValue(&wire_, FieldOf(field), static_cast<int>(value));
  }
  void operator()(const SettingField& field, Primaries value) const {
    reflection_.SetEnumValue(&wire_, FieldOf(field), static_cast<int>(value));
  }
  void operator()(const SettingField& field, TechniqueSet value) const {
    reflection_.SetEnumValue(&wire_, FieldOf(field), value.Number());
  }
  void operator()(const SettingField& field, const PixelRect& value) const {
    reflection_.MutableMessage(&wire_, FieldOf(field))->CopyFrom(ToWire(value));
  }
  void operator()(const SettingField& field, const FilmOutputs& value) const {
    (*this)(field, FormatOutputs(value));
  }
  void operator()(const SettingField& field, const PixelLattice& value) const {
    (*this)(field, value.All() ? 0 : value.stride_px);
  }

 private:
  v1::FrameSettings& wire_;
  const google::protobuf::Reflection& reflection_;
};

// Reads members from the message's fields of their names; *status is the first error.
class FieldReader {
 public:
  FieldReader(const v1::FrameSettings& wire, absl::Status* status)
      : wire_(wire), reflection_(*wire.GetReflection()), status_(*status) {}

  void operator()(const SettingField& field, bool& value) const {
    value = reflection_.GetBool(wire_, FieldOf(field));
  }
  void operator()(const SettingField& field, int32_t& value) const {
    value = reflection_.GetInt32(wire_, FieldOf(field));
  }
  void operator()(const SettingField& field, uint64_t& value) const {
    value = reflection_.GetUInt64(wire_, FieldOf(field));
  }
  void operator()(const SettingField& field, float& value) const {
    value = reflection_.GetFloat(wire_, FieldOf(field));
  }
  void operator()(const SettingField& field, std::string& value) const {
    value = reflection_.GetString(wire_, FieldOf(field));
  }
  void operator()(const SettingField& field, ColorTransport& value) const {
    const int number = reflection_.GetEnumValue(wire_, FieldOf(field));
    value = v1::ColorTransport_IsValid(number) ? static_cast<ColorTransport>(number)
                                               : ColorTransport::kAuto;
  }
  void operator()(const SettingField& field, Primaries& value) const {
    const int number = reflection_.GetEnumValue(wire_, FieldOf(field));
    if (v1::Primaries_IsValid(number)) {
      value = static_cast<Primaries>(number);
    } else {
      status_.Update(absl::InvalidArgumentError(
          absl::StrCat("primaries number ", number, " are unknown here")));
    }
  }
  void operator()(const SettingField& field, TechniqueSet& value) const {
    const int number = reflection_.GetEnumValue(wire_, FieldOf(field));
    if (const std::optional<TechniqueSet> set = TechniqueSet::FromNumber(number)) {
      value = *set;
    } else {
      status_.Update(absl::InvalidArgumentError(
          absl::StrCat("techniques number ", number, " are unknown here")));
    }
  }
  void operator()(const SettingField&, PixelRect& value) const { value = FromWire(wire_.window()); }
  void operator()(const SettingField& field, FilmOutputs& value) const {
    absl::StatusOr<FilmOutputs> outputs =
        ParseOutputs(reflection_.GetString(wire_, FieldOf(field)));
    if (outputs.ok()) {
      value = *std::move(outputs);
    } else {
      status_.Update(outputs.status());
    }
  }
  void operator()(const SettingField& field, PixelLattice& value) const {
    const int32_t stride_px = reflection_.GetInt32(wire_, FieldOf(field));
    if (stride_px == 0 || (stride_px >= kPixelStrideMin && stride_px <= kPixelStrideMax)) {
      value = LatticeOf(stride_px, wire_.seed());
    } else {
      status_.Update(
          absl::InvalidArgumentError(absl::StrCat("a pixel stride of ", stride_px, " is outside [",
                                                  kPixelStrideMin, ", ", kPixelStrideMax, "]")));
    }
  }

 private:
  const v1::FrameSettings& wire_;
  const google::protobuf::Reflection& reflection_;
  absl::Status& status_;
};

}  // namespace

v1::PixelRect ToWire(const PixelRect& rect) {
  v1::PixelRect wire;
  wire.set_x0_px(rect.x0);
  wire.set_y0_px(rect.y0);
  wire.set_x1_px(rect.x1);
  wire.set_y1_px(rect.y1);
  return wire;
}

PixelRect FromWire(const v1::PixelRect& rect) {
  return {rect.x0_px(), rect.y0_px(), rect.x1_px(), rect.y1_px()};
}

v1::FrameSettings ToWire(const FrameSettings& settings) {
  v1::FrameSettings wire;
  VisitFrameSettings(settings, FieldWriter(&wire));
  return wire;
}

FrameSettings ReadUnchecked(const v1::FrameSettings& wire) {
  FrameSettings settings;
  absl::Status ignored;
  VisitFrameSettings(settings, FieldReader(wire, &ignored));
  return settings;
}

absl::StatusOr<FrameSettings> FromWire(const v1::FrameSettings& wire) {
  FrameSettings settings;
  absl::Status status;
  VisitFrameSettings(settings, FieldReader(wire, &status));
  status.Update(CheckSettings(settings));
  if (!status.ok()) return status;
  return settings;
}

}  // namespace sheaf
