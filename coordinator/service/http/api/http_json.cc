// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "coordinator/service/http/api/http_json.h"

#include <nlohmann/json.hpp>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"

namespace sheaf::coordinator {
namespace {

using Json = nlohmann::ordered_json;

// User-supplied text may not be valid UTF-8; it is shown with replacement characters.
std::string Dump(const Json& json) {
  return json.dump(-1, ' ', false, Json::error_handler_t::replace);
}

}  // namespace

std::string NameJson(const std::string& name) { return Dump({{"name", name}}); }

std::string MetricJson(const MetricView& metric) {
  return Dump({
      {"name", metric.name},
      {"help", metric.help},
      {"kind", metric.kind == MetricView::Kind::kCounter ? "counter" : "gauge"},
      {"label_name", metric.label_name},
      {"label_value", metric.label_value},
      {"value", metric.value},
  });
}

std::string HealthJson() { return Dump(Json::object({{"healthy", true}})); }

std::string ReadyJson(const std::vector<ReadyCondition>& conditions) {
  bool is_ready = true;
  Json list = Json::array();
  for (const auto& [name, status] : conditions) {
    is_ready &= status.ok();
    list.push_back(
        {{"name", name}, {"ok", status.ok()}, {"reason", std::string(status.message())}});
  }
  return Dump({{"ready", is_ready}, {"conditions", std::move(list)}});
}

std::string UsageJson(const UsageReport& report) {
  Json rows = Json::array();
  for (const UsageSum& sum : report.sums) {
    const Usage& usage = sum.usage;
    rows.push_back({{"day", sum.day ? Json(FormatUsageDay(*sum.day)) : Json()},
                    {"user", sum.user},
                    {"show", sum.show},
                    {"job", sum.job},
                    {"result_count", usage.result_count},
                    {"sample_count", usage.sample_count},
                    {"ray_count", usage.ray_count},
                    {"cpu_seconds", absl::ToDoubleSeconds(usage.cpu_duration)},
                    {"repeated_count", usage.repeated_count},
                    {"repeated_cpu_seconds", absl::ToDoubleSeconds(usage.repeated_cpu_duration)},
                    {"lost_count", usage.lost_count},
                    {"lost_cpu_seconds", absl::ToDoubleSeconds(usage.lost_cpu_duration)},
                    {"upload_bytes", usage.upload_bytes},
                    {"part_bytes", usage.part_bytes},
                    {"image_bytes", usage.image_bytes}});
  }
  Json stored = Json::array();
  for (const StoredView& view : report.stored) {
    const bool has_limit = view.bytes_max != UINT64_MAX;
    stored.push_back({{"user", view.user},
                      {"total_bytes", view.bytes.Total()},
                      {"bytes_max", has_limit ? Json(view.bytes_max) : Json()},
                      {"part_bytes", view.bytes.part_bytes},
                      {"image_bytes", view.bytes.image_bytes},
                      {"preview_bytes", view.bytes.preview_bytes},
                      {"content_bytes", view.bytes.content_bytes}});
  }
  return Dump({{"usage", std::move(rows)}, {"stored", std::move(stored)}});
}

std::string ListJson(const std::string& key, const std::vector<std::string>& objects,
                     const std::string& next_page_token) {
  return absl::StrCat("{\"", key, "\":[", absl::StrJoin(objects, ","),
                      "],\"next_page_token\":", Dump(next_page_token), "}");
}

std::string SessionJson(const Caller& caller) {
  const std::string user = caller.identity ? caller.identity->id.name : "";
  return Dump({{"user", user}, {"role", caller.identity ? RoleName(caller.identity->role) : ""}});
}

}  // namespace sheaf::coordinator
