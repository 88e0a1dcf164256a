// Which chunks a view is: the rule of terrane.fbs (ViewUpdate), on the client's side.
//
// The server decides what it sends; a client that computes the same set knows what is still to come
// and where its levels end. All distances are the larger of |dx| and |dz|, so the squares of one
// level are a rectangle, and those of them that are split are a rectangle inside.
#pragma once

#include "protocol/base/coords.h"
#include "protocol/wire/limits.h"
#include "protocol/wire/messages.h"

#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

namespace terrane {

/// Chunks of a leaf: every height from y = 0 to the world's bound at level 0, one above.
std::int32_t heights_of(std::int32_t lod, const ServerHello& world);

/// The leaves of one view. A value; one thread at a time.
class ViewSet {
  public:
    /// Nothing.
    ViewSet() = default;
    /// Radii above the server's limit and levels that it does not serve count as it counts them.
    ViewSet(const ViewUpdate& view, const ServerHello& world);

    bool contains(StackPos square) const;

    /// Level 0 first, rows of z, then x.
    std::vector<StackPos> squares() const;

    std::size_t size() const;

    friend bool operator==(const ViewSet&, const ViewSet&) = default;

  private:
    struct Span {
        std::int64_t first = 0;
        std::int64_t last = -1;  ///< below `first`: nothing

        bool has(std::int64_t at) const { return at >= first && at <= last; }

        std::int64_t size() const { return last < first ? 0 : last - first + 1; }

        friend bool operator==(const Span&, const Span&) = default;
    };

    struct Rectangle {
        Span x;
        Span z;

        bool has(std::int64_t at_x, std::int64_t at_z) const { return x.has(at_x) && z.has(at_z); }

        friend bool operator==(const Rectangle&, const Rectangle&) = default;
    };

    struct Level {
        Rectangle there;
        Rectangle split;

        friend bool operator==(const Level&, const Level&) = default;
    };

    std::array<Level, kViewLevelsMax> levels_{};
};

}  // namespace terrane
