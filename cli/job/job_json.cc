// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "cli/job/job_json.h"

#include <google/protobuf/descriptor.h>
#include <google/protobuf/message.h>

#include <cstdint>
#include <map>
#include <nlohmann/json.hpp>
#include <optional>
#include <type_traits>
#include <utility>
#include <vector>

#include "absl/strings/ascii.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_replace.h"
#include "absl/strings/string_view.h"
#include "absl/strings/strip.h"
#include "absl/time/time.h"
#include "cli/duration.h"
#include "common/scene/settings/frame_settings_fields.h"

namespace sheaf::cli {
namespace {

using Json = nlohmann::ordered_json;

// Text from users may be invalid UTF-8; replacement characters stand for the invalid bytes.
std::string Dump(const Json& json) {
  return json.dump(-1, ' ', false, Json::error_handler_t::replace);
}

// The value of an enumeration without its prefix: "STATE_RUNNING" to "running",
// "STOP_REASON_TARGET_ERROR" to "target-error". name: empty for a value of a later version, which
// stays a number.
std::string NameOfValue(absl::string_view name, absl::string_view prefix, int value) {
  if (!absl::ConsumePrefix(&name, prefix)) return absl::StrCat(value);
  return absl::StrReplaceAll(absl::AsciiStrToLower(name), {{"_", "-"}});
}

// Null if it is not known, or if nothing is required.
Json MemoryJson(uint64_t bytes) { return bytes > 0 ? Json(bytes) : Json(); }

template <typename Repeated>
std::vector<std::string> Names(const Repeated& names) {
  return {names.begin(), names.end()};
}

Json TimeJson(bool present, const google::protobuf::Timestamp& time) {
  if (!present) return nullptr;
  const absl::Time value = absl::FromUnixSeconds(time.seconds()) + absl::Nanoseconds(time.nanos());
  return absl::FormatTime("%Y-%m-%dT%H:%M:%E3SZ", value, absl::UTCTimeZone());
}

Json SecondsJson(bool present, const google::protobuf::Duration& duration) {
  return present ? Json(Seconds(duration)) : Json();
}

Json ProgressJson(const v1::Progress& progress) {
  return {
      {"sample_count_done", progress.sample_count_done()},
      {"sample_count_total", progress.sample_count_total()},
      {"relative_mse", progress.relative_mse() > 0 ? Json(progress.relative_mse()) : Json()},
      {"nonfinite_count", progress.nonfinite_count()},
      {"ray_count", progress.ray_count()},
      {"cpu_duration_seconds", Seconds(progress.cpu_duration())},
      {"wall_duration_seconds", Seconds(progress.wall_duration())},
      {"remaining_duration_seconds",
       SecondsJson(progress.has_remaining_duration(), progress.remaining_duration())},
      {"remaining_duration_low_seconds",
       SecondsJson(progress.has_remaining_duration_low(), progress.remaining_duration_low())},
      {"remaining_duration_high_seconds",
       SecondsJson(progress.has_remaining_duration_high(), progress.remaining_duration_high())},
      {"remaining_duration_alone_seconds",
       SecondsJson(progress.has_remaining_duration_alone(), progress.remaining_duration_alone())},
  };
}

Json StopJson(const v1::StopRule& rule) {
  return {
      {"target_error", rule.target_error() > 0 ? Json(rule.target_error()) : Json()},
      {"time_max_seconds", rule.has_time_max() ? Json(Seconds(rule.time_max())) : Json()},
      {"cpu_max_seconds", rule.has_cpu_max() ? Json(Seconds(rule.cpu_max())) : Json()},
  };
}

std::string StopReasonName(v1::StopReason reason) {
  return NameOfValue(v1::StopReason_Name(reason), "STOP_REASON_", reason);
}

Json RoundsJson(const v1::Frame& frame) {
  Json json = Json::array();
  for (const v1::Round& round : frame.rounds()) {
    json.push_back({
        {"relative_mse", round.relative_mse()},
        {"relative_mse_upper", round.relative_mse_upper()},
        {"predicted_relative_mse", round.predicted_relative_mse()},
        {"prediction_ratio", round.prediction_ratio()},
        {"sample_count", round.sample_count()},
        {"ray_count", round.ray_count()},
        {"cpu_duration_seconds", Seconds(round.cpu_duration())},
        {"wall_duration_seconds", Seconds(round.wall_duration())},
        {"part_bytes", round.part_bytes()},
    });
  }
  return json;
}

Json LayersJson(const v1::Frame& frame) {
  Json json = Json::array();
  for (const v1::UnreliableLayer& layer : frame.unreliable_layers()) {
    json.push_back({{"layer", layer.layer()}, {"tile_count", layer.tile_count()}});
  }
  return json;
}

// Adds the tasks that are set aside to the JSON of their frame.
void AddTrouble(const v1::FrameTrouble& trouble, Json* frame) {
  Json tasks = Json::array();
  for (const v1::SetAsideTask& task : trouble.set_aside_tasks()) {
    Json failures = Json::array();
    for (const v1::RecordedFailure& failure : task.failures()) {
      failures.push_back({{"kind", failure.kind()},
                          {"worker", failure.worker()},
                          {"count", failure.count()},
                          {"message", failure.message()}});
    }
    tasks.push_back(
        {{"task", task.task()}, {"why", task.why()}, {"failures", std::move(failures)}});
  }
  (*frame)["incomplete"] = trouble.incomplete();
  (*frame)["set_aside_tasks"] = std::move(tasks);
  (*frame)["set_aside_task_count"] = trouble.set_aside_task_count();
}

Json RectJson(const v1::PixelRect& rect) {
  return {{"x0_px", rect.x0_px()},
          {"y0_px", rect.y0_px()},
          {"x1_px", rect.x1_px()},
          {"y1_px", rect.y1_px()}};
}

// The field of this name.
Json SettingJson(const v1::FrameSettings& settings, const char* name) {
  using Field = google::protobuf::FieldDescriptor;
  const Field* const field = settings.GetDescriptor()->FindFieldByName(name);
  const google::protobuf::Reflection& reflection = *settings.GetReflection();
  switch (field->cpp_type()) {
    case Field::CPPTYPE_BOOL:
      return reflection.GetBool(settings, field);
    case Field::CPPTYPE_INT32:
      return reflection.GetInt32(settings, field);
    case Field::CPPTYPE_UINT64:
      return reflection.GetUInt64(settings, field);
    case Field::CPPTYPE_FLOAT:
      return reflection.GetFloat(settings, field);
    case Field::CPPTYPE_STRING:
      return reflection.GetString(settings, field);
    default:
      return RectJson(settings.window());  // The one message among them.
  }
}

// Adds the settings that are shown in this JSON object.
void AddSettings(const v1::FrameSettings& settings, SettingField::Shown shown, Json* json) {
  const FrameSettings names_only;
  VisitFrameSettings(names_only, [&](const SettingField& field, const auto& member) {
    if (field.shown != shown) return;
    if constexpr (std::is_same_v<std::remove_cvref_t<decltype(member)>, TechniqueSet>) {
      const std::optional<TechniqueSet> set = TechniqueSet::FromNumber(settings.techniques());
      (*json)[field.name] = set ? set->Name() : "unknown";
    } else {
      (*json)[field.name] = SettingJson(settings, field.name);
    }
  });
}

Json FrameJson(const v1::Frame& frame) {
  Json json = {
      {"name", frame.name()},
      {"frame_number", frame.spec().frame_number()},
      {"scene_digest", frame.spec().scene().sha256_hex()},
      {"frame_digest", frame.frame_digest()},
  };
  AddSettings(frame.spec().settings(), SettingField::Shown::kWithShape, &json);
  AddSettings(frame.spec().settings(), SettingField::Shown::kWithSettings, &json);
  json.update(Json{
      {"resumed_image",
       frame.spec().has_resumed_image() ? Json(frame.spec().resumed_image().sha256_hex()) : Json()},
      {"stop", StopJson(frame.spec().stop())},
      {"stop_reason", frame.complete() ? StopReasonName(frame.stop_reason()) : ""},
      {"rounds", RoundsJson(frame)},
      {"tile_count", frame.tile_count()},
      {"unreliable_tile_count", frame.unreliable_tile_count()},
      {"unreliable_layers", LayersJson(frame)},
      {"training", frame.training()},
      {"complete", frame.complete()},
      {"waiting_reason", frame.waiting_reason()},
      {"correction_count", frame.correction_count()},
      {"image_digest", frame.image_digest()},
      {"flip", frame.flip() > 0 ? Json(frame.flip()) : Json()},
      {"one_sequence_gain",
       frame.one_sequence_gain() > 0 ? Json(frame.one_sequence_gain()) : Json()},
      {"progress", ProgressJson(frame.progress())},
  });
  return json;
}

}  // namespace

std::string JobStateName(v1::Job::State state) {
  return NameOfValue(v1::Job::State_Name(state), "STATE_", state);
}

std::string WorkerStateName(v1::Worker::State state) {
  return NameOfValue(v1::Worker::State_Name(state), "STATE_", state);
}

std::string JobJson(const v1::Job& job) {
  Json json = {
      {"name", job.name()},
      {"title", job.title()},
      {"owner", job.owner()},
      {"show", job.show()},
      {"pool", job.requirements().pool()},
      {"required_tags", Names(job.requirements().tags())},
      {"memory_min_bytes", MemoryJson(job.requirements().memory_min_bytes())},
      {"memory_expected_bytes", MemoryJson(job.requirements().memory_expected_bytes())},
      {"pilot", job.pilot()},
      {"state", JobStateName(job.state())},
      {"priority", job.priority()},
      {"numeric_profile", job.numeric_profile()},
      {"failure", job.failure()},
      {"waiting_reason", job.waiting_reason()},
      {"warning", job.warning()},
      {"incomplete_frame_count", job.incomplete_frame_count()},
      {"training_frame_count", job.training_frame_count()},
      {"unapproved_frame_count", job.unapproved_frame_count()},
      {"dependencies", Json::array()},
      {"deadline_time", TimeJson(job.has_deadline(), job.deadline().time())},
      {"held", job.held()},
      {"pinned", job.pinned()},
      {"parts_removed_time", TimeJson(job.has_parts_removed_time(), job.parts_removed_time())},
      {"create_time", TimeJson(job.has_create_time(), job.create_time())},
      {"end_time", TimeJson(job.has_end_time(), job.end_time())},
      {"progress", ProgressJson(job.progress())},
      {"effect_costs", Json::array()},
      {"frames", Json::array()},
  };
  for (const v1::JobDependency& dependency : job.dependencies()) {
    json["dependencies"].push_back({{"job_name", dependency.job_name()},
                                    {"by_frame", dependency.by_frame()},
                                    {"state", dependency.state()}});
  }
  for (const v1::EffectCost& effect : job.effect_costs()) {
    json["effect_costs"].push_back({{"name", effect.name()},
                                    {"problem", effect.problem()},
                                    {"ablation", effect.ablation()},
                                    {"time_fraction", effect.time_fraction()},
                                    {"time_fraction_error", effect.time_fraction_error()},
                                    {"mean_change", effect.mean_change()},
                                    {"mean_change_error", effect.mean_change_error()},
                                    {"relative_mse", effect.relative_mse()},
                                    {"variance_ratio", effect.variance_ratio()}});
  }
  std::map<int32_t, const v1::FrameTrouble*> troubles;
  for (const v1::FrameTrouble& trouble : job.troubles()) {
    troubles[trouble.frame_number()] = &trouble;
  }
  for (const v1::Frame& frame : job.frames()) {
    Json of_frame = FrameJson(frame);
    const auto trouble = troubles.find(frame.spec().frame_number());
    AddTrouble(trouble == troubles.end() ? v1::FrameTrouble() : *trouble->second, &of_frame);
    json["frames"].push_back(std::move(of_frame));
  }
  return Dump(json);
}

std::string RefinementPricesJson(const v1::PriceRefinementResponse& response) {
  const auto estimate = [](const v1::Estimate& of) {
    return Json{{"value", of.value()}, {"low", of.low()}, {"high", of.high()}};
  };
  Json prices = Json::array();
  for (const v1::RefinementPrice& price : response.prices()) {
    prices.push_back(
        {{"target_error", price.target_error()},
         {"reached", price.reached()},
         {"relative_mse", estimate(price.relative_mse())},
         {"samples_per_pixel", estimate(price.samples_per_pixel())},
         {"cpu_seconds", estimate(price.cpu_seconds())},
         {"wall_seconds", response.thread_count() > 0 ? estimate(price.wall_seconds()) : Json()}});
  }
  return Dump({{"prices", std::move(prices)},
               {"thread_count", response.thread_count()},
               {"jobs_before_count", response.jobs_before_count()}});
}

std::string WorkerJson(const v1::Worker& worker) {
  return Dump({
      {"name", worker.name()},
      {"identity", worker.identity()},
      {"host", worker.host()},
      {"state", WorkerStateName(worker.state())},
      {"thread_count", worker.thread_count()},
      {"pool", worker.pool()},
      {"tags", Names(worker.tags())},
      {"memory_bytes", MemoryJson(worker.memory_bytes())},
      {"numeric_profile", worker.numeric_profile()},
      {"lease_count", worker.lease_count()},
      {"result_count", worker.result_count()},
      {"samples_per_second", worker.samples_per_second()},
      {"lease_granted_count", worker.lease_granted_count()},
      {"lease_cold_count", worker.lease_cold_count()},
      {"last_seen_time", TimeJson(worker.has_last_seen_time(), worker.last_seen_time())},
      {"reason", worker.reason()},
      {"drained", worker.drained()},
      {"then_exit", worker.then_exit()},
  });
}

std::string ShareJson(const v1::Share& share) {
  return Dump({
      {"subject", share.subject()},
      {"weight", share.weight()},
      {"threads_max", share.threads_max() > 0 ? Json(share.threads_max()) : Json()},
      {"is_set", share.is_set()},
      {"job_count", share.job_count()},
      {"threads_held", share.threads_held()},
  });
}

}  // namespace sheaf::cli
