// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Writes the page of a study to standard output; reads the study's JSON from standard input. For
// the test of the page and for working on it without rendering.
#include <iostream>
#include <iterator>
#include <string>

#include "cli/study/study_page.h"

int main() {
  const std::string json((std::istreambuf_iterator<char>(std::cin)), {});
  std::cout << sheaf::cli::StudyPage(json);
  return std::cout.flush().good() ? 0 : 1;
}
