// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// The subcommands of sheaf-coordinator that manage access to a farm: init, enroll, scraper, revoke
// and identities. They work on the state directory, also while the coordinator runs, so access to
// that directory permits them.
#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "absl/status/status.h"
#include "absl/time/time.h"
#include "common/command_line/command_line.h"
#include "coordinator/access/identity.h"

namespace sheaf::coordinator {

// The error of a program without --state-dir if the user has no home directory.
absl::Status NoStateDirectory();

class AccessCommands {
 public:
  explicit AccessCommands(std::string state_directory)
      : state_directory_(state_directory), default_state_directory_(std::move(state_directory)) {}
  // Adds the subcommands. Requires: this outlives app.
  void AddTo(CLI::App* app);
  // Runs the subcommand that was parsed; none if there was none.
  std::optional<absl::Status> RunParsed() const;

 private:
  // Adds a subcommand with --state-dir.
  CLI::App* Add(CLI::App* app, const std::string& name, const std::string& help,
                std::function<absl::Status()> run);
  void AddIdentity(CLI::App* command);

  absl::Status Init() const;
  absl::Status Enroll() const;
  absl::Status MakeScrapeToken() const;
  absl::Status Revoke() const;
  absl::Status ListIdentities() const;
  IdentityId id() const;
  // " --state-dir DIR", for suggested commands on this state directory; empty for the default one.
  std::string StateDirectoryWords() const;

  std::string state_directory_;
  const std::string default_state_directory_;
  std::vector<std::string> host_names_;
  uint16_t port_ = 0;
  std::string kind_, name_, role_;
  std::string expires_ = "1h", scrape_token_expires_ = "8760h";
  std::vector<std::pair<CLI::App*, std::function<absl::Status()>>> commands_;
};

}  // namespace sheaf::coordinator
