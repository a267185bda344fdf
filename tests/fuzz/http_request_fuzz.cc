// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Feeds arbitrary requests to the router and the API behind it: a line of method and target, lines
// of headers, an empty line, and the body. Answers have a status of HTTP, and JSON is valid.
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "absl/strings/str_split.h"
#include "coordinator/service/http/api/http_api.h"
#include "tests/fuzz/fuzz_target.h"
#include "tests/support/farm/http_fake_farm.h"

namespace sheaf::coordinator {
namespace {

HttpRequest RequestOf(std::string_view bytes) {
  HttpRequest request;
  const std::string text(bytes);
  const std::pair<std::string, std::string> parts =
      absl::StrSplit(text, absl::MaxSplits("\n\n", 1));
  const std::vector<std::string> lines = absl::StrSplit(parts.first, '\n');
  const std::pair<std::string, std::string> first =
      absl::StrSplit(lines[0], absl::MaxSplits(' ', 1));
  request.method = first.first;
  request.target = first.second;
  for (size_t i = 1; i < lines.size(); ++i) {
    const std::pair<std::string, std::string> header =
        absl::StrSplit(lines[i], absl::MaxSplits(": ", 1));
    request.headers.push_back(header);
  }
  request.body = parts.second;
  return request;
}

struct ServedFarm {
  ServedFarm() : api(farm, Actions(), "run"), router(api.Routes(), {"farm.example"}) {
    farm.jobs = {MakeFakeJob("2"), MakeFakeJob("1")};
    farm.preview.version = 3;
    farm.preview.image = MakeFakeImage(4, 2, 0.5f);
  }
  static FarmActions Actions() {
    FarmActions actions;
    actions.change_job = [](JobVerb verb, const std::string&, const JobArguments& arguments) {
      const Refinement& refinement = arguments.refinement;
      SHEAF_CHECK(verb != JobVerb::kRefineJob ||
                  (refinement.samples > 0 && refinement.stop.target_error >= 0));
      return absl::OkStatus();
    };
    actions.drain_worker = [](const std::string&, bool) { return absl::OkStatus(); };
    actions.list_usage = [](const UsageQuery&) -> absl::StatusOr<UsageReport> {
      return UsageReport();
    };
    actions.collect_garbage = [](bool) -> absl::StatusOr<std::vector<RemovalView>> {
      return std::vector<RemovalView>{{"blob", "", "no job names it", 1, 1}};
    };
    return actions;
  }

  FakeFarm farm;
  HttpApi api;
  HttpRouter router;
};

}  // namespace

SHEAF_FUZZ_TARGET(http_request) {
  static const ServedFarm* const served = new ServedFarm;
  const HttpResponse response = served->router.Route(RequestOf(bytes));
  SHEAF_CHECK(response.status >= 200 && response.status < 600);
  if (response.content_type == "application/json") {
    SHEAF_CHECK(nlohmann::json::accept(response.body));
  }
}

}  // namespace sheaf::coordinator
