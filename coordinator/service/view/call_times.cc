// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "coordinator/service/view/call_times.h"

#include "absl/strings/str_cat.h"

namespace sheaf::coordinator {

Histogram& CallTimes::HistogramOf(const std::string& what, const std::string& code) {
  const MutexLock lock(&mutex_);
  Key key(what, code);
  // The last place is left for "other".
  const bool is_full = histograms_.size() + 1 >= kCallSeriesMax && !histograms_.contains(key);
  if (is_full) key = {"other", "other"};
  std::unique_ptr<Histogram>& histogram = histograms_[key];
  if (histogram == nullptr) histogram = std::make_unique<Histogram>(kCallSecondsBounds);
  return *histogram;
}

void CallTimes::Expect(const std::string& what, const std::string& code) {
  HistogramOf(what, code);
}

void CallTimes::Note(const std::string& what, const std::string& code, absl::Duration duration) {
  HistogramOf(what, code).Add(duration);
}

void CallTimes::AddMetrics(std::vector<MetricView>* metrics) const {
  const MutexLock lock(&mutex_);
  for (const auto& [key, histogram] : histograms_) {
    const Histogram::Counts counts = histogram->Read();
    MetricView metric = {name_, help_, MetricView::Kind::kHistogram, label_, key.first};
    const std::pair<std::string, std::string> code("code", key.second);
    metric.suffix = "_bucket";
    for (size_t i = 0; i < counts.up_to.size(); ++i) {
      const bool is_last = i == histogram->bounds().size();
      metric.more_labels = {code, {"le", is_last ? "+Inf" : absl::StrCat(histogram->bounds()[i])}};
      metric.value = static_cast<double>(counts.up_to[i]);
      metrics->push_back(metric);
    }
    metric.more_labels = {code};
    metric.suffix = "_sum";
    metric.value = counts.sum_seconds;
    metrics->push_back(metric);
    metric.suffix = "_count";
    metric.value = static_cast<double>(counts.up_to.back());
    metrics->push_back(metric);
  }
}

}  // namespace sheaf::coordinator
