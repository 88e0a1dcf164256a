// Triangles to pixels on the processor: a z-buffer, a sun, the light of the sky, haze to the
// horizon.
//
// Everything is drawn at twice the picture's size and averaged, in linear light. Places are
// relative to the eye, so that pictures far from the origin are as sharp as near it.
#pragma once

#include "generator/world/composition.h"
#include "generator/world/world_definition.h"
#include "protocol/base/bytes.h"
#include "protocol/base/result.h"

#include <glm/glm.hpp>

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

namespace terrane {

inline constexpr std::int32_t kPictureSideMax = 8192;

/// sRGB, top row first.
struct Picture {
    std::int32_t width = 0;
    std::int32_t height = 0;
    std::vector<Rgb8> pixels;
};

/// The file's bytes. Fails with `internal` if libpng does.
Result<Bytes> png_of(const Picture& picture);

struct Camera {
    glm::dvec3 eye{};   ///< voxels of the world, y up
    glm::dvec3 look{};  ///< another place
    std::int32_t width = 1280;
    std::int32_t height = 720;
    double field_of_view = 0.96;   ///< radians, of the longer side
    double horizon_voxels = 4096;  ///< where the haze has taken everything
};

struct RasterVertex {
    glm::vec3 from_eye{};  ///< voxels
    glm::vec3 normal{};    ///< of length 1, in world axes
    LinearColor color;
};

/// One picture being drawn. One thread.
class Raster {
  public:
    /// Needs: eye and look apart, sides of 1..kPictureSideMax.
    explicit Raster(const Camera& camera);

    /// Triangles that turn counter-clockwise seen from outside; their backs are not drawn. Indices
    /// must be below vertices.size().
    void draw(std::span<const RasterVertex> vertices, std::span<const std::uint32_t> indices);

    /// The share of the picture that is terrain.
    double covered() const;

    Picture picture() const;

  private:
    /// A corner on the screen: everything but x and y is divided by the distance, as perspective
    /// wants it.
    struct Corner {
        double x = 0;
        double y = 0;
        double nearness = 0;  ///< 1 / depth
        glm::vec3 light{};
    };

    /// A vertex in front of the eye: x right, y up, z ahead.
    struct Seen {
        glm::vec3 place{};
        glm::vec3 light{};
    };

    Seen seen(const RasterVertex& vertex) const;
    Corner corner(const Seen& seen) const;
    void fill(const Corner& a, const Corner& b, const Corner& c);
    glm::vec3 sky(glm::vec3 direction) const;

    Camera camera_;
    std::int32_t width_;  ///< of the buffers: twice the picture's
    std::int32_t height_;
    glm::dvec3 right_{};
    glm::dvec3 up_{};
    glm::dvec3 ahead_{};
    double focal_ = 1;  ///< pixels of the buffers
    std::vector<float> nearness_;
    std::vector<glm::vec3> light_;
};

}  // namespace terrane
