// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// PostgresServer: a PostgreSQL server for tests, in a new folder, which the test program starts and
// of which it is the parent. It listens on a socket of that folder alone and ends with the program.
// Programs of root run it as another user, because the server refuses to be root.
#pragma once

#include <sys/types.h>

#include <memory>
#include <string>
#include <vector>

#include "absl/status/statusor.h"

namespace sheaf::coordinator {

class PostgresServer {
 public:
  // Errors: kNotFound: its programs are not installed (Debian's package postgresql); kUnavailable.
  static absl::StatusOr<std::unique_ptr<PostgresServer>> Start();
  ~PostgresServer();
  PostgresServer(const PostgresServer&) = delete;
  PostgresServer& operator=(const PostgresServer&) = delete;

  // The address of a database; "postgres" exists from the start.
  std::string Url(const std::string& database = "postgres") const;
  // Makes an empty database, in place of one of this name.
  absl::Status MakeDatabase(const std::string& name) const;
  // Ends it as a crash does, and starts it again.
  absl::Status CrashAndRestart();

 private:
  PostgresServer(std::string programs, std::string folder)
      : programs_(std::move(programs)), folder_(std::move(folder)) {}
  absl::Status StartProcess();
  void End(int signal);
  std::vector<std::string> AsServerUser(std::vector<std::string> command) const;

  const std::string programs_, folder_;
  pid_t process_ = -1;
};

}  // namespace sheaf::coordinator
