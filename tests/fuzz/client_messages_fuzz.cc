// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Feeds arbitrary bytes to a client as the coordinator's answer: a job, a worker or prices. The
// client prints them as JSON.
#include <nlohmann/json.hpp>
#include <string>

#include "cli/job/job_json.h"
#include "tests/fuzz/fuzz_target.h"

namespace sheaf::cli {
namespace {

template <typename Message>
void Print(std::string_view bytes, std::string (*print)(const Message&)) {
  Message message;
  if (!message.ParseFromArray(bytes.data(), static_cast<int>(bytes.size()))) return;
  SHEAF_CHECK(nlohmann::json::accept(print(message)));
}

}  // namespace

// The first byte selects the message.
SHEAF_FUZZ_TARGET(client_messages) {
  switch (testing::TakeByte(&bytes) % 3) {
    case 0:
      return Print<v1::Job>(bytes, &JobJson);
    case 1:
      return Print<v1::Worker>(bytes, &WorkerJson);
    default:
      return Print<v1::PriceRefinementResponse>(bytes, &RefinementPricesJson);
  }
}

}  // namespace sheaf::cli
