// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// HELP and TYPE once per name, then one line per value, with the escapes of the format.
#include "coordinator/service/http/api/http_metrics.h"

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

const char* KindText(MetricView::Kind kind) {
  switch (kind) {
    case MetricView::Kind::kCounter:
      return "counter";
    case MetricView::Kind::kGauge:
      return "gauge";
    case MetricView::Kind::kHistogram:
      return "histogram";
  }
  return "untyped";
}

std::string LabelText(const MetricView& metric) {
  if (metric.label_name.empty()) return "";
  std::string text;
  const auto add = [&text](const std::string& name, const std::string& value) {
    absl::StrAppend(&text, text.empty() ? "{" : ",", name, "=\"",
                    absl::StrReplaceAll(value, {{"\\", "\\\\"}, {"\"", "\\\""}, {"\n", "\\n"}}),
                    "\"");
  };
  add(metric.label_name, metric.label_value);
  for (const auto& [name, value] : metric.more_labels) add(name, value);
  return text + "}";
}

}  // namespace

std::string PrometheusText(const std::vector<MetricView>& metrics) {
  std::string text;
  std::string name;
  for (const MetricView& metric : metrics) {
    if (metric.name != name) {
      name = metric.name;
      absl::StrAppend(&text, "# HELP ", name, " ",
                      absl::StrReplaceAll(metric.help, {{"\\", "\\\\"}, {"\n", "\\n"}}),
                      "\n# TYPE ", name, " ", KindText(metric.kind), "\n");
    }
    absl::StrAppend(&text, name, metric.suffix, LabelText(metric), " ", ValueText(metric.value),
                    "\n");
  }
  return text;
}

}  // namespace sheaf::coordinator
