// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "coordinator/service/http/api/http_operations.h"

#include <algorithm>
#include <utility>

#include "absl/strings/str_cat.h"
#include "absl/time/clock.h"
#include "coordinator/service/http/api/http_api.h"
#include "coordinator/service/http/api/http_json.h"

namespace sheaf::coordinator {

HttpResponse UsageResponse(const FarmActions& actions, const HttpRequest& request) {
  const std::string daily = QueryValue(request, "daily");
  const std::string format = QueryValue(request, "format");
  if (!daily.empty() && daily != "0" && daily != "1") {
    return HttpErrorFromStatus(
        absl::InvalidArgumentError(absl::StrCat("daily \"", daily, "\" is neither 0 nor 1")));
  }
  if (!format.empty() && format != "json" && format != "csv") {
    return HttpErrorFromStatus(absl::InvalidArgumentError(
        absl::StrCat("format \"", format, "\" is neither json nor csv")));
  }
  absl::StatusOr<UsageQuery> query =
      ParseUsageQuery(QueryValue(request, "by"), QueryValue(request, "since"),
                      QueryValue(request, "until"), daily == "1");
  if (!query.ok()) return HttpErrorFromStatus(query.status());
  query->owner = AccessControl::UsageOwnerOf(request.caller);
  const absl::StatusOr<UsageReport> report = actions.list_usage(*query);
  if (!report.ok()) return HttpErrorFromStatus(report.status());
  if (format != "csv") return JsonResponse(UsageJson(*report));
  HttpResponse response;
  response.content_type = "text/csv; charset=utf-8";
  response.headers = {{"Cache-Control", "no-store"},
                      {"Content-Disposition", "attachment; filename=\"sheaf-usage.csv\""}};
  response.body = UsageCsv(report->sums);
  return response;
}

std::vector<ReadyCondition> ConditionsOf(const FarmView& farm, const HttpAccess* access) {
  std::vector<ReadyCondition> conditions = farm.Conditions();
  if (access != nullptr) {
    conditions.push_back({"certificate", access->CheckCertificates(absl::Now())});
  }
  return conditions;
}

HttpResponse ReadyResponse(const std::vector<ReadyCondition>& conditions) {
  const bool is_ready =
      std::all_of(conditions.begin(), conditions.end(),
                  [](const ReadyCondition& condition) { return condition.status.ok(); });
  HttpResponse response = JsonResponse(ReadyJson(conditions));
  response.status = is_ready ? 200 : 503;
  return response;
}

std::vector<MetricView> MetricsOf(const FarmView& farm, const HttpAccess* access,
                                  const ServerMetrics* server) {
  std::vector<MetricView> metrics = farm.Metrics();
  for (const ReadyCondition& condition : ConditionsOf(farm, access)) {
    metrics.push_back({"sheaf_ready", "Whether a condition for accepting work holds: 1 or 0.",
                       MetricView::Kind::kGauge, "condition", condition.name,
                       condition.status.ok() ? 1.0 : 0.0});
  }
  const auto append = [&metrics](std::vector<MetricView> more) {
    for (MetricView& metric : more) metrics.push_back(std::move(metric));
  };
  if (server != nullptr) append(server->List());
  if (access != nullptr) append(access->Metrics());
  return metrics;
}

}  // namespace sheaf::coordinator
