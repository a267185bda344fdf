// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "coordinator/service/server/access_commands.h"

#include <pwd.h>
#include <unistd.h>

#include <cstdio>
#include <memory>
#include <utility>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "absl/time/clock.h"
#include "common/base/surroundings/local_time.h"
#include "common/base/text/shell_quoted.h"
#include "common/command_line/command_line.h"
#include "common/rpc/address.h"
#include "common/tls/credential_store.h"
#include "common/tls/enrolment_token.h"
#include "coordinator/access/access_control.h"
#include "coordinator/service/server/state_privacy.h"

namespace sheaf::coordinator {
namespace {

constexpr int kPagePort = 7480;

absl::StatusOr<std::unique_ptr<AccessControl>> OpenAccess(const std::string& state_directory) {
  if (!AccessControl::Exists(state_directory)) {
    return absl::NotFoundError(
        absl::StrCat(state_directory,
                     ": has no certificate authority; run sheaf-coordinator init "
                     "first, with the same --state-dir"));
  }
  return AccessControl::Open(state_directory);
}

// The user who runs a command, for the audit log: access to the state directory is the permission.
std::string LocalAdministrator() {
  return absl::StrCat("uid ", ::getuid(), " on the coordinator's machine");
}

// The name of the user who runs the command.
std::string PersonName() {
  const passwd* person = ::getpwuid(::getuid());
  const std::string name = person == nullptr ? "" : person->pw_name;
  return CheckIdentityName(name).ok() ? name : "admin";
}

// The lifetime of a token, from --expires.
absl::StatusOr<absl::Duration> ParseLifetime(const std::string& text, absl::Duration longest) {
  absl::Duration lifetime;
  if (absl::ParseDuration(text, &lifetime) && lifetime > absl::ZeroDuration() &&
      lifetime <= longest) {
    return lifetime;
  }
  return absl::InvalidArgumentError(absl::StrCat("--expires ", text, ": is not a time up to ",
                                                 absl::FormatDuration(longest),
                                                 "; write it as 30m or 12h"));
}

std::string LocalTime(absl::Time time) {
  return absl::FormatTime("%Y-%m-%d %H:%M", time, LocalZone());
}

// Enrols the user who runs the command as an administrator, for all addresses of the coordinator.
absl::StatusOr<Identity> EnrolAdministrator(AccessControl* access,
                                            const std::vector<std::string>& hosts, uint16_t port) {
  const absl::Time now = absl::Now();
  const IdentityId id{IdentityKind::kUser, PersonName()};
  const absl::StatusOr<std::string> secret =
      access->identities().MakeToken(id, Role::kAdminister, now, kTokenLifetime);
  if (!secret.ok()) return secret.status();
  Credentials credentials;
  credentials.key_pem = GenerateKey();
  credentials.authority_pem = access->authority().certificate_pem();
  const absl::StatusOr<std::string> request = MakeCertificateRequest(credentials.key_pem);
  if (!request.ok()) return request.status();
  const absl::StatusOr<AccessControl::IssuedCertificate> issued =
      access->Enroll(*secret, *request, LocalAdministrator(), now);
  if (!issued.ok()) return issued.status();
  credentials.certificate_pem = issued->certificate_pem;
  std::vector<std::string> addresses;
  for (const std::string& host : hosts) addresses.push_back(FormatAddress({host, port}));
  const CredentialStore store(CredentialStore::PersonalDirectory());
  const absl::Status stored = store.Put(credentials, addresses).status();
  if (!stored.ok()) return stored;
  return issued->identity;
}

}  // namespace

absl::Status NoStateDirectory() {
  return absl::InvalidArgumentError(
      "--state-dir is needed: neither HOME nor the list of users names a home directory for the "
      "default one");
}

CLI::App* AccessCommands::Add(CLI::App* app, const std::string& name, const std::string& help,
                              std::function<absl::Status()> run) {
  CLI::App* command = app->add_subcommand(name, help);
  command->add_option("--state-dir", state_directory_, "The coordinator's state directory")
      ->capture_default_str();
  commands_.emplace_back(command, std::move(run));
  return command;
}

void AccessCommands::AddIdentity(CLI::App* command) {
  command->add_option("KIND", kind_, "worker or user")
      ->required()
      ->check(IsOneOf({"worker", "user"}));
  command->add_option("NAME", name_, "A name of your choice")->required();
}

void AccessCommands::AddTo(CLI::App* app) {
  app->require_subcommand(0, 1);
  port_ = kCoordinatorPort;
  CLI::App* init = Add(app, "init", "Make certificates, so that other machines may connect",
                       [this] { return Init(); });
  init->add_option("--name", host_names_,
                   "A name or address under which other machines reach the coordinator, besides "
                   "this machine's own; repeat it for more. Run init again to add one")
      ->type_name("HOST")
      ->allow_extra_args(false);
  init->add_option("--port", port_, "gRPC's port, under which sheaf finds your certificate")
      ->check(InRange(1, 65535))
      ->capture_default_str();
  init->footer("Example:\n  sheaf-coordinator init --name farm.example.org");
  CLI::App* enroll = Add(app, "enroll", "Print a token that enrols one machine or user",
                         [this] { return Enroll(); });
  AddIdentity(enroll);
  enroll
      ->add_option("--role", role_,
                   "A user's role: view, submit (default), operate or administer; each includes "
                   "those before it")
      ->check(IsOneOf({"view", "submit", "operate", "administer"}));
  enroll->add_option("--expires", expires_, "How long the token is good, e.g. 30m or 12h")
      ->type_name("DURATION")
      ->capture_default_str();
  enroll->footer(
      "Examples:\n"
      "  sheaf-coordinator enroll worker node7 | ssh node7 'cat > token'\n"
      "  sheaf-coordinator enroll user anna --role operate > token\n"
      "sheaf-worker --token and sheaf login take the token, once.");
  CLI::App* scraper = Add(app, "scraper", "Print a token with which Prometheus reads /metrics",
                          [this] { return MakeScrapeToken(); });
  scraper
      ->add_option("NAME", name_,
                   "A user with the role view; it is created if it does not "
                   "exist")
      ->required();
  scraper
      ->add_option("--expires", scrape_token_expires_,
                   "How long the token is good, e.g. 720h for 30 days")
      ->type_name("DURATION")
      ->capture_default_str();
  scraper->footer(
      "Example:\n"
      "  sheaf-coordinator scraper prometheus > /etc/prometheus/sheaf.token\n"
      "The token reads /metrics and nothing else, until sheaf-coordinator revoke user NAME.");
  CLI::App* revoke =
      Add(app, "revoke", "Refuse a worker or user from now on", [this] { return Revoke(); });
  AddIdentity(revoke);
  revoke->footer("Example:\n  sheaf-coordinator revoke worker node7");
  Add(app, "identities", "List workers, users and their roles",
      [this] { return ListIdentities(); });
}

std::optional<absl::Status> AccessCommands::RunParsed() const {
  for (const auto& [command, run] : commands_) {
    if (!command->parsed()) continue;
    return state_directory_.empty() ? NoStateDirectory() : run();
  }
  return std::nullopt;
}

IdentityId AccessCommands::id() const {
  return {kind_ == "worker" ? IdentityKind::kWorker : IdentityKind::kUser, name_};
}

std::string AccessCommands::StateDirectoryWords() const {
  if (state_directory_ == default_state_directory_) return "";
  return absl::StrCat(" --state-dir ", ShellQuoted(state_directory_));
}

absl::Status AccessCommands::Init() const {
  CloseStateDirectory(state_directory_);
  std::vector<std::string> hosts = HostsOfThisMachine();
  hosts.insert(hosts.end(), host_names_.begin(), host_names_.end());
  const std::string directory = AccessControl::Directory(state_directory_);
  absl::Status created = CertificateAuthority::Create(directory, hosts, absl::Now());
  if (!created.ok()) return created;
  const absl::StatusOr<std::unique_ptr<AccessControl>> access = OpenAccess(state_directory_);
  if (!access.ok()) return access.status();
  const absl::StatusOr<std::vector<std::string>> all = (*access)->authority().Hosts();
  if (!all.ok()) return all.status();
  const absl::StatusOr<Identity> person = EnrolAdministrator(access->get(), *all, port_);
  (*access)->audit().Note(LocalAdministrator(), "init", absl::StrJoin(*all, " "), person.status());
  if (!person.ok()) return person.status();
  const std::string state = StateDirectoryWords();
  std::printf(
      "certificates in %s (keep authority.key secret, and a backup of it)\n"
      "the coordinator is known as: %s\n"
      "%s may %s it from this account\n"
      "next: sheaf-coordinator --listen [::]:%d --http [::]:%d%s, then\n"
      "sheaf-coordinator enroll worker NAME%s for each machine\n",
      directory.c_str(), absl::StrJoin(*all, ", ").c_str(), FormatIdentity(person->id).c_str(),
      RoleName(person->role), port_, kPagePort, state.c_str(), state.c_str());
  return absl::OkStatus();
}

absl::Status AccessCommands::Enroll() const {
  const absl::StatusOr<absl::Duration> lifetime = ParseLifetime(expires_, kTokenLifetimeMax);
  if (!lifetime.ok()) return lifetime.status();
  const absl::StatusOr<std::unique_ptr<AccessControl>> access = OpenAccess(state_directory_);
  if (!access.ok()) return access.status();
  Role role = Role::kWork;
  if (id().kind == IdentityKind::kUser) {
    const absl::StatusOr<std::optional<Identity>> present = (*access)->identities().Find(id());
    if (!present.ok()) return present.status();
    const Role default_role = present->has_value() ? (*present)->role : Role::kSubmit;
    role = UserRoleFromName(role_).value_or(default_role);
  } else if (!role_.empty()) {
    return absl::InvalidArgumentError("--role: workers have no role");
  }
  const absl::Time now = absl::Now();
  const absl::StatusOr<std::string> secret =
      (*access)->identities().MakeToken(id(), role, now, *lifetime);
  (*access)->audit().Note(LocalAdministrator(), absl::StrCat("enroll as ", RoleName(role)),
                          FormatIdentity(id()), secret.status());
  if (!secret.ok()) return secret.status();
  const absl::StatusOr<std::string> token =
      FormatToken({*secret, (*access)->authority().certificate_pem()});
  if (!token.ok()) return token.status();
  std::printf("%s\n", token->c_str());
  std::fprintf(stderr, "sheaf-coordinator: this token enrols %s with the role %s, once, until %s\n",
               FormatIdentity(id()).c_str(), RoleName(role), LocalTime(now + *lifetime).c_str());
  return absl::OkStatus();
}

absl::Status AccessCommands::MakeScrapeToken() const {
  const absl::StatusOr<absl::Duration> lifetime =
      ParseLifetime(scrape_token_expires_, kScrapeTokenLifetimeMax);
  if (!lifetime.ok()) return lifetime.status();
  const absl::StatusOr<std::unique_ptr<AccessControl>> access = OpenAccess(state_directory_);
  if (!access.ok()) return access.status();
  IdentityStore& identities = (*access)->identities();
  const IdentityId user{IdentityKind::kUser, name_};
  const absl::StatusOr<std::optional<Identity>> present = identities.Find(user);
  if (!present.ok()) return present.status();
  if (!present->has_value()) {
    if (absl::Status made = identities.PutIdentity(user, Role::kView); !made.ok()) return made;
  }
  const absl::Time now = absl::Now();
  const absl::StatusOr<std::string> token = identities.MakeScrapeToken(user, now, *lifetime);
  (*access)->audit().Note(LocalAdministrator(), "scraper", FormatIdentity(user), token.status());
  if (!token.ok()) return token.status();
  std::printf("%s\n", token->c_str());
  std::fprintf(stderr, "sheaf-coordinator: this token reads /metrics for %s until %s\n",
               FormatIdentity(user).c_str(), LocalTime(now + *lifetime).c_str());
  return absl::OkStatus();
}

absl::Status AccessCommands::Revoke() const {
  const absl::StatusOr<std::unique_ptr<AccessControl>> access = OpenAccess(state_directory_);
  if (!access.ok()) return access.status();
  absl::Status revoked = (*access)->identities().Revoke(id(), absl::Now());
  (*access)->audit().Note(LocalAdministrator(), "revoke", FormatIdentity(id()), revoked);
  if (revoked.ok()) std::printf("%s is revoked\n", FormatIdentity(id()).c_str());
  return revoked;
}

absl::Status AccessCommands::ListIdentities() const {
  const absl::StatusOr<std::unique_ptr<AccessControl>> access = OpenAccess(state_directory_);
  if (!access.ok()) return access.status();
  const absl::StatusOr<std::vector<Identity>> identities = (*access)->identities().List();
  if (!identities.ok()) return identities.status();
  std::printf("%-48s %-10s %s\n", "IDENTITY", "ROLE", "REVOKED");
  for (const Identity& identity : *identities) {
    std::printf("%-48s %-10s %s\n", FormatIdentity(identity.id).c_str(), RoleName(identity.role),
                identity.revoked() ? LocalTime(identity.revoked_time).c_str() : "-");
  }
  return absl::OkStatus();
}

}  // namespace sheaf::coordinator
