// Files that are whole or not there.
#pragma once

#include "protocol/base/result.h"

#include <cstddef>
#include <filesystem>
#include <span>

namespace terrane {

/// Writes aside and renames, so that nobody ever sees half a file and an older one survives a
/// failure. What is no regular file (a pipe, /dev/stdout) is written as it is. Fails with
/// `io_error`.
Result<void> write_file(const std::filesystem::path& path, std::span<const std::byte> bytes);

}  // namespace terrane
