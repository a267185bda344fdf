// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// sheaf page: a token with which a browser signs in to the page of a coordinator with certificates.
#include <cstdio>
#include <string>

#include "absl/strings/str_cat.h"
#include "cli/commands/command.h"
#include "cli/commands/options.h"
#include "cli/job/farm_channel.h"
#include "common/rpc/address.h"
#include "common/rpc/address_list.h"
#include "common/rpc/channel.h"
#include "common/rpc/grpc_status.h"
#include "sheaf/v1/access.grpc.pb.h"

namespace sheaf::cli {
namespace {

class PageCommand : public Command {
 public:
  CLI::App* AddTo(CLI::App* app) override {
    CLI::App* command =
        app->add_subcommand("page", "Print the page's address and a token to sign in with, once");
    AddCoordinatorOption(command, &coordinator_);
    command->footer(
        "Example:\n"
        "  sheaf page --coordinator farm.example.org\n"
        "Open the address, and give the form the token within five minutes. Browsers do not know\n"
        "the farm's authority: import its certificate, which sheaf login stored as authority.pem\n"
        "in ~/.config/sheaf/coordinators, or accept the coordinator's.");
    return command;
  }

  ExitCode Run() override {
    const absl::StatusOr<std::shared_ptr<grpc::Channel>> channel = OpenFarmChannel(coordinator_);
    if (!channel.ok()) return ReportCallError(channel.status());
    v1::IssuePageTokenResponse response;
    grpc::ClientContext context;
    SetDeadline(&context, kUnaryDeadline);
    const absl::Status status = FromGrpcStatus(v1::AccessService::NewStub(*channel)->IssuePageToken(
        &context, v1::IssuePageTokenRequest(), &response));
    if (absl::IsUnimplemented(status)) {
      return ReportError(ExitCode::kFailed, absl::FailedPreconditionError(absl::StrCat(
                                                "the coordinator at ", coordinator_.address,
                                                " has no certificates; its page needs no token")));
    }
    if (!status.ok()) return ReportCallError(NoCoordinatorAnswers(coordinator_.address, status));
    const absl::StatusOr<Address> address =
        ParseAddress(AnsweringAddress(coordinator_.address, context.peer()));
    if (!address.ok()) return ReportError(ExitCode::kUsage, address.status());
    const Address page{address->host, static_cast<uint16_t>(response.http_port())};
    std::printf("https://%s/login\n%s\n", FormatAddress(page).c_str(), response.token().c_str());
    return ExitCode::kOk;
  }

 private:
  FarmAddress coordinator_;
};

}  // namespace

std::unique_ptr<Command> MakePageCommand() { return std::make_unique<PageCommand>(); }

}  // namespace sheaf::cli
