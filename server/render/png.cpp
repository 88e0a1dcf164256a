#include "server/render/png.h"

#include "generator/world/world_definition.h"
#include "protocol/base/bytes.h"
#include "protocol/base/check.h"
#include "protocol/base/result.h"

#include <png.h>

#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

namespace terrane {

Result<Image> make_image(std::int64_t width, std::int64_t height) {
    TERRANE_ASSERT(width > 0 && height > 0);
    if (width > kImageSideMax || height > kImageSideMax || width * height > kImagePixelsMax) {
        return fail(ErrorCode::too_large,
                    "a picture of " + std::to_string(width) + " x " + std::to_string(height) +
                        " pixels is too large: at most " + std::to_string(kImageSideMax) +
                        " a side and " + std::to_string(kImagePixelsMax) + " in all");
    }
    return Image{.width = static_cast<std::int32_t>(width),
                 .height = static_cast<std::int32_t>(height),
                 .pixels = std::vector<Rgb8>(static_cast<std::size_t>(width * height))};
}

Result<Bytes> encode_png(const Image& image) {
    static_assert(sizeof(Rgb8) == 3);
    png_image head{};
    head.version = PNG_IMAGE_VERSION;
    head.width = static_cast<png_uint_32>(image.width);
    head.height = static_cast<png_uint_32>(image.height);
    head.format = PNG_FORMAT_RGB;
    Bytes bytes(PNG_IMAGE_PNG_SIZE_MAX(head));
    png_alloc_size_t size_bytes = bytes.size();
    if (png_image_write_to_memory(&head, bytes.data(), &size_bytes, 0, image.pixels.data(), 0,
                                  nullptr) == 0) {
        return fail(ErrorCode::internal, std::string("png: ") + head.message);
    }
    bytes.resize(size_bytes);
    return bytes;
}

}  // namespace terrane
