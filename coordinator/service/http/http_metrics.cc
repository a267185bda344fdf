// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// HELP and TYPE once per name, then one line per value, with the escapes of the format.
#include "coordinator/service/http/http_metrics.h"

#include <cmath>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "absl/strings/str_replace.h"

namespace sheaf::coordinator {
namespace {

std::string ValueText(double value) {
  if (std::isnan(value)) return "NaN";
  if (std::isinf(value)) return value > 0 ? "+Inf" : "-Inf";
  return absl::StrFormat("%.17g", value);
}

std::string LabelText(const MetricView& metric) {
  if (metric.label_name.empty()) return "";
  return absl::StrCat(
      "{", metric.label_name, "=\"",
      absl::StrReplaceAll(metric.label_value, {{"\\", "\\\\"}, {"\"", "\\\""}, {"\n", "\\n"}}),
      "\"}");
}

}  // namespace

std::string PrometheusText(const std::vector<MetricView>& metrics) {
  std::string text;
  std::string name;
  for (const MetricView& metric : metrics) {
    if (metric.name != name) {
      name = metric.name;
      const bool counter = metric.kind == MetricView::Kind::kCounter;
      absl::StrAppend(&text, "# HELP ", name, " ",
                      absl::StrReplaceAll(metric.help, {{"\\", "\\\\"}, {"\n", "\\n"}}),
                      "\n# TYPE ", name, counter ? " counter\n" : " gauge\n");
    }
    absl::StrAppend(&text, name, LabelText(metric), " ", ValueText(metric.value), "\n");
  }
  return text;
}

}  // namespace sheaf::coordinator
