// A folder that is gone when the test is.
#pragma once

#include "protocol/base/check.h"

#include <stdlib.h>

#include <filesystem>
#include <string>
#include <system_error>

namespace terrane {

class TemporaryFolder {
  public:
    TemporaryFolder() {
        std::string name = (std::filesystem::temp_directory_path() / "terrane-XXXXXX").string();
        TERRANE_ASSERT(mkdtemp(name.data()) != nullptr);
        path_ = name;
    }

    ~TemporaryFolder() {
        std::error_code ignored;
        std::filesystem::remove_all(path_, ignored);
    }

    TemporaryFolder(const TemporaryFolder&) = delete;
    TemporaryFolder& operator=(const TemporaryFolder&) = delete;

    const std::filesystem::path& path() const { return path_; }

  private:
    std::filesystem::path path_;
};

}  // namespace terrane
