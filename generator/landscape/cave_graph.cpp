#include "generator/landscape/caves.h"
#include "generator/landscape/fold.h"
#include "generator/landscape/numbers.h"
#include "generator/terrain/choose_composition.h"
#include "generator/terrain/layer_stack.h"
#include "generator/terrain/noise.h"
#include "generator/terrain/random.h"
#include "generator/world/world_definition.h"
#include "protocol/base/coords.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <utility>
#include <vector>

namespace terrane {
namespace {

constexpr double kLowest = 0.15;  // of the stack's depth
constexpr double kHighest = 0.95;
constexpr double kSolubleLeast = 2;  // voxels
constexpr double kDiagonalShare = 0.3;
constexpr double kChamberRadius = 2.4;
constexpr float kBend = 0.45F;            // of a tube's length, sideways
constexpr std::int64_t kCellsBefore = 2;  // tubes from so many cells before reach a column
constexpr std::int64_t kCellsAfter = 1;

enum class Link : std::uint8_t { east, south, diagonal, up };

struct CaveNode {
    std::uint64_t id = 0;
    std::int64_t x = 0;
    std::int64_t z = 0;
    float y = 0;
    float radius = 0;
    bool east = false;
    bool south = false;
    bool diagonal = false;
    bool up = false;
    bool opens = false;
};

std::optional<CaveNode> make_node(const CaveConstants& constants, const FoldConstants& folds,
                                  std::int64_t i, std::int64_t j, std::size_t level) {
    CaveNode node;
    node.id = key(constants.seed, LandscapeTag::cave, i, j, level);
    RandomStream random(node.id);
    const CaveParameters& caves = constants.parameters;
    if (random.unit() >= caves.density) {
        return std::nullopt;
    }
    const auto cell = static_cast<double>(constants.cell);
    const CaveHorizon& horizon = constants.horizons[level];
    node.x = i * constants.cell + static_cast<std::int64_t>((0.15 + 0.7 * random.unit()) * cell);
    node.z = j * constants.cell + static_cast<std::int64_t>((0.15 + 0.7 * random.unit()) * cell);
    node.y = horizon.bottom + horizon.thickness * (0.2F + 0.5F * unit_float(random)) +
             fold_at(folds, node.x, node.z);
    const auto soluble = static_cast<double>(horizon.soluble);
    double radius = caves.radius * (0.6 + 0.8 * random.unit()) * (0.55 + 0.45 * soluble);
    if (random.unit() < caves.chamber * soluble) {
        radius *= kChamberRadius;
    }
    node.radius = static_cast<float>(radius);
    node.east = random.unit() < caves.connect;
    node.south = random.unit() < caves.connect;
    node.diagonal = random.unit() < kDiagonalShare * caves.connect;
    node.up = random.unit() < caves.shaft;
    node.opens = random.unit() < caves.sink && level + 1 == constants.horizons.size();
    return node;
}

Tube make_tube(const CaveConstants& constants, const CaveNode& from, const CaveNode& to,
               Link link) {
    RandomStream random(key(from.id, static_cast<std::uint64_t>(link)));
    Tube tube;
    tube.x = from.x;
    tube.z = from.z;
    const auto ex = static_cast<float>(to.x - from.x);
    const auto ez = static_cast<float>(to.z - from.z);
    const float first_bend = (2.0F * unit_float(random) - 1.0F) * kBend;
    const float second_bend = (2.0F * unit_float(random) - 1.0F) * kBend;
    const float radius =
        static_cast<float>(constants.parameters.radius) * (0.45F + 0.5F * unit_float(random));
    for (std::size_t p = 0; p < kTubePoints; ++p) {
        const float t = static_cast<float>(p) / static_cast<float>(kTubePoints - 1);
        const float s = 1.0F - t;
        // Two bumps of height 1, at a third and at two thirds.
        const float aside = 6.75F * t * s * (first_bend * s + second_bend * t);
        const float swell_from = std::max(0.0F, 1.0F - 4.0F * t);
        const float swell_to = std::max(0.0F, 1.0F - 4.0F * s);
        const float uneven =
            p == 0 || p == kTubePoints - 1 ? 0.0F : (2.0F * unit_float(random) - 1.0F) * 1.5F;
        tube.points[p] = {.x = ex * t - ez * aside,
                          .z = ez * t + ex * aside,
                          .y = lerp(from.y, to.y, smooth_step(0, 1, t)) + uneven,
                          .radius = radius + swell_from * (from.radius - radius) +
                                    swell_to * (to.radius - radius)};
        const TubePoint& point = tube.points[p];
        const float most = 1.45F * point.radius + 1.0F;
        tube.x_min = p == 0 ? point.x - most : std::min(tube.x_min, point.x - most);
        tube.x_max = p == 0 ? point.x + most : std::max(tube.x_max, point.x + most);
        tube.z_min = p == 0 ? point.z - most : std::min(tube.z_min, point.z - most);
        tube.z_max = p == 0 ? point.z + most : std::max(tube.z_max, point.z + most);
        tube.y_min = p == 0 ? point.y - most : std::min(tube.y_min, point.y - most);
    }
    return tube;
}

/// The nodes of a rectangle of cells, made when they are first asked for.
class CaveNodes {
  public:
    CaveNodes(const CaveConstants& constants, const FoldConstants& folds, const CaveCells& cells)
        : constants_(constants),
          folds_(folds),
          cells_(cells),
          nodes_(static_cast<std::size_t>((cells.width + 1) * (cells.length + 1))) {}

    const std::optional<CaveNode>& at(std::int64_t i, std::int64_t j, std::size_t level) {
        auto& of_cell = nodes_[static_cast<std::size_t>((j - cells_.first_j) * (cells_.width + 1) +
                                                        (i - cells_.first_i))];
        for (std::size_t l = of_cell.size(); l < constants_.horizons.size(); ++l) {
            of_cell.push_back(make_node(constants_, folds_, i, j, l));
        }
        return of_cell[level];
    }

  private:
    const CaveConstants& constants_;
    const FoldConstants& folds_;
    CaveCells cells_;
    std::vector<std::vector<std::optional<CaveNode>>> nodes_;
};

/// What begins in cell (i, j).
void fill_cell(CaveCell& cell, const CaveConstants& constants, CaveNodes& nodes, std::int64_t i,
               std::int64_t j) {
    cell.tubes.clear();
    cell.dolines.clear();
    const std::size_t levels = constants.horizons.size();
    for (std::size_t level = 0; level < levels; ++level) {
        const auto from = nodes.at(i, j, level);
        if (!from) {
            continue;
        }
        const auto join = [&](bool wanted, std::int64_t to_i, std::int64_t to_j,
                              std::size_t to_level, Link link) {
            if (!wanted) {
                return;
            }
            if (const auto to = nodes.at(to_i, to_j, to_level)) {
                cell.tubes.push_back(make_tube(constants, *from, *to, link));
            }
        };
        join(from->east, i + 1, j, level, Link::east);
        join(from->south, i, j + 1, level, Link::south);
        join(from->diagonal, i + 1, j + 1, level, Link::diagonal);
        join(from->up && level + 1 < levels, i, j, level + 1, Link::up);
        if (from->opens) {
            cell.dolines.push_back({.x = from->x,
                                    .z = from->z,
                                    .y = from->y,
                                    .radius = std::max(2.0F, 0.6F * from->radius)});
        }
    }
}

/// The cells whose tubes reach a shape.
CaveCells cells_around(const RectangleShape& shape, std::int64_t cell) {
    const std::int64_t i0 = floor_div(shape.x0, cell) - kCellsBefore;
    const std::int64_t j0 = floor_div(shape.z0, cell) - kCellsBefore;
    const std::int64_t i1 =
        floor_div(shape.x0 + (shape.width - 1) * shape.step, cell) + kCellsAfter;
    const std::int64_t j1 =
        floor_div(shape.z0 + (shape.length - 1) * shape.step, cell) + kCellsAfter;
    return {.first_i = i0, .first_j = j0, .width = i1 - i0 + 1, .length = j1 - j0 + 1};
}

}  // namespace

CaveConstants::CaveConstants(const WorldDefinition& definition, const LayerStack& stack)
    : cell(definition.caves.cell),
      parameters(definition.caves),
      seed(definition.seed),
      rough(Noise::make(key(definition.seed, LandscapeTag::cave_noise, 1), 9, 1)),
      ragged(Noise::make(key(definition.seed, LandscapeTag::cave_noise, 2), 21, 1)) {
    const double depth = definition.terrain.depth;
    const double band = (kHighest - kLowest) * depth / parameters.levels;
    for (std::int32_t level = 0; level < parameters.levels; ++level) {
        const double low = kLowest * depth + band * level;
        double best = kSolubleLeast;
        std::optional<CaveHorizon> horizon;
        for (const Layer& layer : stack.layers) {
            const double middle = layer.bottom + layer.thickness / 2;
            const double soluble = mixed_property(definition, layer.composition,
                                                  [](const Material& m) { return m.soluble; });
            if (middle >= low && middle < low + band && soluble * layer.thickness > best) {
                best = soluble * layer.thickness;
                horizon = {.bottom = static_cast<float>(layer.bottom),
                           .thickness = static_cast<float>(layer.thickness),
                           .soluble = static_cast<float>(soluble)};
            }
        }
        if (horizon) {
            horizons.push_back(*horizon);
        }
    }
}

void CaveGraph::build(const CaveConstants& constants, const FoldConstants& folds,
                      const RectangleShape& shape) {
    if (constants.cell == 0 || constants.horizons.empty()) {
        return;
    }
    const CaveCells wanted = cells_around(shape, constants.cell);
    if (wanted == known_) {
        return;
    }
    CaveNodes nodes(constants, folds, wanted);
    // Nothing is known until all is: memory may run out on the way.
    const CaveCells known = std::exchange(known_, {});
    std::swap(cells_, before_);
    cells_.resize(static_cast<std::size_t>(wanted.width * wanted.length));
    for (std::int64_t j = wanted.first_j; j < wanted.first_j + wanted.length; ++j) {
        for (std::int64_t i = wanted.first_i; i < wanted.first_i + wanted.width; ++i) {
            CaveCell& cell = cells_[wanted.index(i, j)];
            if (known.holds(i, j)) {
                std::swap(cell, before_[known.index(i, j)]);
            } else {
                fill_cell(cell, constants, nodes, i, j);
            }
        }
    }
    known_ = wanted;
}

}  // namespace terrane
