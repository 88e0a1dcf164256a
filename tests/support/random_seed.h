// The seed of random tests: fixed, printed, and replaced by TERRANE_TEST_SEED.
#pragma once

#include <cstdint>
#include <cstdio>
#include <cstdlib>

namespace terrane {

inline std::uint32_t test_seed() {
    const char* text = std::getenv("TERRANE_TEST_SEED");
    const auto seed =
        static_cast<std::uint32_t>(text == nullptr ? 20130612 : std::strtoul(text, nullptr, 10));
    std::printf("TERRANE_TEST_SEED=%u\n", seed);
    return seed;
}

}  // namespace terrane
