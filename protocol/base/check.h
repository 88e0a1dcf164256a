// Assertions for broken invariants of our own; never for input.
#pragma once

namespace terrane {

/// Prints what failed and where, then aborts. Any thread.
[[noreturn]] void assertion_failed(const char* condition, const char* file, int line);

}  // namespace terrane

/// On in every build.
#define TERRANE_ASSERT(condition) \
    ((condition) ? void() : ::terrane::assertion_failed(#condition, __FILE__, __LINE__))

/// For inner loops: on in builds without NDEBUG.
#ifdef NDEBUG
#define TERRANE_DEBUG_ASSERT(condition) void()
#else
#define TERRANE_DEBUG_ASSERT(condition) TERRANE_ASSERT(condition)
#endif
