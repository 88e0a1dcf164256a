#include "protocol/base/write_file.h"

#include "protocol/base/bytes.h"

#include <gtest/gtest.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>
#include <iterator>
#include <string>

namespace terrane {
namespace {

TEST(WriteFile, WritesTheBytesAndNothingForNone) {
    const std::filesystem::path path = std::filesystem::temp_directory_path() /
                                       ("terrane_write_file_" + std::to_string(::getpid()));
    for (const std::string text : {"some bytes", "", "others"}) {
        // An empty chunk comes as a span without an address.
        const auto written = text.empty() ? write_file(path, {}) : write_file(path, bytes_of(text));
        ASSERT_TRUE(written) << written.error().message;
        std::ifstream in(path, std::ios::binary);
        EXPECT_EQ(std::string(std::istreambuf_iterator<char>(in), {}), text);
    }
    std::filesystem::remove(path);
}

}  // namespace
}  // namespace terrane
