// What one viewer wants to see: a set of chunks, most urgent first, that a new ViewUpdate replaces.
// No socket, no clock, no service: values in, wishes out, so tests step it.
//
// The set is a quadtree's leaves (terrane.fbs has the rule). All its distances are the larger of
// |dx| and |dz|, so of each level the squares that are there, and of these the ones that are split,
// are two rectangles, and the level's leaves are a frame between them:
//
//     +-----------------+  there: the children of what is split one level above
//     |   +---------+   |
//     |   |  split  |   |  the frame: leaves of this level
//     |   +---------+   |
//     +-----------------+
//
// So the whole set is at most 36 rectangles, asking whether a chunk is in it is a few comparisons,
// and memory is taken only for squares that have not been handed out whole. A leaf of level 0
// stands for a stack of chunks; they are handed out from the viewer's height outwards, so what has
// been handed out of a stack is always an interval.
#pragma once

#include "protocol/base/coords.h"
#include "protocol/wire/limits.h"
#include "protocol/wire/messages.h"

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <vector>

namespace terrane {

/// What a view must know of its world.
struct ViewWorld {
    std::int32_t side = 32;          ///< columns
    std::int32_t chunk_height = 32;  ///< voxels
    double height_bound_voxels = 0;  ///< chunks above it are not wanted
    std::int32_t levels = 1;         ///< that are served
};

struct ViewBounds {
    std::uint32_t radius_max = 64;   ///< of each level
    std::size_t squares_max = 8192;  ///< leaves; at more, the outermost are left out
};

/// The leaves of one view.
class ViewSquares {
  public:
    ViewSquares() = default;
    ViewSquares(const ViewUpdate& update, const ViewWorld& world, const ViewBounds& bounds);

    bool contains(StackPos square) const;
    std::size_t size() const;
    /// A number below `places` for each square that is in it; no two have the same.
    std::size_t place_of(StackPos square) const;
    std::size_t places() const;

    /// Level 0 first, rows of z, then x.
    template <typename Visit>
    void for_each(Visit visit) const;

    friend bool operator==(const ViewSquares&, const ViewSquares&) = default;

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

        std::int64_t size() const { return x.size() * z.size(); }

        friend bool operator==(const Rectangle&, const Rectangle&) = default;
    };

    struct Level {
        Rectangle there;
        Rectangle split;

        friend bool operator==(const Level&, const Level&) = default;
    };

    struct Centre {
        double x = 0;  ///< in sides of level 0
        double z = 0;
    };

    static Span common(Span a, Span b);
    void build(Centre centre, const std::vector<double>& radii);

    std::array<Level, kViewLevelsMax> levels_{};
};

/// One thread. A chunk that was handed out counts as sent until `give_back`.
class View {
  public:
    /// Each level-0 leaf has a chunk of every height from 0 to that of the world's bound.
    View(const ViewWorld& world, const ViewBounds& bounds);

    /// From now on this is wanted. Chunks that stay keep what has become of them, unless format or
    /// `without_flow` are others: then all is wanted again.
    void update(const ViewUpdate& update);

    bool contains(ChunkPos key) const;
    /// How urgent a chunk of the view is, for the service: from kNearPriority on for the squares
    /// that touch the viewer's own, else 0 and less, 16 a side of distance.
    std::int32_t priority_of(StackPos square) const;

    bool has_wish() const { return !waiting_.empty() || !returned_.empty(); }

    /// Of the next wish; there must be one.
    std::int32_t next_priority() const;
    /// Hands out the most urgent wish; there must be one.
    ChunkPos take();
    /// It was not sent after all. Ignored if it has left the view.
    void give_back(ChunkPos key);

    bool has_forgotten() const { return !forgotten_.empty(); }

    /// Some of what has left the view and had been handed out; never empty if there is any. A
    /// chunk that is wanted again is not to be sent before all are told.
    std::vector<ChunkPos> take_forgotten(std::size_t count_max);

    /// Squares of the view.
    std::size_t squares() const { return squares_.size(); }

    /// Squares that have not been handed out whole.
    std::size_t waiting_squares() const { return waiting_.size(); }

    std::int32_t heights() const { return heights_; }

    /// The bytes that a view of `bounds` may come to hold.
    static std::size_t bytes_max(const ViewBounds& bounds);

  private:
    /// Heights [low, high) of a square.
    struct Stretch {
        StackPos square;
        std::int32_t low = 0;
        std::int32_t high = 0;
    };

    struct Waiting {
        Stretch handed;  ///< out already
        std::int32_t priority = 0;
    };

    struct Ground {
        float x = 0;
        float z = 0;
    };

    std::int32_t heights_of(StackPos square) const { return square.lod == 0 ? heights_ : 1; }

    void look(const ViewUpdate& update);
    void forget_what_left(const ViewSquares& next);
    std::optional<std::size_t> next_returned() const;

    const ViewWorld world_;
    const ViewBounds bounds_;
    const std::int32_t heights_;
    ViewSquares squares_;
    ChunkFormat format_ = ChunkFormat::draco;
    bool without_flow_ = false;
    double x_sides_ = 0;  ///< the viewer, in sides of level 0
    double z_sides_ = 0;
    std::int32_t y_chunk_ = 0;        ///< within the heights
    Ground ahead_;                    ///< from the viewer to where it will be, in sides of level 0
    Ground direction_;                ///< of length 1, or zero
    float cone_cosine_ = -2;          ///< of half the field of view; below -1: no cone
    std::vector<Waiting> waiting_;    // a heap, the most urgent on top
    std::vector<ChunkPos> returned_;  // handed out and given back
    std::vector<Stretch> forgotten_;  // that nobody has been told of
    std::vector<bool> unfinished_;    // scratch: by place
};

}  // namespace terrane
