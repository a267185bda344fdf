// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "coordinator/service/grpc/call_timer.h"

#include <grpcpp/support/server_interceptor.h>

#include <memory>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "absl/status/status.h"
#include "common/base/steady_time.h"
#include "common/rpc/protocol_calls.h"
#include "coordinator/access/role_table.h"

namespace sheaf::coordinator {
namespace {

namespace experimental = grpc::experimental;

// "WorkerService/Synchronize" of "/sheaf.v1.WorkerService/Synchronize". Unknown methods must not
// become labels.
std::string NameOf(const char* method) {
  if (method == nullptr || !RequirementOf(method)) return "other";
  const std::string_view text(method);
  const size_t slash = text.rfind('/');
  const size_t dot = text.rfind('.', slash);
  return std::string(dot == std::string_view::npos ? text.substr(1) : text.substr(dot + 1));
}

// Exists as long as a call.
class CallTimer final : public experimental::Interceptor {
 public:
  CallTimer(CallTimes* times, std::string name) : times_(times), name_(std::move(name)) {}
  ~CallTimer() override {
    if (!is_noted_) Note(absl::StatusCode::kCancelled);  // The client did not wait for its status.
  }
  CallTimer(const CallTimer&) = delete;
  CallTimer& operator=(const CallTimer&) = delete;

  void Intercept(experimental::InterceptorBatchMethods* methods) override {
    if (methods->QueryInterceptionHookPoint(
            experimental::InterceptionHookPoints::PRE_SEND_STATUS)) {
      Note(static_cast<absl::StatusCode>(methods->GetSendStatus().error_code()));
    }
    methods->Proceed();
  }

 private:
  void Note(absl::StatusCode code) {
    is_noted_ = true;
    times_->Note(name_, absl::StatusCodeToString(code), SteadyTime::Now() - begin_);
  }

  CallTimes* const times_;
  const std::string name_;
  const SteadyTime begin_ = SteadyTime::Now();
  bool is_noted_ = false;
};

class CallTimerFactory final : public experimental::ServerInterceptorFactoryInterface {
 public:
  explicit CallTimerFactory(CallTimes* times) : times_(times) {}
  experimental::Interceptor* CreateServerInterceptor(experimental::ServerRpcInfo* info) override {
    return new CallTimer(times_, NameOf(info->method()));
  }

 private:
  CallTimes* const times_;
};

}  // namespace

void TimeCalls(CallTimes* times, grpc::ServerBuilder* builder) {
  std::vector<std::unique_ptr<experimental::ServerInterceptorFactoryInterface>> factories;
  factories.push_back(std::make_unique<CallTimerFactory>(times));
  factories.push_back(ProtocolOfServer());  // gRPC takes all interceptors at once.
  builder->experimental().SetInterceptorCreators(std::move(factories));
}

}  // namespace sheaf::coordinator
