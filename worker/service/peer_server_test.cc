// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// A worker serves its blobs over mutual TLS to workers of its farm, within limits of number and
// speed, and to no other client.
#include "worker/service/peer_server.h"

#include <grpcpp/client_context.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <string>
#include <utility>

#include "absl/strings/str_cat.h"
#include "absl/time/clock.h"
#include "common/base/check.h"
#include "common/base/file.h"
#include "common/content/chunk_codec.h"
#include "common/rpc/channel.h"
#include "common/rpc/peer_credentials.h"
#include "common/rpc/tls_credentials.h"
#include "common/tls/certificate.h"

namespace sheaf::worker {
namespace {

// A farm's authority, and those whom it has enrolled.
class Authority {
 public:
  explicit Authority(std::string folder) : folder_(std::move(folder)) {
    issuer_.key_pem = GenerateKey();
    CertificateTerms terms = Terms("an authority", CertificateUse::kAuthority);
    const auto certificate = MakeAuthorityCertificate(terms, issuer_.key_pem);
    SHEAF_CHECK(certificate.ok());
    issuer_.certificate_pem = *certificate;
    SHEAF_CHECK(MakeDirectories(folder_).ok());
  }
  CredentialFiles Enrol(const std::string& name) const {
    const std::string key = GenerateKey();
    const auto request = MakeCertificateRequest(key);
    SHEAF_CHECK(request.ok());
    const auto certificate =
        IssueCertificate(Terms(name, CertificateUse::kClient), *request, issuer_);
    SHEAF_CHECK(certificate.ok());
    const std::string base = absl::StrCat(folder_, "/", name);
    const CredentialFiles files{base + ".key", base + ".pem", base + ".authority"};
    SHEAF_CHECK(WriteFileOnce(files.key_path, key).ok());
    SHEAF_CHECK(WriteFileOnce(files.certificate_path, *certificate).ok());
    SHEAF_CHECK(WriteFileOnce(files.authority_path, issuer_.certificate_pem).ok());
    return files;
  }
  const std::string& certificate_pem() const { return issuer_.certificate_pem; }

 private:
  static CertificateTerms Terms(const std::string& name, CertificateUse use) {
    CertificateTerms terms;
    terms.use = use;
    terms.common_name = name;
    terms.generation = 1;
    terms.not_before = absl::Now() - absl::Hours(1);
    terms.not_after = absl::Now() + absl::Hours(1);
    return terms;
  }
  const std::string folder_;
  Issuer issuer_;
};

class PeerServerTest : public ::testing::Test {
 protected:
  PeerServerTest() {
    std::filesystem::remove_all(folder_);
    auto blobs = BlobStore::Open(folder_ + "/blobs");
    SHEAF_CHECK(blobs.ok());
    blobs_ = *std::move(blobs);
    blob_ = *blobs_->Put(std::string(3 << 20, 'x'));
    options_.enabled = true;
  }
  ~PeerServerTest() override { std::filesystem::remove_all(folder_); }
  void Start() {
    auto server = PeerServer::Start(options_, blobs_.get());
    ASSERT_TRUE(server.ok()) << server.status();
    server_ = *std::move(server);
  }
  std::shared_ptr<grpc::Channel> Channel(
      const std::shared_ptr<grpc::ChannelCredentials>& credentials = nullptr) {
    return MakeChannel(absl::StrCat("127.0.0.1:", server_->port()), credentials);
  }
  std::shared_ptr<grpc::Channel> ChannelOf(const CredentialFiles& files,
                                           const std::string& expected) {
    return Channel(*PeerChannelCredentials(files, expected));
  }
  // The number of bytes that came, or -1 at an error.
  static int64_t Read(const std::shared_ptr<grpc::Channel>& channel, const BlobDigest& blob) {
    grpc::ClientContext context;
    SetDeadline(&context, absl::Seconds(5));
    v1::ReadBlobRequest request;
    request.mutable_digest()->set_sha256_hex(blob.sha256_hex);
    request.mutable_digest()->set_size_bytes(blob.size_bytes);
    const auto reader = v1::PeerService::NewStub(channel)->ReadPeerBlob(&context, request);
    int64_t count = 0;
    v1::ReadBlobResponse response;
    while (reader->Read(&response)) {
      const auto bytes = DecompressChunk(response.zstd_chunk(), kBlobChunkBytesMax);
      count += bytes.ok() ? static_cast<int64_t>(bytes->size()) : 0;
    }
    return reader->Finish().ok() ? count : -1;
  }
  int64_t Size() const { return static_cast<int64_t>(blob_.size_bytes); }

  const std::string folder_ = ::testing::TempDir() + "/peer_server";
  std::unique_ptr<BlobStore> blobs_;
  BlobDigest blob_;
  PeerOptions options_;
  std::unique_ptr<PeerServer> server_;
};

TEST_F(PeerServerTest, ServesWorkersOfItsFarmAlone) {
  const Authority farm(folder_ + "/farm"), other(folder_ + "/other");
  options_.files = farm.Enrol("worker:one");
  Start();
  const CredentialFiles two = farm.Enrol("worker:two");
  EXPECT_EQ(Read(ChannelOf(two, "worker:one"), blob_), Size());
  EXPECT_EQ(Read(ChannelOf(two, "worker:three"), blob_), -1) << "it is another worker";
  EXPECT_EQ(Read(ChannelOf(farm.Enrol("user:anna"), "worker:one"), blob_), -1);
  EXPECT_EQ(Read(ChannelOf(other.Enrol("worker:two"), "worker:one"), blob_), -1);
  EXPECT_EQ(Read(Channel(UnverifiedTlsCredentials()), blob_), -1) << "without a certificate";
  EXPECT_EQ(Read(Channel(), blob_), -1) << "in plain text";
  EXPECT_EQ(server_->served_bytes(), blob_.size_bytes);
}

TEST_F(PeerServerTest, AUserIsNoPeer) {
  const Authority farm(folder_ + "/farm");
  options_.files =
      farm.Enrol("user:anna");  // A user's certificate serves wrong bytes under a name.
  Start();
  EXPECT_EQ(Read(ChannelOf(farm.Enrol("worker:two"), "user:anna"), blob_), -1);
}

TEST_F(PeerServerTest, BlobsThatItDoesNotHoldAreRefused) {
  Start();
  EXPECT_EQ(Read(Channel(), blob_), Size());
  EXPECT_EQ(Read(Channel(), {std::string(64, 'a'), 5}), -1);
  EXPECT_EQ(Read(Channel(), {"../../secret", 5}), -1);
}

TEST_F(PeerServerTest, TheRateHasALimit) {
  options_.bytes_per_second_max = 8 << 20;
  Start();
  const absl::Time begin = absl::Now();
  EXPECT_EQ(Read(Channel(), blob_), Size());
  EXPECT_GE(absl::Now() - begin, absl::Milliseconds(200)) << "the third MiB waits 250 ms";
}

}  // namespace
}  // namespace sheaf::worker
