#include "generator/terrain/choose_composition.h"

#include "generator/terrain/random.h"
#include "generator/world/composition.h"
#include "generator/world/world_definition.h"

#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>

namespace terrane {
namespace {

struct Candidate {
    std::uint16_t material = 0;
    double weight = 0;
};

/// Candidates in id order; material indices are.
struct Candidates {
    std::array<Candidate, kMaterialsMax> list{};
    std::size_t count = 0;

    void add(std::size_t material, double weight) {
        list[count++] = {.material = static_cast<std::uint16_t>(material), .weight = weight};
    }
};

/// How well a depth suits a material: 0 outside its range, 1 at its best, linear between.
double depth_weight(const Range& range, double depth) {
    if (depth < range.least || depth > range.most) {
        return 0;
    }
    double nearness = 1;
    if (depth < range.best) {
        nearness = (depth - range.least) / (range.best - range.least);
    } else if (depth > range.best) {
        nearness = (range.most - depth) / (range.most - range.best);
    }
    return 0.0625 + 0.9375 * nearness;
}

/// Eq. 1: affinity with what is below; nothing if a pair may never touch.
std::optional<double> affinity_with(const WorldDefinition& definition, std::size_t material,
                                    const Composition* previous) {
    if (previous == nullptr) {
        return 1.0;
    }
    double affinity = 0;
    for (const Share& share : previous->shares()) {
        const double pair = definition.next_layer_affinity(material, share.material);
        if (pair == -1.0) {
            return std::nullopt;
        }
        affinity += pair * share.concentration;
    }
    return affinity;
}

/// Eq. 2: one draw, always.
std::uint16_t pick(RandomStream& random, const Candidates& candidates) {
    const double drawn = random.unit();
    double sum = 0;
    for (std::size_t i = 0; i < candidates.count; ++i) {
        sum += candidates.list[i].weight;
    }
    if (sum == 0) {
        const auto i = static_cast<std::size_t>(drawn * static_cast<double>(candidates.count));
        return candidates.list[i].material;
    }
    const double target = drawn * sum;
    double running = 0;
    for (std::size_t i = 0; i < candidates.count; ++i) {
        running += candidates.list[i].weight;
        if (running > target) {
            return candidates.list[i].material;
        }
    }
    return candidates.list[candidates.count - 1].material;
}

MaterialKind main_kind(Filling filling) {
    switch (filling) {
        case Filling::base:
            return MaterialKind::base;
        case Filling::regular:
            return MaterialKind::regular;
        case Filling::vein:
            return MaterialKind::vein;
        case Filling::cave:
            break;
    }
    return MaterialKind::cave;
}

bool may_join(Filling filling, MaterialKind kind) {
    return kind == main_kind(filling) ||
           (filling == Filling::vein && kind == MaterialKind::regular);
}

Candidates main_candidates(const WorldDefinition& definition, Filling filling,
                           const Composition* previous, double depth) {
    Candidates candidates;
    for (std::size_t i = 0; i < definition.materials.size(); ++i) {
        const Material& material = definition.materials[i];
        if (material.kind != main_kind(filling)) {
            continue;
        }
        const auto affinity = affinity_with(definition, i, previous);
        const double suits = filling == Filling::base ? 1 : depth_weight(material.depth, depth);
        if (affinity && suits != 0) {
            candidates.add(i, *affinity * suits);
        }
    }
    return candidates;
}

/// The sum of affinities with what is chosen already; nothing if a pair may never share a layer.
std::optional<double> affinity_within(const WorldDefinition& definition, std::size_t material,
                                      std::span<const std::uint16_t> chosen) {
    double sum = 0;
    for (const std::uint16_t other : chosen) {
        const double pair = definition.same_layer_affinity(material, other);
        if (other == material || pair == -1.0) {
            return std::nullopt;
        }
        sum += pair;
    }
    return sum;
}

Candidates companions(const WorldDefinition& definition, Filling filling,
                      const Composition* previous, double depth,
                      std::span<const std::uint16_t> chosen) {
    Candidates candidates;
    for (std::size_t i = 0; i < definition.materials.size(); ++i) {
        const Material& material = definition.materials[i];
        if (!may_join(filling, material.kind) || material.alone) {
            continue;
        }
        const auto below = affinity_with(definition, i, previous);
        const auto within = affinity_within(definition, i, chosen);
        const double suits = filling == Filling::base ? 1 : depth_weight(material.depth, depth);
        if (below && within && suits != 0) {
            candidates.add(i, (*below + *within) * suits);
        }
    }
    return candidates;
}

}  // namespace

std::optional<Composition> choose_composition(RandomStream& random,
                                              const WorldDefinition& definition, Filling filling,
                                              const Composition* previous, double depth) {
    const Candidates mains = main_candidates(definition, filling, previous, depth);
    if (mains.count == 0) {
        return std::nullopt;
    }
    std::array<std::uint16_t, kCompositionMaterialsMax> chosen{};
    std::size_t count = 0;
    chosen[count++] = pick(random, mains);
    if (filling != Filling::cave && !definition.materials[chosen[0]].alone) {
        double chance = 0.5;
        while (count < chosen.size() && random.unit() < chance) {
            chance /= 2;
            const Candidates more =
                companions(definition, filling, previous, depth, {chosen.data(), count});
            if (more.count == 0) {
                break;
            }
            chosen[count++] = pick(random, more);
        }
    }
    Composition composition;
    if (count == 1) {
        composition.add(chosen[0], 1);
        return composition;
    }
    const double main_share = 0.5 + 0.4 * random.unit();
    std::array<double, kCompositionMaterialsMax> weights{};
    double sum = 0;
    for (std::size_t i = 1; i < count; ++i) {
        weights[i] = 1 - random.unit();
        sum += weights[i];
    }
    composition.add(chosen[0], main_share);
    for (std::size_t i = 1; i < count; ++i) {
        composition.add(chosen[i], (1 - main_share) * weights[i] / sum);
    }
    return composition;
}

double triangular(const Range& range, double u) {
    const double width = range.most - range.least;
    if (width <= 0) {
        return range.least;
    }
    const double turn = (range.best - range.least) / width;
    return u < turn ? range.least + std::sqrt(u * width * (range.best - range.least))
                    : range.most - std::sqrt((1 - u) * width * (range.most - range.best));
}

DrawnProperties draw_properties(RandomStream& random, const WorldDefinition& definition,
                                const Composition& composition) {
    DrawnProperties properties;
    for (const Share& share : composition.shares()) {
        const Material& material = definition.materials[share.material];
        properties.thickness += share.concentration * triangular(material.thickness, random.unit());
        properties.roughness += share.concentration * triangular(material.roughness, random.unit());
    }
    return properties;
}

bool is_alone(const WorldDefinition& definition, const Composition& composition) {
    return definition.materials[composition.storage[0].material].alone;
}

std::int32_t blend256(double blend) {
    return static_cast<std::int32_t>(std::floor(static_cast<float>(blend) * 256.0F + 0.5F));
}

}  // namespace terrane
