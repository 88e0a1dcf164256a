#include "generator/terrain/plot_cache.h"

#include "generator/terrain/element.h"
#include "generator/terrain/random.h"
#include "generator/terrain/world.h"

#include <cstddef>
#include <optional>
#include <utility>
#include <vector>

namespace terrane {

std::size_t PlotCache::PlotHash::operator()(const PlotPos& plot) const {
    return key(0, plot.x, plot.z);
}

void PlotCache::trim() {
    if (element_count_ > kElementsMax || plots_.size() > kPlotsMax) {
        plots_.clear();
        element_count_ = 0;
    }
}

std::vector<PlottedElement>& PlotCache::get(const World& world, PlotPos plot) {
    const auto known = plots_.find(plot);
    if (known != plots_.end()) {
        return known->second;
    }
    // Whole before it is kept: what throws half-way must not leave an empty plot behind.
    draw_plot(drawn_, world, plot);
    std::vector<PlottedElement> elements;
    elements.reserve(drawn_.size());
    for (const Element& element : drawn_) {
        elements.push_back({.element = element, .shape = std::nullopt});
    }
    const std::size_t count = elements.size();
    std::vector<PlottedElement>& kept = plots_.try_emplace(plot, std::move(elements)).first->second;
    element_count_ += count;
    return kept;
}

}  // namespace terrane
