#include "generator/terrain/generate_stack.h"

#include "generator/landscape/landscape.h"
#include "generator/terrain/column_writer.h"
#include "generator/terrain/kernels/kernel_choice.h"
#include "generator/terrain/kernels/row_kernels.h"
#include "generator/terrain/plot_cache.h"
#include "generator/terrain/region.h"
#include "generator/terrain/world.h"
#include "generator/volume/stack.h"
#include "protocol/base/coords.h"
#include "protocol/base/result.h"

#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

namespace terrane {

struct StackGenerator::Buffers {
    explicit Buffers(const World& world) : constants(world) {
        if (world.definition.has_landscape()) {
            landscape.emplace(world);
        }
    }

    TerrainConstants constants;
    PlotCache plots;
    Region region;
    std::vector<std::uint16_t> element_ids;
    std::vector<std::uint32_t> element_limits;
    std::optional<Landscape> landscape;  ///< of worlds that have one
};

namespace {

Result<void> check_range(const ColumnRectangle& rectangle) {
    const auto inside = [step = rectangle.step()](std::int64_t first, std::int32_t count) {
        return first - step > -kColumnCoordinateLimit &&
               first + count * step < kColumnCoordinateLimit;
    };
    if (!inside(rectangle.x0, rectangle.width) || !inside(rectangle.z0, rectangle.length)) {
        return fail(ErrorCode::out_of_range, "column (" + std::to_string(rectangle.x0) + ", " +
                                                 std::to_string(rectangle.z0) +
                                                 ") is beyond the world's edge at 2^53");
    }
    return {};
}

/// Ids are 16 bits, and the last one says "none" while columns are written. Only coarse levels of
/// dense worlds come here: World::build bounds level 0.
Result<void> check_elements(const Region& region, const World& world) {
    static constexpr std::size_t kPaletteIdsMax = 65534;
    const std::size_t ids = region.elements.size() + world.base_palette.size();
    if (ids > kPaletteIdsMax) {
        return fail(ErrorCode::too_large, "layers, veins and caves here are " +
                                              std::to_string(ids) + ", at most " +
                                              std::to_string(kPaletteIdsMax) + " are possible");
    }
    return {};
}

}  // namespace

StackGenerator::StackGenerator(const World& world) : StackGenerator(world, chosen_row_kernels()) {}

StackGenerator::StackGenerator(const World& world, const RowKernels& kernels)
    : world_(&world), kernels_(&kernels), buffers_(std::make_unique<Buffers>(world)) {}

StackGenerator::~StackGenerator() = default;
StackGenerator::StackGenerator(StackGenerator&&) noexcept = default;
StackGenerator& StackGenerator::operator=(StackGenerator&&) noexcept = default;

Result<void> StackGenerator::build(const ColumnRectangle& rectangle) {
    Buffers& buffers = *buffers_;
    if (buffers.landscape) {
        begin_region(buffers.region, *world_, rectangle, Landscape::kApron, buffers.plots,
                     *kernels_);
        buffers.landscape->build(buffers.region, buffers.constants, buffers.plots, *kernels_);
    } else {
        build_region(buffers.region, *world_, buffers.constants, rectangle, buffers.plots,
                     *kernels_);
    }
    return check_elements(buffers.region, *world_);
}

void StackGenerator::write(const ColumnWriterOutput& out, std::int32_t apron) {
    Buffers& buffers = *buffers_;
    if (buffers.landscape) {
        buffers.landscape->write(out, buffers.region, buffers.constants, apron);
    } else {
        write_columns(out, buffers.region, *world_, buffers.constants, apron, *kernels_);
    }
}

Result<void> StackGenerator::generate(Stack& out, StackPos position) {
    if (position.lod < 0 || position.lod > kLodMax) {
        return fail(ErrorCode::unsupported, "level of detail " + std::to_string(position.lod) +
                                                ": there are 0 to " + std::to_string(kLodMax));
    }
    const std::int32_t side = world_->definition.grid.side;
    const ColumnPos first = first_column_of(position, side);
    const ColumnRectangle rectangle{
        .x0 = first.x, .z0 = first.z, .width = side, .length = side, .lod = position.lod};
    if (auto checked = check_range(rectangle); !checked) {
        return checked;
    }
    if (auto built = build(rectangle); !built) {
        return built;
    }
    out.position = position;
    out.side = side;
    write({.grid = out.columns,
           .palette = out.palette,
           .highest_y256 = out.highest_y256,
           .element_ids = buffers_->element_ids,
           .element_limits = buffers_->element_limits},
          1);
    return {};
}

Result<void> StackGenerator::generate(ColumnSet& out, const ColumnRectangle& rectangle) {
    if (auto checked = check_range(rectangle); !checked) {
        return checked;
    }
    if (auto built = build(rectangle); !built) {
        return built;
    }
    write({.grid = out.columns,
           .palette = out.palette,
           .highest_y256 = out.highest_y256,
           .element_ids = buffers_->element_ids,
           .element_limits = buffers_->element_limits},
          0);
    return {};
}

}  // namespace terrane
