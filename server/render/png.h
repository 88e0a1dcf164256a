// Pictures as PNG files.
#pragma once

#include "generator/world/world_definition.h"
#include "protocol/base/bytes.h"
#include "protocol/base/result.h"

#include <cstddef>
#include <cstdint>
#include <vector>

namespace terrane {

/// What is the most for a picture's sides and for its area: 2^25 pixels are 100 MB in memory.
inline constexpr std::int64_t kImageSideMax = 65500;
inline constexpr std::int64_t kImagePixelsMax = std::int64_t{1} << 25;

/// sRGB, top row first.
struct Image {
    std::int32_t width = 0;
    std::int32_t height = 0;
    std::vector<Rgb8> pixels;  ///< width * height

    Rgb8& at(std::int32_t x, std::int32_t y) {
        return pixels[static_cast<std::size_t>(y) * static_cast<std::size_t>(width) +
                      static_cast<std::size_t>(x)];
    }
};

/// Black. Fails with `too_large` beyond the limits above. Needs sides of at least 1.
Result<Image> make_image(std::int64_t width, std::int64_t height);

/// The file's bytes. Fails with `internal` if libpng does.
Result<Bytes> encode_png(const Image& image);

}  // namespace terrane
