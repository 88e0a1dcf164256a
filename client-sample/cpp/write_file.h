// Files that are either whole or not there.
#pragma once

#include "protocol/base/result.h"

#include <cstddef>
#include <filesystem>
#include <span>

namespace terrane {

/// Writes beside `path` and renames over it, so that a reader never sees half a file; something
/// that is no regular file (/dev/stdout, a pipe) is written to directly. Fails with `io_error`,
/// leaving nothing behind.
Result<void> write_whole_file(const std::filesystem::path& path, std::span<const std::byte> bytes);

}  // namespace terrane
