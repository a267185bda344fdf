// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Serves the embedded files. Browsers revalidate files that they have, and get 304.
#include "coordinator/service/http/server/http_page.h"

#include "absl/strings/str_cat.h"

namespace sheaf::coordinator {
namespace {

HttpResponse ServeFile(const PageFile& file, const HttpRequest& request) {
  const std::string etag = absl::StrCat("\"", std::string(file.digest.substr(0, 32)), "\"");
  HttpResponse response;
  response.headers = {{"ETag", etag}, {"Cache-Control", "no-cache"}};
  if (HeaderValue(request, "If-None-Match") == etag) {
    response.status = 304;
    return response;
  }
  response.content_type = std::string(file.content_type);
  response.body = std::string(file.bytes);
  return response;
}

}  // namespace

std::vector<HttpRoute> PageRoutes() {
  std::vector<HttpRoute> routes;
  for (const PageFile& file : PageFiles()) {
    const HttpFunction serve = [&file](const HttpRequest& request) {
      return ServeFile(file, request);
    };
    routes.push_back({"GET", absl::StrCat("/", std::string(file.name)), serve});
    if (file.name == "index.html") routes.push_back({"GET", "/", serve});
  }
  return routes;
}

}  // namespace sheaf::coordinator
