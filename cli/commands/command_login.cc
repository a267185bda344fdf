// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// sheaf login: exchanges an enrolment token for a certificate, with which all other commands then
// call the coordinator.
#include <cstdio>
#include <string>

#include "absl/strings/str_cat.h"
#include "absl/time/time.h"
#include "cli/commands/command.h"
#include "cli/message.h"
#include "common/rpc/address.h"
#include "common/rpc/enrolment.h"

namespace sheaf::cli {
namespace {

class LoginCommand : public Command {
 public:
  CLI::App* AddTo(CLI::App* app) override {
    CLI::App* command =
        app->add_subcommand("login", "Log in to a coordinator on another machine, once");
    command->add_option("ADDRESS", coordinator_, "Address of the coordinator, HOST:PORT or HOST")
        ->required()
        ->transform(CLI::Validator(CompleteCoordinatorAddress, ""));
    command
        ->add_option("--token-file", token_file_,
                     "File with the token that sheaf-coordinator enroll user NAME printed; -: "
                     "standard input")
        ->envname("SHEAF_TOKEN_FILE")
        ->type_name("FILE")
        ->capture_default_str();
    command->footer(
        "Example:\n"
        "  sheaf login farm.example.org --token-file token\n"
        "The key is made on this machine and stays here. Commands renew the certificate; after\n"
        "some days without any, log in again.");
    return command;
  }

  ExitCode Run() override {
    const absl::StatusOr<EnrolmentToken> token = ReadTokenFile(token_file_);
    if (absl::IsInvalidArgument(token.status())) {
      return ReportError(ExitCode::kUsage, token.status());
    }
    if (!token.ok()) return ReportError(ExitCode::kFile, token.status());
    const absl::StatusOr<Enrolment> enrolled =
        Enroll(coordinator_, *token, CredentialStore(CredentialStore::PersonalDirectory()));
    if (!enrolled.ok()) return ReportCallError(enrolled.status());
    std::printf("%s logged in to %s with the role %s\n", enrolled->identity.c_str(),
                coordinator_.c_str(), enrolled->role.c_str());
    return ExitCode::kOk;
  }

 private:
  std::string coordinator_;
  std::string token_file_ = "-";
};

}  // namespace

std::unique_ptr<Command> MakeLoginCommand() { return std::make_unique<LoginCommand>(); }

}  // namespace sheaf::cli
