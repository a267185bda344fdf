// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// sheaf share: shows and sets how users, shows and pools share the farm.
#include <cstdint>
#include <cstdio>
#include <optional>
#include <string>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "cli/commands/farm_command.h"
#include "cli/job/job_json.h"
#include "cli/message.h"
#include "common/base/printable.h"
#include "common/command_line/command_line.h"
#include "coordinator/core/job/share_setting.h"

namespace sheaf::cli {
namespace {

class ShareCommand : public FarmCommand {
 public:
  CLI::App* AddTo(CLI::App* app) override {
    CLI::App* command =
        AddCommon(app, "share", "Show or set how users, shows and pools share the farm");
    command->add_option("ACTION", action_, "list, set or reset")
        ->required()
        ->check(IsOneOf({"list", "set", "reset"}));
    command->add_option("SUBJECT", subject_, "user:NAME, show:NAME or pool:NAME; not with list")
        ->check(CLI::Validator(
            [](const std::string& text) {
              const absl::Status status = coordinator::ParseShareSubject(text).status();
              return status.ok() ? std::string() : std::string(status.message());
            },
            ""));
    command
        ->add_option("--weight", weight_,
                     "Its share beside users of the same show, or beside other shows, relative to "
                     "their weights; others have 1")
        ->check(InRange(coordinator::kShareWeightMin, coordinator::kShareWeightMax));
    command
        ->add_option("--threads-max", threads_max_, "Threads that it may hold at once; 0: no limit")
        ->check(InRange(0, coordinator::kShareThreadsMax));
    command->footer(
        "Examples:\n"
        "  sheaf share list\n"
        "  sheaf share set user:anna --weight 2 --threads-max 64\n"
        "  sheaf share set pool:licensed --threads-max 16\n"
        "  sheaf share reset show:comet\n"
        "Settings apply from the next lease on and survive restarts; open leases beyond a "
        "limit\nfinish. set and reset need the role operate. docs/scheduling.md explains shares.");
    return command;
  }

 protected:
  ExitCode RunWith(FarmClient* client) override {
    if (action_ == "list") {
      if (!subject_.empty() || weight_ || threads_max_) {
        return Misused("list takes no SUBJECT, --weight or --threads-max");
      }
      return List(client);
    }
    if (subject_.empty()) return Misused(action_ + " needs a SUBJECT, as in user:anna");
    if (action_ == "set") return Set(client);
    if (weight_ || threads_max_) return Misused("reset takes no --weight or --threads-max");
    if (absl::Status status = client->ResetShare(subject_); !status.ok()) {
      return ReportCallError(status);
    }
    if (!json()) std::printf("%s no longer has settings\n", subject_.c_str());
    return ExitCode::kOk;
  }

 private:
  static ExitCode Misused(const std::string& why) {
    return ReportError(ExitCode::kUsage, absl::InvalidArgumentError("sheaf share: " + why));
  }

  ExitCode Set(FarmClient* client) const {
    if (!weight_ && !threads_max_) return Misused("set needs --weight or --threads-max");
    v1::SetShareRequest request;
    request.set_subject(subject_);
    if (weight_) request.set_weight(*weight_);
    if (threads_max_) request.set_threads_max(*threads_max_);
    const absl::StatusOr<v1::Share> share = client->SetShare(request);
    if (!share.ok()) return ReportCallError(share.status());
    if (json()) {
      std::printf("%s\n", ShareJson(*share).c_str());
    } else {
      std::printf("%s weight %g, %s\n", share->subject().c_str(), share->weight(),
                  LimitText(*share).c_str());
    }
    return ExitCode::kOk;
  }

  ExitCode List(FarmClient* client) const {
    const absl::StatusOr<std::vector<v1::Share>> shares = client->ListShares();
    if (!shares.ok()) return ReportCallError(shares.status());
    if (!json()) {
      std::printf("%-32s %8s %12s %8s %8s\n", "SUBJECT", "WEIGHT", "THREADS-MAX", "THREADS",
                  "JOBS");
    }
    for (const v1::Share& share : *shares) {
      if (json()) {
        std::printf("%s\n", ShareJson(share).c_str());
        continue;
      }
      std::printf("%-32s %8g %12s %8lld %8d\n", Printable(share.subject()).c_str(), share.weight(),
                  share.threads_max() > 0 ? absl::StrCat(share.threads_max()).c_str() : "-",
                  static_cast<long long>(share.threads_held()), share.job_count());
    }
    return ExitCode::kOk;
  }

  static std::string LimitText(const v1::Share& share) {
    return share.threads_max() > 0 ? absl::StrCat("at most ", share.threads_max(), " threads")
                                   : "no limit of threads";
  }

  std::string action_, subject_;
  std::optional<double> weight_;
  std::optional<int32_t> threads_max_;
};

}  // namespace

std::unique_ptr<Command> MakeShareCommand() { return std::make_unique<ShareCommand>(); }

}  // namespace sheaf::cli
