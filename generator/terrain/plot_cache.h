// Elements of recently used plots with their outlines, so that neighbouring stacks do not draw them
// again. Forgetting a plot costs time only.
#pragma once

#include "generator/terrain/element.h"
#include "generator/terrain/element_shape.h"

#include <cstdint>
#include <optional>
#include <unordered_map>
#include <vector>

namespace terrane {

/// An element and, once somebody needed it, its outline.
struct PlottedElement {
    Element element;
    std::optional<ElementShape> shape;
};

/// One thread's.
class PlotCache {
  public:
    /// About 3 KiB each with outline. What one region needs is always held, whatever its number.
    static constexpr std::size_t kElementsMax = 4096;
    static constexpr std::size_t kPlotsMax = 1024;

    /// Drops everything if the cache is over its limits. Between regions only: `get`'s results end.
    void trim();

    /// The plot's elements in drawing order; they stay where they are until `trim`.
    std::vector<PlottedElement>& get(const World& world, PlotPos plot);

  private:
    struct PlotHash {
        std::size_t operator()(const PlotPos& plot) const;
    };

    std::unordered_map<PlotPos, std::vector<PlottedElement>, PlotHash> plots_;
    std::size_t element_count_ = 0;
    std::vector<Element> drawn_;
};

}  // namespace terrane
