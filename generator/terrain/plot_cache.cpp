#include "generator/terrain/plot_cache.h"

#include "generator/terrain/random.h"

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
    const auto [place, is_new] = plots_.try_emplace(plot);
    std::vector<PlottedElement>& elements = place->second;
    if (is_new) {
        draw_plot(drawn_, world, plot);
        elements.reserve(drawn_.size());
        for (const Element& element : drawn_) {
            elements.push_back({.element = element, .shape = std::nullopt});
        }
        element_count_ += elements.size();
    }
    return elements;
}

}  // namespace terrane
