// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "coordinator/service/view/json/view_json.h"

#include <nlohmann/json.hpp>
#include <type_traits>
#include <utility>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "coordinator/service/view/enum_name.h"

namespace sheaf::coordinator {
namespace {

using Json = nlohmann::ordered_json;

// Users' text may not be valid UTF-8; it is shown with replacement characters.
std::string Dump(const Json& json) {
  return json.dump(-1, ' ', false, Json::error_handler_t::replace);
}

template <HasFields View>
Json ObjectOf(const View& view, JsonFields fields);

// The JSON of a member of a view.
class ValueWriter {
 public:
  ValueWriter(const ViewField& field, JsonFields fields) : field_(field), fields_(fields) {}

  template <typename Number>
  requires std::is_arithmetic_v<Number> Json Write(Number value)
  const { return field_.null_if_empty && !(value > 0) ? Json() : Json(value); }
  Json Write(const std::string& value) const {
    if (field_.null_if_empty && value.empty()) return nullptr;
    return absl::StrCat(field_.prefix, value);
  }
  // Milliseconds suffice for users.
  Json Write(absl::Time time) const {
    if (time == absl::InfiniteFuture() || time == absl::InfinitePast()) return nullptr;
    return absl::FormatTime("%Y-%m-%dT%H:%M:%E3SZ", time, absl::UTCTimeZone());
  }
  Json Write(absl::Duration duration) const {
    return duration == absl::InfiniteDuration() ? Json() : Json(absl::ToDoubleSeconds(duration));
  }
  Json Write(const BlobDigest& digest) const {
    return digest.sha256_hex.empty() ? Json() : Json(digest.sha256_hex);
  }
  template <typename Enum>
  requires std::is_enum_v<Enum> Json Write(Enum value)
  const { return EnumName(value); }
  template <typename Enum>
  requires std::is_enum_v<Enum> Json Write(const std::optional<Enum>& value)
  const { return value ? EnumName(*value) : ""; }
  template <typename T>
  Json Write(const std::optional<T>& value) const {
    return value ? Write(*value) : Json();
  }
  template <typename T>
  Json Write(const std::vector<T>& values) const {
    Json json = Json::array();
    for (const T& value : values) json.push_back(Write(value));
    return json;
  }
  template <HasFields View>
  Json Write(const View& view) const {
    return ObjectOf(view, fields_);
  }

 private:
  const ViewField& field_;
  const JsonFields fields_;
};

template <typename T>
Json SettingJson(const T& value) {
  return value;
}
Json SettingJson(const PixelRect& value) { return ObjectOf(value, JsonFields::kHttp); }
Json SettingJson(const PixelLattice& value) { return value.All() ? 0 : value.stride_px; }
Json SettingJson(const FilmOutputs& value) { return FormatOutputs(value); }
Json SettingJson(ColorTransport value) { return ColorTransportName(value); }
Json SettingJson(Primaries value) { return PrimariesName(value); }
Json SettingJson(TechniqueSet value) { return value.Name(); }

// Adds the settings that are shown in this place of a frame.
void AddSettings(const FrameSettings& settings, SettingField::Shown shown, Json* json) {
  VisitFrameSettings(settings, [&](const SettingField& field, const auto& value) {
    if (field.shown == shown) (*json)[field.name] = SettingJson(value);
  });
}

bool IsShown(const ViewField& field, JsonFields fields) {
  using enum ViewField::Shown;
  if (field.shown == kOnlyMessages) return false;
  return field.shown != (fields == JsonFields::kHttp ? kNotHttp : kOnlyHttp);
}

template <HasFields View>
void AddFields(const View& view, JsonFields fields, Json* json) {
  VisitFields(view, [&]<typename Member>(const ViewField& field, const Member& member) {
    if (!IsShown(field, fields)) return;
    if constexpr (std::is_same_v<Member, FrameSettings>) {
      AddSettings(member, field.settings, json);
    } else {
      (*json)[field.name] = ValueWriter(field, fields).Write(member);
    }
  });
}

template <HasFields View>
Json ObjectOf(const View& view, JsonFields fields) {
  Json json = Json::object();
  AddFields(view, fields, &json);
  return json;
}

}  // namespace

std::string JobJson(const JobView& job, JsonFields fields) { return Dump(ObjectOf(job, fields)); }

std::string JobWithFramesJson(const JobView& job, const std::vector<std::string>& frames,
                              JsonFields fields,
                              const std::optional<std::string>& next_page_token) {
  Json effects = Json::array();
  for (const EffectCost& effect : job.effect_costs) effects.push_back(ObjectOf(effect, fields));
  std::string text = JobJson(job, fields);
  text.pop_back();
  absl::StrAppend(&text, ",\"effect_costs\":", Dump(effects), ",\"frames\":[",
                  absl::StrJoin(frames, ","), "]");
  if (next_page_token) absl::StrAppend(&text, ",\"next_page_token\":", Dump(*next_page_token));
  return absl::StrCat(text, "}");
}

std::string FrameJson(const std::string& job_id, const FrameView& frame, JsonFields fields) {
  Json json = {{"name", FrameName(job_id, frame.frame_number)}};
  AddFields(frame, fields, &json);
  if (frame.has_unknown_techniques) json["techniques"] = "unknown";
  return Dump(json);
}

std::string WorkerJson(const WorkerView& worker, JsonFields fields) {
  return Dump(ObjectOf(worker, fields));
}

std::string ShareJson(const ShareView& share) {
  return Dump(ObjectOf(share, JsonFields::kMessages));
}

std::string RefinementPricesJson(const RefinementPrices& priced) {
  return Dump(ObjectOf(priced, JsonFields::kHttp));
}

std::string RemovalJson(const RemovalView& removal) {
  return Dump(ObjectOf(removal, JsonFields::kHttp));
}

std::string EventJson(const JobEvent& event) { return Dump(ObjectOf(event, JsonFields::kHttp)); }

std::string FailureJson(const std::string& job_id, const FailureView& view) {
  Json json = {{"frame_name", FrameName(job_id, view.failure.frame_number)}};
  AddFields(view, JsonFields::kHttp, &json);
  return Dump(json);
}

}  // namespace sheaf::coordinator
