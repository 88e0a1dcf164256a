#include "server/render/draw_pieces.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <atomic>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <new>
#include <thread>
#include <vector>

namespace terrane {
namespace {

TEST(DrawPieces, DrawsEachOnceAndTellsOfSome) {
    for (const std::int32_t threads : {1, 3, 8}) {
        std::vector<std::atomic<int>> drawn(100);
        std::atomic<std::uint64_t> most = 0;
        std::atomic<int> begun = 0;
        const auto result = draw_pieces(
            100, threads,
            [&](std::uint64_t done, std::uint64_t total) {
                EXPECT_EQ(total, 100U);
                most = std::max(most.load(), done);
            },
            [&]() -> DrawPiece {
                ++begun;
                return [&](std::int32_t piece) -> Result<void> {
                    ++drawn[static_cast<std::size_t>(piece)];
                    return {};
                };
            });
        ASSERT_TRUE(result);
        for (const auto& times : drawn) {
            EXPECT_EQ(times, 1);
        }
        EXPECT_EQ(begun, threads);
        EXPECT_GT(most, 0U);
        EXPECT_LE(most, 100U);
    }
}

TEST(DrawPieces, EndsWithTheFirstFailure) {
    std::atomic<int> drawn = 0;
    const auto result = draw_pieces(1'000'000, 2, {}, [&]() -> DrawPiece {
        return [&](std::int32_t piece) -> Result<void> {
            ++drawn;
            if (piece == 10) {
                return fail(ErrorCode::too_large, "piece ten");
            }
            if (piece > 10) {  // time for the failure to be noticed
                std::this_thread::sleep_for(std::chrono::microseconds(100));
            }
            return {};
        };
    });
    ASSERT_FALSE(result);
    EXPECT_EQ(result.error().message, "piece ten");
    EXPECT_LT(drawn, 1'000'000);
}

TEST(DrawPieces, TurnsWhatIsThrownIntoAFailure) {
    const auto in_a_piece = draw_pieces(4, 2, {}, []() -> DrawPiece {
        return [](std::int32_t) -> Result<void> { throw std::bad_alloc(); };
    });
    ASSERT_FALSE(in_a_piece);
    EXPECT_EQ(in_a_piece.error().code, ErrorCode::internal);
    const auto before = draw_pieces(4, 2, {}, []() -> DrawPiece { throw std::bad_alloc(); });
    ASSERT_FALSE(before);
}

}  // namespace
}  // namespace terrane
