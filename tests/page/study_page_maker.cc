// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Reads a study's JSON from standard input and writes its page to standard output. For the test of
// the page and for its development without rendering.
#include <iostream>
#include <iterator>
#include <string>

#include "cli/study/study_page.h"

int main() {
  const std::string json((std::istreambuf_iterator<char>(std::cin)), {});
  std::cout << sheaf::cli::StudyPage(json);
  return std::cout.flush().good() ? 0 : 1;
}
