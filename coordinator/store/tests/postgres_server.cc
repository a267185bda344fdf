// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "coordinator/store/tests/postgres_server.h"

#include <fcntl.h>
#include <pwd.h>
#include <signal.h>
#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <cstdlib>
#include <filesystem>
#include <system_error>
#include <utility>

#include "absl/strings/str_cat.h"
#include "absl/time/clock.h"
#include "coordinator/store/database/postgres_connection.h"

namespace sheaf::coordinator {
namespace {

namespace fs = std::filesystem;

constexpr char kInstalled[] = "/usr/lib/postgresql";
constexpr int kStartAttemptsMax = 200;
constexpr absl::Duration kStartInterval = absl::Milliseconds(50);

// The folder of the newest version's programs, or "".
std::string FindPrograms() {
  std::string found;
  std::error_code error;
  for (const auto& version : fs::directory_iterator(kInstalled, error)) {
    const std::string programs = version.path().string() + "/bin";
    if (fs::exists(programs + "/initdb", error)) found = std::max(found, programs);
  }
  return found;
}

// Starts a command whose output goes to a file.
absl::StatusOr<pid_t> Spawn(const std::vector<std::string>& command, const std::string& log) {
  std::vector<char*> arguments;
  for (const std::string& word : command) arguments.push_back(const_cast<char*>(word.c_str()));
  arguments.push_back(nullptr);
  posix_spawn_file_actions_t actions;
  posix_spawn_file_actions_init(&actions);
  posix_spawn_file_actions_addopen(&actions, STDOUT_FILENO, log.c_str(),
                                   O_WRONLY | O_CREAT | O_APPEND, 0644);
  posix_spawn_file_actions_adddup2(&actions, STDOUT_FILENO, STDERR_FILENO);
  pid_t process = -1;
  const int error =
      posix_spawnp(&process, arguments[0], &actions, nullptr, arguments.data(), environ);
  posix_spawn_file_actions_destroy(&actions);
  if (error != 0) return absl::UnavailableError(absl::StrCat("cannot start ", command[0]));
  return process;
}

}  // namespace

absl::StatusOr<std::unique_ptr<PostgresServer>> PostgresServer::Start() {
  const std::string programs = FindPrograms();
  if (programs.empty()) {
    return absl::NotFoundError("PostgreSQL's server is not installed (Debian: postgresql)");
  }
  // Paths of sockets are short, which those of build folders may not be.
  std::string folder = "/tmp/sheaf-postgres-XXXXXX";
  if (::mkdtemp(folder.data()) == nullptr) return absl::UnavailableError("no folder in /tmp");
  std::unique_ptr<PostgresServer> server(new PostgresServer(programs, folder));
  if (::geteuid() == 0) {
    const passwd* user = ::getpwnam("postgres");
    if (user == nullptr || ::chown(folder.c_str(), user->pw_uid, user->pw_gid) != 0) {
      return absl::UnavailableError("there is no user postgres for the server");
    }
  }
  const absl::StatusOr<pid_t> made =
      Spawn(server->AsServerUser({programs + "/initdb", "-D", folder + "/data", "-A", "trust", "-U",
                                  "farm", "--no-locale", "-E", "UTF8", "--no-sync"}),
            folder + "/initdb.log");
  if (!made.ok()) return made.status();
  int code = 0;
  ::waitpid(*made, &code, 0);
  if (code != 0) return absl::UnavailableError("initdb failed");
  if (absl::Status status = server->StartProcess(); !status.ok()) return status;
  return server;
}

PostgresServer::~PostgresServer() {
  End(SIGINT);
  std::error_code ignored;
  fs::remove_all(folder_, ignored);
}

std::vector<std::string> PostgresServer::AsServerUser(std::vector<std::string> command) const {
  std::vector<std::string> words = {"setpriv", "--pdeathsig", "INT"};
  if (::geteuid() == 0) {
    words.insert(words.end(), {"--reuid=postgres", "--regid=postgres", "--clear-groups"});
  }
  words.insert(words.end(), std::make_move_iterator(command.begin()),
               std::make_move_iterator(command.end()));
  return words;
}

absl::Status PostgresServer::StartProcess() {
  // Without fsync: the tests end processes, and not the machine.
  const absl::StatusOr<pid_t> process =
      Spawn(AsServerUser({programs_ + "/postgres", "-D", folder_ + "/data", "-k", folder_, "-c",
                          "listen_addresses=", "-c", "fsync=off", "-c", "shared_buffers=8MB"}),
            folder_ + "/server.log");
  if (!process.ok()) return process.status();
  process_ = *process;
  absl::Status status;
  for (int attempt = 0; attempt < kStartAttemptsMax; ++attempt) {
    status = PostgresConnection::Open(Url(), "").status();
    if (status.ok()) return status;
    absl::SleepFor(kStartInterval);
  }
  return status;
}

void PostgresServer::End(int signal) {
  if (process_ < 0) return;
  ::kill(process_, signal);
  ::waitpid(std::exchange(process_, -1), nullptr, 0);
}

std::string PostgresServer::Url(const std::string& database) const {
  return absl::StrCat("postgresql://farm@/", database, "?host=", folder_);
}

absl::Status PostgresServer::MakeDatabase(const std::string& name) const {
  const auto connection = PostgresConnection::Open(Url(), "");
  if (!connection.ok()) return connection.status();
  for (const std::string& sql : {absl::StrCat("DROP DATABASE IF EXISTS ", name, " WITH (FORCE)"),
                                 absl::StrCat("CREATE DATABASE ", name)}) {
    if (absl::Status status = (*connection)->Run(sql).status(); !status.ok()) return status;
  }
  return absl::OkStatus();
}

absl::Status PostgresServer::CrashAndRestart() {
  End(SIGQUIT);
  return StartProcess();
}

}  // namespace sheaf::coordinator
