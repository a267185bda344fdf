// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Sessions and roles of the HTTP port, for each of its routes, and HTTPS on a real socket.
#include "coordinator/service/http/server/http_access.h"

#include <boost/asio/connect.hpp>
#include <boost/asio/ip/tcp.hpp>
#include <boost/asio/read.hpp>
#include <boost/asio/ssl.hpp>
#include <boost/asio/write.hpp>
#include <filesystem>
#include <set>

#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_replace.h"
#include "absl/time/clock.h"
#include "common/base/file.h"
#include "coordinator/service/http/http_service.h"
#include "coordinator/service/http/server/http_server.h"
#include "gmock/gmock.h"
#include "gtest/gtest.h"
#include "tests/support/farm/http_fake_farm.h"

namespace sheaf::coordinator {
namespace {

using ::testing::HasSubstr;
using ::testing::StartsWith;

const IdentityId kAnna{IdentityKind::kUser, "anna"};
const IdentityId kBen{IdentityKind::kUser, "ben"};

class HttpAccessTest : public ::testing::Test {
 protected:
  HttpAccessTest()
      : directory_(::testing::TempDir() + "sheaf-http-access-" +
                   ::testing::UnitTest::GetInstance()->current_test_info()->name()) {
    std::filesystem::remove_all(directory_);
    const absl::Status created = CertificateAuthority::Create(
        AccessControl::Directory(directory_), {"localhost", "127.0.0.1"}, absl::Now());
    EXPECT_TRUE(created.ok()) << created;
    auto access = AccessControl::Open(directory_);
    EXPECT_TRUE(access.ok()) << access.status();
    access_ = *std::move(access);
    farm_.jobs = {MakeFakeJob("1"), MakeFakeJob("2")};
    farm_.jobs[0].owner = "anna";
    farm_.jobs[1].owner = "ben";
    HttpServiceOptions options;
    options.access = access_.get();
    options.server.tls = access_->authority().server_files();
    auto service = HttpService::Start(options, farm_, Actions());
    EXPECT_TRUE(service.ok()) << service.status();
    service_ = *std::move(service);
  }
  ~HttpAccessTest() override {
    service_.reset();
    access_.reset();
    std::filesystem::remove_all(directory_);
  }

  FarmActions Actions() {
    const auto act = [this](const std::string&) {
      ++actions_;
      return absl::OkStatus();
    };
    FarmActions actions;
    actions.change_job = [act](JobVerb, const std::string& id, const JobArguments&) {
      return act(id);
    };
    actions.drain_worker = [act](const std::string& id, bool) { return act(id); };
    actions.read_pixel = [](const std::string&, int32_t, int32_t,
                            int32_t) -> absl::StatusOr<PixelView> { return PixelView(); };
    actions.list_usage = [this](const UsageQuery& query) -> absl::StatusOr<UsageReport> {
      usage_owner_ = query.owner;
      return UsageReport();
    };
    actions.collect_garbage = [act](bool) -> absl::StatusOr<std::vector<RemovalView>> {
      if (absl::Status done = act(""); !done.ok()) return done;
      return std::vector<RemovalView>();
    };
    return actions;
  }
  std::string PageToken(const IdentityId& id, Role role) {
    EXPECT_TRUE(access_->identities().PutIdentity(id, role).ok());
    return access_->IssuePageToken(Caller{**access_->identities().Find(id)}, absl::Now());
  }
  HttpResponse Send(const std::string& method, const std::string& target,
                    const std::string& session = "", const std::string& body = "") {
    HttpRequest request;
    request.method = method;
    request.target = target;
    request.peer = "192.0.2.7";
    request.headers = {{"Host", "localhost"}};
    if (target != "/login") request.headers.emplace_back("X-Sheaf-Request", "1");
    if (!session.empty()) {
      request.headers.emplace_back("Cookie",
                                   absl::StrCat("other=1; ", kSessionCookie, "=", session));
    }
    request.body = body;
    return service_->router().Route(std::move(request));
  }
  static std::string Header(const HttpResponse& response, const std::string& name) {
    for (const auto& [key, value] : response.headers) {
      if (key == name) return value;
    }
    return "";
  }
  // The session's secret in the cookie that signing in sets; "" if it sets none.
  static std::string SessionOf(const HttpResponse& response) {
    const std::string cookie = Header(response, "Set-Cookie");
    const size_t begin = cookie.find('=') + 1;
    return cookie.empty() ? "" : cookie.substr(begin, cookie.find(';') - begin);
  }
  std::string SignIn(const IdentityId& id, Role role) {
    return SessionOf(Send("POST", "/login", "", "token=" + PageToken(id, role)));
  }
  std::string Audit() const { return ReadWholeFile(directory_ + "/audit.log").value_or(""); }
  // All routes, with the events, which the server itself answers.
  std::set<std::string> Routes() const {
    std::set<std::string> routes = {"GET /api/v1/events"};
    for (const HttpRoute& route : service_->router().routes()) {
      routes.insert(absl::StrCat(route.method, " ", route.pattern));
    }
    return routes;
  }

  const std::string directory_;
  FakeFarm farm_;
  int actions_ = 0;
  std::string usage_owner_ = "no query";  // Owner of the last query.
  std::unique_ptr<AccessControl> access_;
  std::unique_ptr<HttpService> service_;
};

TEST_F(HttpAccessTest, AccountsAreOnesOwnBelowTheRoleOperate) {
  const std::string anna = SignIn(kAnna, Role::kSubmit);
  EXPECT_EQ(Send("GET", "/api/v1/usage", anna).status, 200);
  EXPECT_EQ(usage_owner_, "anna");
  const std::string ben = SignIn(kBen, Role::kOperate);
  EXPECT_EQ(Send("GET", "/api/v1/usage", ben).status, 200);
  EXPECT_EQ(usage_owner_, "") << "everybody's";
}

TEST_F(HttpAccessTest, RefusalsAreCountedByReason) {
  Send("GET", "/api/v1/jobs", "a made-up session");
  Send("POST", "/api/v1/gc", SignIn(kAnna, Role::kView));
  const auto refused = access_->RefusedByReason();
  EXPECT_EQ(refused[static_cast<size_t>(RefusalReason::kCertificate)], 1u);
  EXPECT_EQ(refused[static_cast<size_t>(RefusalReason::kRole)], 1u);
  EXPECT_EQ(refused[static_cast<size_t>(RefusalReason::kLimit)], 0u);
}

TEST_F(HttpAccessTest, TheRoleTableNamesEachRoute) {
  std::set<std::string> named;
  for (const OperationRule& rule : RoleTable()) {
    if (rule.operation[0] != '/') named.insert(rule.operation);
  }
  EXPECT_EQ(named, Routes());
}

TEST_F(HttpAccessTest, EachRouteIsOpenByTheTableAlone) {
  const std::pair<std::optional<Role>, std::string> sessions[] = {
      {std::nullopt, ""},
      {std::nullopt, "a made-up session"},
      {Role::kView, SignIn({IdentityKind::kUser, "vera"}, Role::kView)},
      {Role::kSubmit, SignIn({IdentityKind::kUser, "sam"}, Role::kSubmit)},
      {Role::kOperate, SignIn({IdentityKind::kUser, "olga"}, Role::kOperate)},
      {Role::kAdminister, SignIn({IdentityKind::kUser, "adam"}, Role::kAdminister)}};
  for (const auto& [role, session] : sessions) {
    for (const std::string& route : Routes()) {
      const std::string method = route.substr(0, route.find(' '));
      if (route == "GET /api/v1/events" || route == "POST /logout") continue;  // Tested below.
      std::string path = absl::StrReplaceAll(route.substr(method.size() + 1), {{"{}", "1"}});
      if (absl::EndsWith(path, ":priority")) path += "?value=3";
      if (absl::EndsWith(path, ":refine")) path += "?samples=32";
      if (absl::EndsWith(path, ":kill")) path += "?frame=1";
      const int status = Send(method, path, session, "token=none").status;
      const bool to_login = status == 303 && method == "GET";
      const bool permitted = Permits(*RequirementOf(route), role);
      // The job is anna's: sam may control jobs, but not hers.
      const bool others = method == "POST" && role == Role::kSubmit && path != "/login" &&
                          !absl::StartsWith(path, "/api/v1/submissions");
      EXPECT_EQ(status == 401 || status == 403 || to_login, !permitted || others)
          << (role ? RoleName(*role) : "no role") << " " << route << ": " << status;
    }
  }
  EXPECT_THAT(Audit(), HasSubstr("GET /api/v1/jobs needs a session"));
  EXPECT_THAT(Audit(), HasSubstr("user:vera at 192.0.2.7"));
}

TEST_F(HttpAccessTest, SigningInSetsACookieThatScriptsAndOtherSitesDoNotGet) {
  const HttpResponse response =
      Send("POST", "/login", "", "token=" + PageToken(kAnna, Role::kView));
  EXPECT_EQ(response.status, 303);
  EXPECT_EQ(Header(response, "Location"), "/");
  const std::string cookie = Header(response, "Set-Cookie");
  EXPECT_THAT(cookie, StartsWith("__Host-"));
  for (const char* attribute :
       {"; Path=/", "; Secure", "; HttpOnly", "; SameSite=Strict", "; Max-Age=43200"}) {
    EXPECT_THAT(cookie, HasSubstr(attribute));
  }
  EXPECT_EQ(Send("GET", "/api/v1/jobs", SessionOf(response)).status, 200);
}

TEST_F(HttpAccessTest, APageTokenIsGoodOnce) {
  const std::string body = "token=" + PageToken(kAnna, Role::kView);
  EXPECT_NE(SessionOf(Send("POST", "/login", "", body)), "");
  const HttpResponse again = Send("POST", "/login", "", body);
  EXPECT_EQ(SessionOf(again), "");
  EXPECT_EQ(Header(again, "Location"), "/login#refused");
  EXPECT_THAT(Audit(), HasSubstr("the page's token is unknown, used or expired"));
}

TEST_F(HttpAccessTest, AnotherSiteSignsNobodyIn) {
  HttpRequest request;
  request.method = "POST";
  request.target = "/login";
  request.headers = {{"Host", "localhost"}, {"Origin", "https://evil.example"}};
  request.body = "token=" + PageToken(kAnna, Role::kView);
  EXPECT_EQ(service_->router().Route(request).status, 403);
}

TEST_F(HttpAccessTest, ASessionEndsWithItsUser) {
  const std::string session = SignIn(kAnna, Role::kView);
  EXPECT_EQ(Send("GET", "/api/v1/jobs", session).status, 200);
  ASSERT_TRUE(access_->identities().Revoke(kAnna, absl::Now()).ok());
  EXPECT_EQ(Send("GET", "/api/v1/jobs", session).status, 401);
  EXPECT_EQ(Header(Send("GET", "/", session), "Location"), "/login");
  ASSERT_TRUE(access_->identities().PutIdentity(kAnna, Role::kView).ok());
  EXPECT_EQ(Send("GET", "/api/v1/jobs", session).status, 401) << "of an earlier enrolment";
}

TEST_F(HttpAccessTest, SigningOutEndsTheSession) {
  const std::string session = SignIn(kAnna, Role::kView);
  HttpRequest from_elsewhere;
  from_elsewhere.method = "POST";
  from_elsewhere.target = "/logout";
  from_elsewhere.headers = {{"Host", "localhost"},
                            {"Cookie", absl::StrCat(kSessionCookie, "=", session)}};
  EXPECT_EQ(service_->router().Route(from_elsewhere).status, 403);
  EXPECT_EQ(Send("GET", "/api/v1/jobs", session).status, 200);
  EXPECT_THAT(Header(Send("POST", "/logout", session), "Set-Cookie"), HasSubstr("Max-Age=0"));
  EXPECT_THAT(Audit(), HasSubstr("\"what\":\"sign out\""));
  EXPECT_EQ(Send("GET", "/api/v1/jobs", session).status, 401);
}

TEST_F(HttpAccessTest, AScrapeTokenReadsMetricsAndNothingElse) {
  ASSERT_TRUE(access_->identities().PutIdentity(kAnna, Role::kAdminister).ok());
  const std::string token =
      *access_->identities().MakeScrapeToken(kAnna, absl::Now(), absl::Hours(1));
  const auto send = [&](const std::string& method, const std::string& target,
                        const std::string& authorization) {
    HttpRequest request;
    request.method = method;
    request.target = target;
    request.peer = "192.0.2.7";
    request.headers = {
        {"Host", "localhost"}, {"X-Sheaf-Request", "1"}, {"authorization", authorization}};
    return service_->router().Route(std::move(request)).status;
  };
  EXPECT_EQ(send("GET", "/metrics", "Bearer " + token), 200);
  EXPECT_EQ(send("GET", "/metrics", "bearer  " + token), 200);
  EXPECT_EQ(send("GET", "/metrics", "Bearer " + token + "x"), 401);
  EXPECT_EQ(send("GET", "/metrics", "Bearer "), 401);
  EXPECT_EQ(send("GET", "/metrics", "Basic " + token), 401);
  EXPECT_EQ(send("GET", "/api/v1/jobs", "Bearer " + token), 403) << "whatever anna may do";
  EXPECT_EQ(send("POST", "/api/v1/jobs/1:cancel", "Bearer " + token), 403);
  EXPECT_THAT(Audit(), HasSubstr("a scrape token of user:anna reads /metrics and nothing else"));
  ASSERT_TRUE(access_->identities().Revoke(kAnna, absl::Now()).ok());
  EXPECT_EQ(send("GET", "/metrics", "Bearer " + token), 401);
  ASSERT_TRUE(access_->identities().PutIdentity(kAnna, Role::kView).ok());
  EXPECT_EQ(send("GET", "/metrics", "Bearer " + token), 401) << "of an earlier enrolment";
}

TEST_F(HttpAccessTest, ThePageLearnsWhoIsSignedIn) {
  EXPECT_EQ(Send("GET", "/api/v1/session", SignIn(kAnna, Role::kView)).body,
            "{\"user\":\"anna\",\"role\":\"view\"}\n");
}

TEST_F(HttpAccessTest, SubmittersControlTheirOwnJobs) {
  const std::string anna = SignIn(kAnna, Role::kSubmit);
  EXPECT_EQ(Send("POST", "/api/v1/jobs/1:cancel", anna).status, 200);
  EXPECT_EQ(actions_, 1);
  EXPECT_EQ(Send("POST", "/api/v1/jobs/2:cancel", anna).status, 403);
  EXPECT_EQ(actions_, 1);
  EXPECT_THAT(Audit(), HasSubstr("the job belongs to ben"));
  EXPECT_THAT(Audit(), HasSubstr("POST /api/v1/jobs/{}:cancel"));
}

TEST_F(HttpAccessTest, StrangersAreRefusedForATimeAndOthersServed) {
  const std::string session = SignIn(kAnna, Role::kView);
  int requests = 0;
  HttpResponse response;
  do {
    response = Send("GET", "/login");
  } while (response.status == 200 && ++requests < 1000);
  EXPECT_EQ(response.status, 429);
  EXPECT_THAT(response.body, HasSubstr("192.0.2.7"));
  EXPECT_GE(requests, 100);
  EXPECT_EQ(Send("POST", "/login", "", "token=guess").status, 429) << "guesses are limited too";
  EXPECT_THAT(Audit(), HasSubstr("RESOURCE_EXHAUSTED"));
  const HttpResponse metrics = Send("GET", "/metrics", session);
  EXPECT_EQ(metrics.status, 200) << "who is signed in is not held up";
  EXPECT_THAT(metrics.body, HasSubstr("sheaf_refused_total{limit=\"stranger_calls\"} 2\n"));
  EXPECT_THAT(metrics.body, HasSubstr("sheaf_refused_total{limit=\"calls\"} 0\n"));
  for (const std::string name : {"authority", "server"}) {
    EXPECT_THAT(metrics.body,
                ::testing::ContainsRegex("sheaf_certificate_expiry_time_seconds.certificate=\"" +
                                         name + "\". [1-9]"));
  }
}

// A TLS client that trusts the farm's authority.
class TlsClient {
 public:
  TlsClient(const std::string& authority_path, uint16_t port)
      : context_(boost::asio::ssl::context::tls_client), stream_(io_, context_) {
    context_.load_verify_file(authority_path, error_);
    stream_.set_verify_mode(boost::asio::ssl::verify_peer, error_);
    stream_.set_verify_callback(boost::asio::ssl::host_name_verification("localhost"), error_);
    stream_.lowest_layer().connect({boost::asio::ip::address_v4::loopback(), port}, error_);
    if (!error_) stream_.handshake(boost::asio::ssl::stream_base::client, error_);
  }
  bool connected() const { return !error_; }
  // The answer to a request, to the end of the connection.
  std::string Send(const std::string& text) {
    boost::asio::write(stream_, boost::asio::buffer(text), error_);
    std::string answer;
    boost::asio::read(stream_, boost::asio::dynamic_buffer(answer), error_);
    return answer;
  }
  std::string ReadUntil(const std::string& text, const std::string& end) {
    boost::asio::write(stream_, boost::asio::buffer(text), error_);
    std::string answer;
    char bytes[4096];
    while (!error_ && answer.find(end) == std::string::npos) {
      answer.append(bytes, stream_.read_some(boost::asio::buffer(bytes), error_));
    }
    return answer;
  }

 private:
  boost::asio::io_context io_;
  boost::asio::ssl::context context_;
  boost::asio::ssl::stream<boost::asio::ip::tcp::socket> stream_;
  boost::system::error_code error_;
};

TEST_F(HttpAccessTest, ServesHttpsUnderTheFarmsAuthority) {
  EXPECT_THAT(service_->Url(), StartsWith("https://"));
  TlsClient client(access_->authority().server_files().authority_path, service_->port());
  ASSERT_TRUE(client.connected());
  const std::string answer =
      client.Send("GET /healthz HTTP/1.1\r\nHost: localhost\r\nConnection: close\r\n\r\n");
  EXPECT_THAT(answer, StartsWith("HTTP/1.1 200 OK\r\n"));
  EXPECT_THAT(answer, ::testing::EndsWith("{\"healthy\":true}\n"));
}

TEST_F(HttpAccessTest, EventsNeedASessionAndEndWithIt) {
  const std::string authority = access_->authority().server_files().authority_path;
  const std::string events = "GET /api/v1/events HTTP/1.1\r\nHost: localhost\r\n";
  TlsClient nobody(authority, service_->port());
  EXPECT_THAT(nobody.ReadUntil(events + "\r\n", "}}"), StartsWith("HTTP/1.1 401 "));
  TlsClient anna(authority, service_->port());
  const std::string session = SignIn(kAnna, Role::kView);
  EXPECT_THAT(
      anna.ReadUntil(absl::StrCat(events, "Cookie: ", kSessionCookie, "=", session, "\r\n\r\n"),
                     "retry: 2000\n\n"),
      StartsWith("HTTP/1.1 200 OK"));
  ASSERT_TRUE(access_->identities().Revoke(kAnna, absl::Now()).ok());
  farm_.Update([](FakeFarm& farm) { farm.jobs[0].title = "changed"; });
  EXPECT_EQ(anna.Send("").find("changed"), std::string::npos);
}

TEST_F(HttpAccessTest, HalfOpenHandshakesDoNotBlockOthers) {
  boost::asio::io_context io;
  std::vector<boost::asio::ip::tcp::socket> half_open;
  for (int i = 0; i < 300; ++i) {
    boost::system::error_code error;
    half_open.emplace_back(io).connect({boost::asio::ip::address_v4::loopback(), service_->port()},
                                       error);
    if (i % 2 == 0) boost::asio::write(half_open.back(), boost::asio::buffer("\x16\x03"), error);
  }
  const absl::Time start = absl::Now();
  TlsClient client(access_->authority().server_files().authority_path, service_->port());
  EXPECT_TRUE(client.connected());
  EXPECT_LT(absl::Now() - start, absl::FromChrono(kHttpHandshakeTimeout)) << "they still wait";
}

}  // namespace
}  // namespace sheaf::coordinator
